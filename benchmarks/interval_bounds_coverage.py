"""How often bounds over intervals contain the true ones, and how often a search is refused.

A table of docs/coverage/intervals.md as `seed_table.py` makes it. The output is a function of the
intervals and a normal number, so its mean, its quantiles and the probability of an event at each
point of the box are known exactly. The design has its default numbers of runs: 400, and 300 at each
bound.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.stats import norm
from seed_table import Case, Row, SeedTable, lines, per_cent, totals

from uqpen.core.labels import ROLE, RUN, SAMPLING, STATUS
from uqpen.core.model import Input, Output
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import points_in_memory, points_of
from uqpen.designs.rounds import run_rounds
from uqpen.distributions.joint_distribution import IntervalInput, JointDistribution, RandomInput
from uqpen.distributions.univariate import Normal
from uqpen.execution import join_rounds
from uqpen.statistics.interval_bounds import event_bounds, output_bounds
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.surrogates.interval_bounds import IntervalBounds

Array = npt.NDArray[np.float64]
THRESHOLD, LEVEL = 2.0, 0.95
# Share of the variance of the normal number that each of two inputs has.
_PARTS = (0.6, 0.8)


class Function(NamedTuple):
    """Mean of the output over the box from -1 to 1, with its least and its largest value."""

    sides: int
    mean: Callable[[Array], Array]  # of points of the box, shape (point, side)
    least: float
    largest: float

    @property
    def bounds(self) -> dict[str, Array]:
        """True bounds of what has some."""
        means = np.array([self.least, self.largest])
        return {
            "P(y > 2)": norm.sf(THRESHOLD - means),
            "mean": means,
            "95 % quantile": means + norm.ppf(0.95),
        }


_SLOPES = np.array([0.3, -0.25, 0.2, 0.2, -0.15, 0.1])


def _six(box: Array) -> Array:
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


def bounds(seed: int, function: Function, **settings: Any) -> list[Array]:
    """Return the bounds of each of `Function.bounds`, shape (end, bound) each."""
    sides = [f"e{number}" for number in range(function.sides)]
    variables = tuple(Input(name, "1", "") for name in (*sides, "x0", "x1"))
    joint = JointDistribution(
        tuple(
            IntervalInput(each, -1.0, 1.0, "1")
            if each.name in sides
            else RandomInput(each, Normal(0.0, 1.0), "1")
            for each in variables
        ),
        variables,
    )
    design = IntervalBounds(
        events=(f"y > {THRESHOLD}",), means=("y",), quantiles={"y": [0.95]}, **settings
    )

    def make_runs(drawn: Any, number: int) -> dict[str, xr.Dataset]:
        points = points_in_memory(points_of(drawn))
        box = np.column_stack([points[name].values for name in sides])
        normal = sum(part * points[f"x{place}"].values for place, part in enumerate(_PARTS))
        values = function.mean(box) + normal
        output = (RUN, values, {"units": "1", ROLE: "output"})
        return {"": points.assign({"y": output, STATUS: (RUN, np.zeros(len(values), np.int8))})}

    rounds = run_rounds(design, joint, Stream(seed, "designs", "bounds"), make_runs)
    runs = join_rounds([each[""] for each in rounds], range(len(rounds)))
    runs = runs.assign_attrs({SAMPLING: str(design.sampling)})
    found = event_bounds(runs, LEVEL) | dict(
        output_bounds(runs, QuantityOfInterest(Output("y", "1"), "1"))
    )
    return [
        np.array([found[f"{end}_{name}"].values.reshape(3) for end in ("lower", "upper")])
        for name in ("probability", "mean", "quantile")
    ]


def _rows(case: Case, seeds: Sequence[int], _: Namespace) -> Iterator[Row]:
    searches, function = int(case[1]), FUNCTIONS[str(case[0])]
    for seed in seeds:
        found = bounds(seed, function, searches=searches)
        for (name, truth), each in zip(function.bounds.items(), found, strict=True):
            yield {
                "of": name,
                "intervals": int(np.isfinite(each).all()),
                "covers": int(each[0, 1] <= truth[0] and truth[1] <= each[1, 2]),
                "least": float(np.nan_to_num(each[0, 1])),
                "largest": float(np.nan_to_num(each[1, 2])),
            }


SUMS = ("count", "intervals", "covers", "least", "largest")


def _page(rows: Sequence[Row]) -> Iterator[str]:
    head = ["function", "intervals", "searches", "bounds of", "true bounds", "seeds"]
    cells = totals(rows, (*KEYS, "of"), SUMS)
    named = [*head, "both are contained", "mean range", "refused"]
    yield from lines(named, (_line(*key, cell) for key, cell in cells.items()))


def _line(name: str, searches: int, of: str, cell: Any) -> list[str]:
    function = FUNCTIONS[name]
    truth = " to ".join(f"{each:.3g}" for each in function.bounds[of])
    row = [name, f"{function.sides}", f"{searches}", of, truth, f"{cell.count}"]
    covers, found = "–", "–"
    if cell.intervals:
        covers = f"{per_cent(cell.covers, cell.intervals)} %"
        found = f"{cell.least / cell.intervals:.3g} to {cell.largest / cell.intervals:.3g}"
    return [*row, covers, found, f"{per_cent(cell.count - cell.intervals, cell.count)} %"]


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for key, cell in totals(rows, (*KEYS, "of"), SUMS).items():
        if key[0] == "peak of 4 %":
            if cell.intervals > 0.05 * cell.count:
                yield f"{key}: refused too seldom"
        elif cell.covers < 0.93 * cell.count:
            yield f"{key}: {per_cent(cell.covers, cell.count)} %"


def _cases() -> Iterator[Case]:
    yield from ((name, 1) for name in FUNCTIONS)
    yield "two optima", 2


KEYS = ("function", "searches")
TABLE = SeedTable(KEYS, _cases, _rows, {"intervals": _page}, _failing, seeds=200)

if __name__ == "__main__":
    sys.exit(TABLE.main(__doc__))
