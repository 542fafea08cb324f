"""How often answers of reweighted runs agree with fresh runs, and how often both contain the truth.

A table of docs/coverage/reweighted.md as `seed_table.py` makes it. Two answers agree where the
interval of their difference contains 0, by the distances of the facing ends (MOVER).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from problems import independent
from seed_table import LOWEST, Row, SeedTable, per_cent, summed, totals

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import REWEIGHTED, RUN, SAMPLING, STATUS, WEIGHT
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.distributions.copulas import GaussianCopula
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.joint_distribution import JointDistribution, points_dataset
from uqpen.distributions.univariate import Beta, Discrete, Gamma, Normal, Student, Uniform
from uqpen.statistics.analyze import analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.statistics.reweighting import expected_weights, relative_weights

RUNS, OF_THE_TRUTH = 1500, 2_000_000
# Probabilities of the events, and of the quantile.
PROBABILITIES = (0.1, 0.05)
STATISTICS = ("P 10 %", "P 5 %", "mean", "90 % quantile")


def _joint(*laws: Distribution, correlation: float = 0.0) -> JointDistribution:
    joint = independent(**{f"x{place}": each for place, each in enumerate(laws)})
    if not correlation:
        return joint
    matrix = ((1.0, correlation), (correlation, 1.0))
    return replace(joint, dependence=GaussianCopula(("x0", "x1"), matrix))


class Setting(NamedTuple):
    """Distributions of the runs and of the question, and a function of their inputs."""

    drawn: JointDistribution
    asked: JointDistribution
    function: Callable[[FloatArray, FloatArray], FloatArray]


def _sum(one: FloatArray, other: FloatArray) -> FloatArray:
    return one + other


def _curved(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.exp(0.4 * one) + 0.5 * other**2


_NORMAL = Normal(0.0, 1.0)
SETTINGS = {
    "normal, moved by 0.3": Setting(
        _joint(_NORMAL, _NORMAL), _joint(Normal(0.3, 1.0), _NORMAL), _sum
    ),
    "normal, moved by 0.7": Setting(
        _joint(_NORMAL, _NORMAL), _joint(Normal(0.7, 1.0), _NORMAL), _sum
    ),
    "two normals, moved and wider": Setting(
        _joint(_NORMAL, _NORMAL), _joint(Normal(0.3, 1.1), Normal(0.0, 1.1)), _curved
    ),
    "two normals, narrower": Setting(
        _joint(_NORMAL, _NORMAL), _joint(Normal(0.2, 0.8), Normal(0.0, 0.8)), _curved
    ),
    "normal, moved by 1": Setting(
        _joint(_NORMAL, _NORMAL), _joint(Normal(1.0, 1.0), _NORMAL), _curved
    ),
    "uniform to beta": Setting(
        _joint(Uniform(0.0, 1.0), _NORMAL), _joint(Beta(2.0, 3.0, 0.0, 1.0), _NORMAL), _sum
    ),
    "gamma, larger mean": Setting(
        _joint(Gamma(3.0, 1.0), _NORMAL), _joint(Gamma(3.4, 1.0), _NORMAL), _sum
    ),
    "Student's t to normal": Setting(
        _joint(Student(0.0, 1.0, 5.0), _NORMAL), _joint(_NORMAL, _NORMAL), _curved
    ),
    "correlation 0.3 to 0.5": Setting(
        _joint(_NORMAL, _NORMAL, correlation=0.3), _joint(_NORMAL, _NORMAL, correlation=0.5), _sum
    ),
    "other shares of two values": Setting(
        _joint(Discrete((0.0, 1.0), (1.0, 1.0)), _NORMAL),
        _joint(Discrete((0.0, 1.0), (1.0, 3.0)), _NORMAL),
        _curved,
    ),
}


def _draw(joint: JointDistribution, runs: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    return joint.ppf(joint.conditional_probabilities(rng.random((runs, 2)), {}))


@cache
def truths(name: str) -> tuple[FloatArray, FloatArray]:
    """Return the thresholds, and the true values of the statistics."""
    setting = SETTINGS[name]
    values = np.sort(
        setting.function(*_draw(setting.asked, OF_THE_TRUTH, np.random.default_rng(1)).values())
    )
    thresholds = np.quantile(values, 1 - np.array(PROBABILITIES))
    return thresholds, np.array([*PROBABILITIES, values.mean(), np.quantile(values, 0.9)])


def estimates(
    setting: Setting, thresholds: FloatArray, rng: np.random.Generator, *, is_reweighted: bool
) -> FloatArray:
    """Return value, lower and upper end of each statistic, shape (statistic, 3)."""
    values = _draw(setting.drawn if is_reweighted else setting.asked, RUNS, rng)
    output = (RUN, setting.function(*values.values()), {"units": "1"})
    status = (RUN, np.zeros(RUNS, np.int8))
    runs = points_dataset(setting.asked, values, {}, runs=RUNS)
    runs = runs.assign({"y": output, STATUS: status})
    runs.attrs[SAMPLING] = str(Sampling.INDEPENDENT)
    if is_reweighted:
        weights = relative_weights(values, setting.drawn, setting.asked)
        runs = runs.assign_coords({WEIGHT: (RUN, weights)}).assign_attrs({REWEIGHTED: "1"})
    asked = QuantityOfInterest(
        Output("y", "1"),
        "1",
        thresholds=tuple(Threshold(f"{each:g}", float(each)) for each in thresholds),
        quantiles=(0.9,),
    )
    found = analyze(runs, [asked], only=("moments", "exceedance", "quantiles"))["y"]
    quantile = found["quantile"].sel(probability=0.9).values
    return np.vstack([found["exceedance"].values, found["mean"].values, quantile])


def compared(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return where the intervals of differences contain 0, shape (statistic,)."""
    lower, upper = one[:, 0] - one[:, 1], one[:, 2] - one[:, 0]
    below, above = other[:, 0] - other[:, 1], other[:, 2] - other[:, 0]
    difference = one[:, 0] - other[:, 0]
    result: FloatArray = (difference - np.hypot(lower, above) <= 0) & (
        difference + np.hypot(upper, below) >= 0
    )
    return result


