"""How often intervals cover and answers are right where a design ends by itself, in whole studies.

Tables of docs/coverage/stopping.md as `seed_table.py` makes them: `precision`, `decisions` and
`replicates`. The runs of a seed are drawn from a pool of exact runs of a model, whose statistics
are the true values. The looks, the estimates, the intervals and the test are those of the package.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from gaussian_process import ishigami
from scipy import stats
from seed_table import STUDIES, Row, SeedTable, grouped, lines, main, table

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import REPLICATE, SAMPLING, STATUS
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence, sobol_points
from uqpen.designs.replicated import ReplicatedDesign
from uqpen.designs.stopping.acceptance_claim import decide
from uqpen.designs.stopping.stopping_rule import doubling_looks
from uqpen.execution import Progress
from uqpen.statistics.analyze import analyze
from uqpen.statistics.intervals import clopper_pearson
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.statistics.stopped_runs import anytime_interval
from uqpen.study.load import load_study
from uqpen.workflow import run_design

POOL = 1 << 20
DOUBLINGS = 5
REFERENCE_EXPONENT = 22
LOOKS = tuple(doubling_looks(16_384))
MOST = 16_384
# Of the usual half-width at a look.
TARGETS = (0.95, 1.0, 1.05)
# Two probabilities: of exceeding a value, and of lying below another.
LIMITS = (0.8628, 0.05)
KINDS = ("mean", "standard_deviation", "quantile_95", "exceeds", "below")
STATISTICS = ("mean", "std", "quantile", "exceedance", "below")
ENDS = ("estimate", "lower", "upper")


class Problem(NamedTuple):
    """A pool of outputs, what is asked of them, and the true values in the order of `KINDS`."""

    values: FloatArray
    quantity: QuantityOfInterest
    truth: FloatArray


POOLS = ("concrete", "Ishigami", "step")


@cache
def problem(name: str) -> Problem:
    """A problem by its name."""
    return problem_of(_pool(name))


def problem_of(values: FloatArray) -> Problem:
    """The problem of outputs that stand for all there are."""
    upper, lower = np.quantile(values, LIMITS)
    quantity = QuantityOfInterest(
        Output("y", "1"),
        "1",
        thresholds=(Threshold("upper", float(upper)),),
        lower_thresholds=(Threshold("lower", float(lower)),),
    )
    truth = [values.mean(), values.std(), np.quantile(values, 0.95)]
    truth += [(values > upper).mean(), (values < lower).mean()]
    return Problem(values, quantity, np.array(truth))


def _concrete() -> FloatArray:
    """The penetration depth of as many independent runs of the concrete study's own model."""
    study = load_study(STUDIES / "concrete.toml")
    study.model.prepare()
    stream = Stream(2_061, "designs", "pool")
    made = run_design(study, MonteCarlo(POOL), stream, map=map, progress=Progress())[""]
    depth: FloatArray = made["penetration_depth"].values
    return depth[np.isfinite(depth)]


def _step(unit: FloatArray) -> FloatArray:
    x1, x2, x3 = unit
    y: FloatArray = 3.0 * (x1 + x2 > 1.4) + np.square(x3)
    return y


# Of three inputs between 0 and 1, in the rows of an array.
FUNCTIONS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "Ishigami": lambda unit: ishigami(np.pi * (2 * unit.T - 1)).T,
    "step": _step,
}


def _pool(name: str) -> FloatArray:
    rng = np.random.default_rng(2_061)
    return FUNCTIONS[name](rng.random((3, POOL))) if name in FUNCTIONS else _concrete()


