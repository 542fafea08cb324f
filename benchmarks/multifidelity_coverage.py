"""How often intervals of a multifidelity design cover, and how narrow they are at equal cost.

Run it as ``python benchmarks/multifidelity_coverage.py --output FILE.csv``, with uqpen installed,
and then with ``--from FILE.csv … --markdown docs/coverage.md``; files of other seeds (``--first``)
add up. Beside each interval stands that of plain Monte Carlo with as many runs of the model as the
budget pays. True values are exact, or those of a Sobol' sequence. A cell fails below 92 %.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from coverage_table import MULTIFIDELITY
from result_files import add_table_options, read_rows, result_file
from scipy.stats import qmc

import uqpen
from uqpen.core.labels import ROLE, RUN, SAMPLING, STATUS
from uqpen.core.model import Model, Output
from uqpen.core.processors import one_blas_thread
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import Points, Round, points_in_memory, points_of
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.multifidelity import Multifidelity
from uqpen.designs.rounds import run_rounds
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import join_rounds
from uqpen.models.rigid_penetration import RigidPenetration
from uqpen.models.walker_anderson import WalkerAnderson
from uqpen.statistics.analyze import analyze
from uqpen.statistics.control_variates import (
    control_variate_statistics,
)
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.study.load import load_study

FloatArray = npt.NDArray[np.float64]
Columns = Mapping[str, FloatArray]

LOWEST = 0.92
# A cell with fewer intervals has too large an error to be judged.
FEWEST = 50
QUANTILES = (0.05, 0.5, 0.95)
EXCEEDED = (0.14, 0.05, 0.01)
STATISTICS = (
    "mean",
    "std",
    *(f"quantile {p:g}" for p in QUANTILES),
    *(f"P {p:g}" for p in EXCEEDED),
)
PILOT = 50

ROD = load_study(Path(__file__).parents[1] / "studies" / "concrete.toml").joint


class Problem(NamedTuple):
    """A model and its stand-ins by name, the cost of a run of each, and the inputs."""

    title: str
    models: Mapping[str, Callable[[Columns], FloatArray]]
    costs: tuple[float, ...]
    inputs: JointDistribution
    budgets: tuple[int, ...]


def _uniform(lower: float, upper: float, *names: str) -> JointDistribution:
    law = uqpen.Uniform(lower, upper)
    designs = {"mc": uqpen.MonteCarlo(1)}
    study = uqpen.Study(
        lambda **x: {"y": 0.0}, dict.fromkeys(names, law), {"y": "1"}, designs, seed=0
    )
    return study.joint


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
        _uniform(0, 1, "x1"),
        (200,),
    ),
    "ishigami": Problem(
        "Ishigami by two of its kind (costs 0.05, 0.001)",
        {"f1": _ishigami(5, 0.1, 4), "f2": _ishigami(4.75, 0.1, 4), "f3": _ishigami(3, 0.9, 2)},
        (1, 0.05, 0.001),
        _uniform(-np.pi, np.pi, "x1", "x2", "x3"),
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


def main() -> int:
    options = _options()
    rows = read_rows(options.earlier) if options.earlier else list(_run(options))
    cells = _cells(rows)
    if options.markdown:
        MULTIFIDELITY.fill(options.markdown, "\n".join(_page(cells)))
    failing = [key for key, cell in cells.items() if cell.is_judged and cell.coverage < LOWEST]
    for key in failing:
        print("FAILS", *key, f"{cells[key].coverage:.3f}")
    return 1 if failing else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("--problem", default="", help="part of a problem's name")
    add_table_options(parser, "multifidelity_coverage.csv")
    return parser.parse_args()


_FIELDS = ("problem", "budget", "statistic", "seeds", "intervals", "covers", "width", "plain_width")
# After so many seeds the counts are written, so an interruption loses few.
_SEEDS = 25


def _run(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the counts of some seeds of each cell, and write them as they come."""
    with result_file(options.output, _FIELDS) as file:
        for name, problem in PROBLEMS.items():
            if options.problem not in name:
                continue
            truth = Truth.of(problem)
            for first in range(0, options.seeds, _SEEDS):
                seeds = range(first, min(first + _SEEDS, options.seeds))
                for budget in problem.budgets:
                    began = time.perf_counter()
                    counts = _counts(problem, truth, budget, [options.first + s for s in seeds])
                    rows = [{"problem": name, "budget": budget, **row} for row in counts]
                    file.add(rows)
                    yield from rows
                    print(f"{name}, {budget}: {time.perf_counter() - began:.0f} s", flush=True)


def _counts(
    problem: Problem, truth: Truth, budget: int, seeds: Sequence[int]
) -> Iterator[dict[str, Any]]:
    found: dict[str, list[Interval]] = defaultdict(list)
    for seed in seeds:
        for interval in _intervals(problem, truth, budget, seed):
            found[interval.statistic].append(interval)
    for statistic in STATISTICS:
        intervals = found[statistic]
        yield {
            "statistic": statistic,
            "seeds": len(seeds),
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
    with one_blas_thread():
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
    values = problem.models[name](_columns(points))
    status = np.where(np.isfinite(values), 0, 1).astype(np.int8)
    made = points.assign({"y": (RUN, values, {ROLE: "output"}), STATUS: (RUN, status)})
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


class Cell(NamedTuple):
    """Sums over the seeds of a cell."""

    seeds: int = 0
    intervals: int = 0
    covers: int = 0
    width: float = 0.0
    plain_width: float = 0.0

    def plus(self, row: Mapping[str, Any]) -> Cell:
        """Return the sums with those of another row."""
        return Cell(*(type(value)(row[key]) + value for key, value in self._asdict().items()))

    @property
    def is_judged(self) -> bool:
        """True if it has enough intervals."""
        return self.intervals >= FEWEST

    @property
    def coverage(self) -> float:
        """Share of the intervals that cover."""
        return self.covers / self.intervals

    @property
    def text(self) -> str:
        """Coverage and ratio of widths; the share of seeds with an interval if not all have one."""
        if not self.is_judged:
            return "none"
        ratio = f"{self.width / self.plain_width:.2f}" if self.plain_width else "–"
        few = f" ({100 * self.intervals / self.seeds:.0f} %)" if self.intervals < self.seeds else ""
        return f"{100 * self.coverage:.1f} / {ratio}{few}"


def _cells(rows: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str, str], Cell]:
    found: dict[tuple[str, str, str], Cell] = defaultdict(Cell)
    for row in rows:
        key = str(row["problem"]), str(row["budget"]), str(row["statistic"])
        found[key] = found[key].plus(row)
    return dict(found)


def _page(cells: Mapping[tuple[str, str, str], Cell]) -> Iterator[str]:
    names = {"std": "standard deviation"}
    yield f"| budget | {' | '.join(names.get(each, each) for each in STATISTICS)} |"
    yield "|---" * (len(STATISTICS) + 1) + "|"
    for name, problem in PROBLEMS.items():
        for budget in problem.budgets:
            found = [cells.get((name, str(budget), each), Cell()) for each in STATISTICS]
            texts = " | ".join(each.text for each in found)
            yield f"| {problem.title}: {budget} | {texts} |"
    yield f"\nSeeds: {max(cell.seeds for cell in cells.values())}."


if __name__ == "__main__":
    sys.exit(main())
