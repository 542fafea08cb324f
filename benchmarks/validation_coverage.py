"""How often tests of a model against measurements alarm falsely, and what they find.

A table of docs/coverage/validation.md as `seed_table.py` makes it. Half of the variance of each
measured value is of the inputs, half of measurement, so u_val is 1. A part of both is common to all
values, by which they are correlated.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import xarray as xr
from scipy.stats import norm
from seed_table import LOWEST, Case, Row, SeedTable, share, share_of, table, totals

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Output
from uqpen.core.statistic import AcceptanceVerdict
from uqpen.core.streams import Stream
from uqpen.statistics.validation import Validation, validation_statistics

LEVEL, ACCEPTED = 0.95, 4.0
OUTPUT = Output("y", "1")
# True area metric where the model is off by one u_val at each value: mean PIT value minus a half.
_AREA_OF_BIASED = norm.cdf(np.sqrt(0.5)) - 0.5
P_VALUES = ("joint", "ks", "share", "area")


def comparison(seed: int, draws: int, values: int, correlation: float) -> Validation:
    """Return a right model and measurements."""
    rng = np.random.default_rng([seed, draws, values, round(100 * correlation)])
    covariance = ((1 - correlation) * np.eye(values) + correlation) / 2
    factor = np.linalg.cholesky(covariance)
    predicted, errors = (rng.standard_normal((draws + 1, values)) @ factor.T for _ in range(2))
    return Validation(
        measured=predicted[-1] + errors[-1],
        censoring=np.zeros(values, np.int64),
        predicted=predicted[:-1],
        errors=errors[:-1],
        covariance=covariance,
        used_before=np.zeros(values, np.bool_),
        level=LEVEL,
        stream=Stream(seed, "validation"),
        accept=ACCEPTED,
    )


def _off_by(right: Validation, error: FloatArray | float) -> Validation:
    return replace(right, measured=right.measured - error)


def _statistic(validation: Validation, name: str) -> xr.DataArray:
    return next(found for each, found in validation_statistics(validation, OUTPUT) if each == name)


def _finds(validation: Validation) -> bool:
    return bool(_statistic(validation, "joint_p_value")[0] <= 1 - LEVEL)


def _rows(draws: int, values: int, correlation: int, seeds: Sequence[int]) -> Iterator[Row]:
    first = np.eye(values)[0]
    found: Counter[str] = Counter(dict.fromkeys(SUMS, 0))
    for seed in seeds:
        right = comparison(seed, draws, values, correlation / 100)
        of = dict(validation_statistics(right, OUTPUT))
        for name in P_VALUES:
            found[name] += bool(of[f"{name}_p_value"][0] <= 1 - LEVEL)
        error = of["comparison_error"].values
        found["covers"] += int(((error[:, 1] <= 0) & (error[:, 2] >= 0)).sum())
        found["two"] += _finds(_off_by(right, 2 * first))
        found["four"] += _finds(_off_by(right, 4 * first))
        found["detectable"] += float(of["detectable_error"][0, 0])
        found["detectable_common"] += float(of["detectable_common_error"][0])
        found["right_area"] += bool(of["area"][1] <= 0)
        area = _statistic(_off_by(right, 1.0), "area").values
        found["biased_area"] += bool(area[1] <= _AREA_OF_BIASED <= area[2])
        found["met"] += right.verdict is AcceptanceVerdict.MET
        at_limit = _off_by(right, ACCEPTED)
        found["met_at_limit"] += at_limit.verdict is AcceptanceVerdict.MET
        found["not_met_at_limit"] += at_limit.verdict is AcceptanceVerdict.NOT_MET
        each = Counter(at_limit.verdicts(LEVEL))
        found["row_met_at_limit"] += each[AcceptanceVerdict.MET]
        found["row_not_met_at_limit"] += each[AcceptanceVerdict.NOT_MET]
    yield found


SUMS = (
    *P_VALUES, "covers", "two", "four", "detectable", "detectable_common", "right_area",
    "biased_area", "met", "met_at_limit", "not_met_at_limit", "row_met_at_limit",
    "row_not_met_at_limit",
)  # fmt: skip


def _share_of_values(name: str) -> Callable[[SimpleNamespace], str]:
    return lambda c: share(getattr(c, name), c.count * c.values)


_CASE = {"draws": "draws", "values": "values", "correlation": lambda c: f"{c.correlation / 100:g}"}
TESTS = {
    **_CASE,
    "seeds": "count",
    "joint test": share_of("joint"),
    "KS": share_of("ks"),
    "share inside": share_of("share"),
    "area": share_of("area"),
    "2 u_val in one": share_of("two"),
    "4 u_val in one": share_of("four"),
    "found in 80 %: in one": lambda c: f"{c.detectable / c.count:.2f}",
    "in all": lambda c: f"{c.detectable_common / c.count:.2f}",
}
INTERVALS = {
    **_CASE,
    "E ± k u_val": _share_of_values("covers"),
    "area, right model": share_of("right_area"),
    "area, 1 u_val": share_of("biased_area"),
    "met, right model": share_of("met"),
    "met at the limit": share_of("met_at_limit"),
    "not met at the limit": share_of("not_met_at_limit"),
    "one value: met": _share_of_values("row_met_at_limit"),
    "not met": _share_of_values("row_not_met_at_limit"),
}


def _page(rows: Sequence[Row]) -> Iterator[str]:
    cells = totals(rows, *KEYS).values()
    yield from table(cells, TESTS)
    yield ""
    yield from table(cells, INTERVALS)


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for key, cell in totals(rows, *KEYS).items():
        if not 0.03 <= cell.joint / cell.count <= 0.07:
            yield f"{key}: size of the joint test {share_of('joint')(cell)}"
        for name in ("met_at_limit", "not_met_at_limit"):
            if getattr(cell, name) > 0.05 * cell.count:
                yield f"{key}: {name} in {share_of(name)(cell)}"
        if cell.covers < 0.93 * cell.count * cell.values:
            yield f"{key}: E ± k u_val covers {_share_of_values('covers')(cell)}"
        for name in ("right_area", "biased_area"):
            if getattr(cell, name) < LOWEST * cell.count:
                yield f"{key}: {name} in {share_of(name)(cell)}"


def _cases() -> Iterator[Case]:
    yield from itertools.product((50, 200, 1000), (5, 10, 20), (0, 50, 90))
    # More values than draws.
    yield from ((50, 100, correlation) for correlation in (0, 50, 90))


KEYS = ("draws", "values", "correlation")
TABLE = SeedTable(KEYS, _rows, {"validation": _page}, _failing, at_once=25, cases=_cases)

if __name__ == "__main__":
    TABLE.main(__doc__)