def _precision_rows(output: str, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the bounds of each statistic at all looks."""
    values, quantity, _ = problem(output)
    for seed in seeds:
        drawn = np.random.default_rng([2_062, seed]).choice(values, MOST)
        yield from rows_of([bounds_of(_runs(drawn[:look]), quantity) for look in LOOKS])


def rows_of(bounds: Sequence[FloatArray]) -> Iterator[dict[str, Any]]:
    """Yield a row for each statistic from the bounds at each look."""
    for kind, key in enumerate(KINDS):
        ends = np.array(bounds)[:, kind].tolist()
        numbers = {
            f"{end}_{look}": value
            for look, of in enumerate(ends)
            for end, value in zip(ENDS, of, strict=True)
        }
        yield {"statistic": key, **numbers}


def bounds_in(rows: Sequence[Row]) -> FloatArray:
    """Return the bounds that rows have, shape (seed, look, kind, 3)."""
    by_kind = grouped(rows, "statistic")
    looks = range(DOUBLINGS + 1)
    found = [
        [[[row[f"{end}_{look}"] for end in ENDS] for look in looks] for row in by_kind[key,]]
        for key in KINDS
    ]
    return np.moveaxis(np.array(found), 0, 2)


def bounds_of(runs: xr.Dataset, quantity: QuantityOfInterest) -> FloatArray:
    """Return the bounds of all statistics, shape (kind, 3)."""
    made = analyze(runs, [quantity], only=("moments", "quantiles", "exceedance"))["y"]
    return np.array([made[each].values.reshape(-1, 3)[-1] for each in STATISTICS])


def _runs(values: FloatArray) -> xr.Dataset:
    """Return runs of independent outputs, or of shape (replicate, point)."""
    runs = xr.Dataset(
        {
            "y": ("run", values.ravel(), {"units": "1", "role": "output"}),
            STATUS: ("run", np.zeros(values.size, np.int8)),
        },
        attrs={SAMPLING: str(Sampling.INDEPENDENT)},
    )
    if values.ndim == 1:
        return runs
    replicates = np.repeat(np.arange(len(values)), values.shape[1])
    runs = runs.assign_coords({REPLICATE: ("run", replicates)})
    return runs.assign_attrs({SAMPLING: str(Sampling.STRATIFIED)})


class Replicates(NamedTuple):
    """Replicates at the first look, and the points of each."""

    design: ReplicatedDesign
    replicates: int
    points: int

    def draw(self, seed: int) -> Iterator[FloatArray]:
        """Yield the points of each look, shape (replicate, point, input)."""
        factor = 1 << DOUBLINGS
        grows = self.design.is_sequence
        numbers = range(self.replicates * (1 if grows else factor))
        points = self.points * (factor if grows else 1)
        rngs = (np.random.default_rng([2_066, seed, number]) for number in numbers)
        sets = np.stack([self.design.draw(rng, points, 3) for rng in rngs])
        for doublings in range(DOUBLINGS + 1):
            part = 1 << doublings
            yield sets[:, : self.points * part] if grows else sets[: self.replicates * part]


DESIGNS = {
    "Sobol' sets": Replicates(SobolSequence(64), 32, 16),
    "Halton sets": Replicates(Halton(64), 32, 16),
    "hypercubes": Replicates(LatinHypercube(20), 20, 26),
}


@cache
def exact_problem(name: str) -> Problem:
    """A problem whose truth is from one Sobol' set, far below the widths of intervals."""
    unit = sobol_points(np.random.default_rng(2_065), 1 << REFERENCE_EXPONENT, 3)
    return problem_of(FUNCTIONS[name](unit.T))


def _replicates_rows(design: str, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the bounds of each statistic of each function at all looks."""
    for seed in seeds:
        looks = list(DESIGNS[design].draw(seed))
        for output, function in FUNCTIONS.items():
            quantity = exact_problem(output).quantity
            bounds = [bounds_of(_runs(function(look.T).T), quantity) for look in looks]
            yield from ({"output": output, **row} for row in rows_of(bounds))


def _replicates_page(rows: Sequence[Row]) -> Iterator[str]:
    head = ["design", "output", "target", "at the first look", "worst target"]
    found = []
    for (design, output), group in grouped(rows, "design", "output").items():
        bounds, truth = bounds_in(group), exact_problem(output).truth
        for kind, key in enumerate(KINDS):
            case = key, kind, bounds, truth[kind]
            fixed, worst, middle = precision_cells(*case)
            other = f"{worst_of_other_seeds(*case):.1f}"
            found.append([design, output, f"`{key}`", fixed, worst, other, middle])
    yield from lines([*head, "of other seeds", "middle target"], found)


def _precision_page(rows: Sequence[Row]) -> Iterator[str]:
    found = []
    for (output,), group in grouped(rows, "output").items():
        bounds, truth = bounds_in(group), problem(output).truth
        for kind, key in enumerate(KINDS):
            found.append([output, f"`{key}`", *precision_cells(key, kind, bounds, truth[kind])])
    yield from lines(["output", "target", "fixed at 512", "worst target", "middle target"], found)


def precision_cells(key: str, kind: int, bounds: FloatArray, truth: float) -> list[str]:
    """Return the coverage in per cent after the first look, at the worst and the middle target.

    The estimates and the ends of their intervals have the shape (seed, look, kind, 3).
    """
    covers, known = _covering(kind, bounds, truth)
    fixed = covers[:, 0][known[:, 0]]
    if len(fixed) <= len(bounds) / 2:
        return ["none"] * 3
    reached = sorted(_coverages(key, kind, bounds, covers))
    return [f"{each:.1f}" for each in (100 * fixed.mean(), reached[0], np.median(reached))]


def worst_of_other_seeds(key: str, kind: int, bounds: FloatArray, truth: float) -> float:
    """Return the coverage in per cent at the worst target of one half of the seeds, in the other.

    This does not count the chance by which a target is the worst of many. It is the mean over many
    divisions of the seeds.
    """
    rng, found = np.random.default_rng(2_067), []
    for _ in range(100):
        halves = np.array_split(rng.permutation(len(bounds)), 2)
        one, other = (
            list(_coverages(key, kind, half, _covering(kind, half, truth)[0]))
            for half in (bounds[half] for half in halves)
        )
        found.append(other[int(np.argmin(one))])
    return float(np.mean(found))


def _covering(kind: int, bounds: FloatArray, truth: float) -> tuple[BoolArray, BoolArray]:
    """Return which intervals cover, and which there are, shape (seed, look)."""
    _, lower, upper = np.moveaxis(bounds[:, :, kind], -1, 0)
    return (lower <= truth) & (truth <= upper), np.isfinite(lower) & np.isfinite(upper)


def _coverages(key: str, kind: int, bounds: FloatArray, covers: BoolArray) -> Iterator[float]:
    """Yield the coverage in per cent where seeds end at a target, for many targets."""
    estimate, lower, upper = np.moveaxis(bounds[:, :, kind], -1, 0)
    half, std = (upper - lower) / 2, bounds[:, :, 1, 0]
    is_usual = np.isfinite(half[:, :-1]).mean(axis=0) > 0.5
    usual = np.nanmedian(half[:, :-1][:, is_usual], axis=0)
    last = bounds.shape[1] - 1
    # A quantity, a share of the estimate, and one of the standard deviation.
    scales = [np.ones_like(half), np.abs(estimate) / np.abs(np.median(estimate[:, -1]))]
    scales.append(std / np.median(std[:, -1]))
    for wanted in np.outer(TARGETS, usual).ravel().tolist():
        for scale in scales[:1] if key in ("exceeds", "below") else scales:
            is_precise = half <= wanted * scale
            ends = np.where(is_precise.any(axis=1), is_precise.argmax(axis=1), last)
            ended = np.arange(len(ends)), ends
            has_interval = np.isfinite(half[ended])
            yield float(100 * covers[ended][has_interval].mean())


CLAIMS = {"P < 0.2": 0.2, "P < 0.15": 0.15, "P < its true value": None}


def _decision_rows(output: str, claim: str, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield how a claim is decided; at the limit itself "held" is wrong, and "not held" right."""
    values, quantity, truth = problem(output)
    events_of_pool = values > quantity.thresholds[0].value
    p = float(truth[3])
    limit = CLAIMS[claim] or p
    for seed in seeds:
        events = np.random.default_rng([2_063, seed]).choice(events_of_pool, MOST)
        verdict, runs = decide(events, np.zeros(len(events), bool), limit, is_below=True)
        is_right = verdict == ("held" if p < limit else "not held")
        is_open = verdict == "undecided"
        lower, upper = anytime_interval(int(events[:runs].sum()), 0, runs)
        yield {
            "p": p,
            "right": int(is_right),
            "wrong": int(not is_open and not is_right),
            "undecided": int(is_open),
            "runs": runs,
            "covers": int(lower <= p <= upper),
            "wrong_by_intervals": int(_is_wrong_by_intervals(events, limit, p)),
        }


def _mean(name: str, form: str = ".1f") -> Callable[[Sequence[Row]], str]:
    scale = 1 if name == "runs" else 100
    return lambda rows: format(scale * np.mean([row[name] for row in rows]), form)


DECISIONS = {
    "output": lambda rows: rows[0]["output"],
    "P": lambda rows: f"{rows[0]['p']:.4f}",
    "claim": lambda rows: rows[0]["claim"],
    "right": _mean("right"),
    "wrong": _mean("wrong"),
    "undecided at 16 384": _mean("undecided"),
    "runs, mean": _mean("runs", ".0f"),
    "90 % by": lambda rows: f"{np.quantile([row['runs'] for row in rows], 0.9):.0f}",
    "interval covers": _mean("covers"),
    "by intervals: wrong": _mean("wrong_by_intervals"),
}


def _is_wrong_by_intervals(events: BoolArray, limit: float, p: float) -> bool:
    """Return whether a Clopper-Pearson interval, looked at after every run, errs first."""
    least, most = _decisive_counts(limit)
    counts, runs = events.cumsum(), np.arange(1, len(events) + 1)
    below, above = counts <= least[runs], counts >= most[runs]
    ended = below | above
    if not ended.any():
        return False
    return bool(below[ended.argmax()]) != (p < limit)


@cache
def _decisive_counts(limit: float) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return by runs the largest count whose interval is below a limit, the least above it."""
    runs = np.arange(MOST + 1)
    # The two-sided interval excludes the limit where a one-sided tail is at most 2.5 %.
    least = stats.binom.ppf(0.025, runs, limit) - 1
    least += stats.binom.cdf(least + 1, runs, limit) <= 0.025
    most = stats.binom.isf(0.025, runs, limit) + 1
    lower, _ = clopper_pearson(int(most[100]), 100, 0.95)
    assert lower > limit, "the counts are those of the interval"
    return least, most


TABLES = {
    "precision": SeedTable(
        {"output": POOLS},
        _precision_rows,
        {"designs that end at a precision": _precision_page},
        at_once=10,
    ),
    "decisions": SeedTable(
        {"output": POOLS, "claim": CLAIMS},
        _decision_rows,
        {
            "designs that end at a decision": lambda rows: table(
                grouped(rows, "output", "claim").values(), DECISIONS
            )
        },
        at_once=10,
    ),
    "replicates": SeedTable(
        {"design": DESIGNS},
        _replicates_rows,
        {"replicates that end by themselves": _replicates_page},
        at_once=5,
    ),
}

if __name__ == "__main__":
    main(TABLES, __doc__)