def _rows(name: str, seeds: Sequence[int]) -> Iterator[Row]:
    setting = SETTINGS[name]
    thresholds, truth = truths(name)
    for seed in seeds:
        rng = np.random.default_rng([seed, 39])
        again = estimates(setting, thresholds, rng, is_reweighted=True)
        fresh = estimates(setting, thresholds, rng, is_reweighted=False)
        has_both = np.isfinite(again[:, 1]) & np.isfinite(fresh[:, 1])
        row: dict[str, Any] = {}
        for place, agrees in enumerate(compared(again, fresh)):
            row[f"s{place}_found"] = int(has_both[place])
            row[f"s{place}_agrees"] = int(agrees & has_both[place])
            covers = again[place, 1] <= truth[place] <= again[place, 2]
            row[f"s{place}_covers"] = int(covers & has_both[place])
        yield row


def _size(cell: SimpleNamespace) -> str:
    """Return the effective size that is expected, in per cent of the runs."""
    setting = SETTINGS[cell.setting]
    share = expected_weights(setting.drawn, setting.asked)
    return f"{'' if share.is_exact else 'at most '}{100 * share.share:.3g} %"


def _counted(place: int, cell: SimpleNamespace) -> str:
    found, agrees, covers = (
        getattr(cell, f"s{place}_{what}") for what in ("found", "agrees", "covers")
    )
    if found < 0.05 * cell.count:
        return f"{per_cent(found, cell.count)} %"
    parts = (found, cell.count), (agrees, found), (covers, found)
    return ", ".join(f"{per_cent(*each)} %" for each in parts)


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for (name,), cell in totals(rows, "setting").items():
        for place, statistic in enumerate(STATISTICS):
            found = getattr(cell, f"s{place}_found")
            # Where few seeds have an interval, they are those with many events by chance.
            for what, least in (
                (("agrees", 0.93), ("covers", LOWEST)) if 2 * found > cell.count else ()
            ):
                if getattr(cell, f"s{place}_{what}") < least * found:
                    yield f"{name}, {statistic}: {what} too seldom"


COLUMNS = {
    "inputs": "setting",
    "effective size": _size,
    "seeds": "count",
    **{
        f"{each}: with an interval, agrees, covers": partial(_counted, place)
        for place, each in enumerate(STATISTICS)
    },
}
TABLE = SeedTable(
    {"setting": SETTINGS}, _rows, {"reweighted": summed(COLUMNS, "setting")}, _failing, seeds=300
)

if __name__ == "__main__":
    TABLE.main(__doc__)
