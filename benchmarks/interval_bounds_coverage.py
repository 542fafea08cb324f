"""How often bounds over intervals contain the true ones, and how often a search is refused.

A table of docs/coverage/intervals.md as `seed_table.py` makes it. The output is a function of the
intervals and a normal number, so its mean, its quantiles and the probability of an event at each
point of the box are known exactly. The design has its default numbers of runs: 400, and 300 at each
bound.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from problems import runs_of, standard_normals, with_output
from scipy.stats import norm
from seed_table import Row, SeedTable, mean_range, share, share_of, summed, totals

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Input, Output
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import IntervalInput, JointDistribution
from uqpen.statistics.interval_bounds import event_bounds, output_bounds
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.surrogates.interval_bounds import IntervalBounds

THRESHOLD, LEVEL = 2.0, 0.95
# Share of the variance of the normal number that each of two inputs has.
_PARTS = (0.6, 0.8)


class Function(NamedTuple):
    """Mean of the output over the box from -1 to 1, with its least and its largest value."""

    sides: int
    mean: Callable[[FloatArray], FloatArray]  # of points of the box, shape (point, side)
    least: float
    largest: float

    @property
    def bounds(self) -> dict[str, FloatArray]:
        """True bounds of what has some."""
        means = np.array([self.least, self.largest])
        return {
            "P(y > 2)": norm.sf(THRESHOLD - means),
            "mean": means,
            "95 % quantile": means + norm.ppf(0.95),
        }


_SLOPES = np.array([0.3, -0.25, 0.2, 0.2, -0.15, 0.1])


def _six(box: FloatArray) -> FloatArray:
    return box @ _SLOPES - 0.3 * (box[:, 0] - 0.4) ** 2 + 0.2 * box[:, 1] * box[:, 2]


FUNCTIONS = {
    "monotone": Function(
        2, lambda e: np.exp(0.4 * e[:, 0]) - 0.5 * e[:, 1], np.exp(-0.4) - 0.5, np.exp(0.4) + 0.5
    ),
    "interior optimum": Function(
        1, lambda e: 1 - 1.5 * (e[:, 0] - 0.3) ** 2, 1 - 1.5 * 1.3**2, 1.0
    ),
    "two optima": Function(
        3, lambda e: 0.6 * np.sin(2 * e[:, 0]) + 0.6 * e[:, 1] * e[:, 2], -1.2, 1.2
    ),
    # Both at corners in all but the first, whose optimum is inside for the upper one.
    "six intervals": Function(
        6,
        _six,
        float(-_SLOPES[0] - 0.3 * 1.4**2 - np.abs(_SLOPES[3:]).sum() - 0.65),
        float(0.3 * 0.9 - 0.3 * 0.5**2 + np.abs(_SLOPES[3:]).sum() + 0.25),
    ),
    "peak of 4 %": Function(
        1, lambda e: 2 * np.exp(-(((e[:, 0] - 0.27) / 0.034) ** 2) / 2), 0.0, 2.0
    ),
}


def bounds(seed: int, function: Function, **settings: Any) -> list[FloatArray]:
    """Return the bounds of each of `Function.bounds`, shape (end, bound) each."""
    sides = [f"e{number}" for number in range(function.sides)]
    box = tuple(IntervalInput(Input(name, "1"), -1.0, 1.0, "1") for name in sides)
    normals = standard_normals(2)
    joint = JointDistribution(
        (*box, *normals.inputs), (*(each.variable for each in box), *normals.variables)
    )
    design = IntervalBounds(
        events=(f"y > {THRESHOLD}",), means=("y",), quantiles={"y": [0.95]}, **settings
    )

    def make(points: xr.Dataset) -> xr.Dataset:
        box = np.column_stack([points[name].values for name in sides])
        normal = sum(part * points[f"x{place}"].values for place, part in enumerate(_PARTS))
        return with_output(points, function.mean(box) + normal)

    runs = runs_of(design, joint, Stream(seed, "designs", "bounds"), make)
    found = event_bounds(runs, LEVEL) | dict(
        output_bounds(runs, QuantityOfInterest(Output("y", "1"), "1"))
    )
    return [
        np.array([found[f"{end}_{name}"].values.reshape(3) for end in ("lower", "upper")])
        for name in ("probability", "mean", "quantile")
    ]


def _rows(name: str, searches: int, seeds: Sequence[int]) -> Iterator[Row]:
    function = FUNCTIONS[name]
    for seed in seeds:
        found = bounds(seed, function, searches=searches)
        for (of, truth), each in zip(function.bounds.items(), found, strict=True):
            yield {
                "of": of,
                "intervals": int(np.isfinite(each).all()),
                "covers": int(each[0, 1] <= truth[0] and truth[1] <= each[1, 2]),
                "least": float(np.nan_to_num(each[0, 1])),
                "largest": float(np.nan_to_num(each[1, 2])),
            }


KEYS = ("function", "searches", "of")
COLUMNS = {
    "function": "function",
    "intervals": lambda c: FUNCTIONS[c.function].sides,
    "searches": "searches",
    "bounds of": "of",
    "true bounds": lambda c: " to ".join(f"{x:.3g}" for x in FUNCTIONS[c.function].bounds[c.of]),
    "seeds": "count",
    "both are contained": share_of("covers", "intervals"),
    "mean range": mean_range,
    "refused": lambda c: share(c.count - c.intervals, c.count),
}


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for key, cell in totals(rows, *KEYS).items():
        if cell.function == "peak of 4 %":
            if cell.intervals > 0.05 * cell.count:
                yield f"{key}: refused too seldom"
        elif cell.covers < 0.93 * cell.count:
            yield f"{key}: {share(cell.covers, cell.count)}"


TABLE = SeedTable(
    KEYS[:2],
    _rows,
    {"intervals": summed(COLUMNS, *KEYS)},
    _failing,
    seeds=200,
    cases=lambda: [*((name, 1) for name in FUNCTIONS), ("two optima", 2)],
)

if __name__ == "__main__":
    TABLE.main(__doc__)
