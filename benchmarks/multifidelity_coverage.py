"""How often intervals of a multifidelity design cover, and how narrow they are at equal cost.

A table of docs/coverage/surrogates.md as `seed_table.py` makes it. Beside each interval stands that
of plain Monte Carlo with as many runs of the model as the budget pays. True values are exact, or
those of a Sobol' sequence. A cell fails below 92 %.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import xarray as xr
from problems import independent, with_output
from scipy.stats import qmc
from seed_table import FEWEST, STUDIES, Row, SeedTable, cross_table, per_cent, too_seldom, totals

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import RUN, SAMPLING
from uqpen.core.model import Model, Output
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import Points, Round, points_in_memory, points_of
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.multifidelity import Multifidelity
from uqpen.designs.rounds import run_rounds
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.distributions.univariate import Uniform
from uqpen.execution import join_rounds
from uqpen.models.rod_models import RigidPenetration
from uqpen.models.walker_anderson import WalkerAnderson
from uqpen.statistics.analyze import analyze
from uqpen.statistics.control_variates import control_variate_statistics
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.study.load import load_study

Columns = Mapping[str, FloatArray]

QUANTILES = (0.05, 0.5, 0.95)
EXCEEDED = (0.14, 0.05, 0.01)
STATISTICS = (
    "mean",
    "std",
    *(f"quantile {p:g}" for p in QUANTILES),
    *(f"P {p:g}" for p in EXCEEDED),
)
PILOT = 50

ROD = load_study(STUDIES / "concrete.toml").joint


class Problem(NamedTuple):
    """A model and its stand-ins by name, the cost of a run of each, and the inputs."""

    title: str
    models: Mapping[str, Callable[[Columns], FloatArray]]
    costs: tuple[float, ...]
    inputs: JointDistribution
    budgets: tuple[int, ...]


def _power(exponent: int) -> Callable[[Columns], FloatArray]:
    return lambda x: x["x1"] ** exponent


def _ishigami(a: float, b: float, exponent: int) -> Callable[[Columns], FloatArray]:
    return lambda x: (
        np.sin(x["x1"]) + a * np.sin(x["x2"]) ** 2 + b * x["x3"] ** exponent * np.sin(x["x1"])
    )


def _depth(model: Model) -> Callable[[Columns], FloatArray]:
    return lambda x: model.evaluate(x).outputs["penetration_depth"]


PROBLEMS = {
    "polynomials": Problem(
        "x⁵ by x⁴, x³, x², x (costs 0.1 to 0.0001)",
        {f"x{power}": _power(power) for power in (5, 4, 3, 2, 1)},
        (1, 0.1, 0.01, 0.001, 0.0001),
        independent(x1=Uniform(0.0, 1.0)),
        (200,),
    ),
    "ishigami": Problem(
        "Ishigami by two of its kind (costs 0.05, 0.001)",
        {"f1": _ishigami(5, 0.1, 4), "f2": _ishigami(4.75, 0.1, 4), "f3": _ishigami(3, 0.9, 2)},
        (1, 0.05, 0.001),
        independent(**dict.fromkeys(("x1", "x2", "x3"), Uniform(-np.pi, np.pi))),
        (200,),
    ),
    "rod": Problem(
        "concrete depth by the rigid rod (cost 0.01)",
        {"original": _depth(WalkerAnderson()), "rigid": _depth(RigidPenetration())},
        (1, 0.01),
        ROD,
        (100, 300, 1000),
    ),
}


class Truth(NamedTuple):
    """True values of the statistics, and the thresholds that are exceeded with `EXCEEDED`."""

    values: dict[str, float]
    thresholds: tuple[float, ...]

    @classmethod
    def of(cls, problem: Problem) -> Truth:
        """Compute the truth of a problem from 131 072 points of a Sobol' sequence."""
        unit = qmc.Sobol(len(problem.inputs.random), seed=1).random_base2(17)
        (model, *_) = problem.models.values()
        values = model(_columns(problem.inputs.points(unit, {})))
        values = values[np.isfinite(values)]
        thresholds = np.quantile(values, 1 - np.array(EXCEEDED))
        found = [values.mean(), values.std(), *np.quantile(values, QUANTILES), *EXCEEDED]
        return cls(dict(zip(STATISTICS, map(float, found), strict=True)), tuple(thresholds))


class Interval(NamedTuple):
    """An interval of a statistic: with stand-ins, and of as many plain runs as the budget pays."""

    statistic: str
    covers: bool
    width: float
    plain_width: float


@cache
def _truth(name: str) -> Truth:
    return Truth.of(PROBLEMS[name])


def _rows(name: str, budget: int, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the numbers of intervals, of those that cover, and their widths added up."""
    found: dict[str, list[Interval]] = defaultdict(list)
    for seed in seeds:
        for interval in _intervals(PROBLEMS[name], _truth(name), budget, seed):
            found[interval.statistic].append(interval)
    for statistic in STATISTICS:
        intervals = found[statistic]
        yield {
            "statistic": statistic,
            "intervals": len(intervals),
            "covers": sum(each.covers for each in intervals),
            "width": sum(each.width for each in intervals),
            "plain_width": sum(each.plain_width for each in intervals),
        }


def _intervals(problem: Problem, truth: Truth, budget: int, seed: int) -> Iterator[Interval]:
    """Yield the intervals of one seed that exist, both with and without stand-ins."""
    stream = Stream(seed, "coverage")
    thresholds = tuple(Threshold(f"{value:.6g}", float(value)) for value in truth.thresholds)
    quantity = QuantityOfInterest(Output("y", "1"), "1", thresholds, quantiles=QUANTILES)
    design = Multifidelity(budget, min(PILOT, budget // 2))
    runs = _runs(problem, design, stream.child("multifidelity"))
    alone = next(MonteCarlo(budget).rounds(problem.inputs, stream.child("plain")))
    own = next(iter(problem.models))
    plain = _statistics(_made(problem, own, points_in_memory(alone)), quantity)
    found = _statistics(runs[own], quantity)
    found |= control_variate_statistics(runs, quantity, found)
    for statistic, (lower, upper) in _bounds(found).items():
        before = np.subtract(*_bounds(plain)[statistic][::-1])
        width = upper - lower
        if np.isfinite(width):
            is_inside = lower <= truth.values[statistic] <= upper
            # Widths are compared where both intervals exist.
            widths = (width, float(before)) if np.isfinite(before) else (0.0, 0.0)
            yield Interval(statistic, bool(is_inside), *widths)


def _runs(problem: Problem, design: Multifidelity, stream: Stream) -> dict[str, xr.Dataset]:
    """Return the runs of a design by model."""

    def make(drawn: Points | Round, number: int) -> dict[str, xr.Dataset]:
        names = drawn.models if isinstance(drawn, Round) else problem.models
        points = points_in_memory(points_of(drawn))
        return {name: _made(problem, name, points) for name in names}

    costs = dict(zip(problem.models, problem.costs, strict=True))
    rounds = run_rounds(design, problem.inputs, stream, make, costs=costs)
    joined = {}
    for name in problem.models:
        own = {number: runs[name] for number, runs in enumerate(rounds) if name in runs}
        joined[name] = join_rounds([*own.values()], [*own])
    return joined


def _made(problem: Problem, name: str, points: xr.Dataset) -> xr.Dataset:
    made = with_output(points, problem.models[name](_columns(points)))
    return made.assign_attrs({SAMPLING: str(Sampling.INDEPENDENT)})


def _columns(points: xr.Dataset) -> Columns:
    runs = points.sizes[RUN]
    return {str(n): np.broadcast_to(points[n].values, runs).copy() for n in points.data_vars}


def _statistics(runs: xr.Dataset, quantity: QuantityOfInterest) -> dict[str, xr.DataArray]:
    return analyze(runs, [quantity], only=("moments", "quantiles", "exceedance"))["y"]


def _bounds(found: Mapping[str, xr.DataArray]) -> dict[str, tuple[float, float]]:
    """Return the bounds of each statistic that was estimated."""
    arrays = [found["mean"], found["std"], *found["quantile"], *found["exceedance"]]
    bounds = [(float(each[1]), float(each[2])) for each in arrays]
    return dict(zip(STATISTICS, bounds, strict=True))


def _cells(rows: Sequence[Row]) -> dict[tuple[str, int, str], SimpleNamespace]:
    return totals(rows, "problem", "budget", "statistic")


def _page(rows: Sequence[Row]) -> Iterator[str]:
    cells = _cells(rows).values()
    names = {"std": "standard deviation"}
    yield from cross_table(
        cells,
        "budget",
        lambda cell: f"{PROBLEMS[cell.problem].title}: {cell.budget}",
        lambda cell: names.get(cell.statistic, cell.statistic),
        _text,
    )
    yield f"\nSeeds: {max(cell.count for cell in cells)}."


def _text(cells: Sequence[SimpleNamespace]) -> str:
    """Coverage and ratio of widths; the share of seeds with an interval if not all have one."""
    (cell,) = cells
    if cell.intervals < FEWEST:
        return "none"
    ratio = f"{cell.width / cell.plain_width:.2f}" if cell.plain_width else "–"
    few = f" ({100 * cell.intervals / cell.count:.0f} %)" if cell.intervals < cell.count else ""
    return f"{per_cent(cell.covers, cell.intervals)} / {ratio}{few}"


def _cases() -> Iterator[tuple[str, int]]:
    for name, problem in PROBLEMS.items():
        yield from ((name, budget) for budget in problem.budgets)


TABLE = SeedTable(
    ("problem", "budget"),
    _rows,
    {"stand-ins": _page},
    lambda rows: too_seldom(_cells(rows)),
    at_once=25,
    cases=_cases,
)

if __name__ == "__main__":
    TABLE.main(__doc__)
