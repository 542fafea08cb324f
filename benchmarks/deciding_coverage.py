"""How often intervals cover and answers are right where a design ends by itself, in whole studies.

Run it as ``python benchmarks/deciding_coverage.py --markdown docs/coverage/stopping.md``, with
uqpen installed. The runs of a seed are drawn from a pool of exact runs of a model, whose statistics
are the true values. The looks, the estimates, the intervals and the test are those of the package.
"""

from __future__ import annotations

import argparse
import multiprocessing
from collections.abc import Callable, Iterator
from functools import cache
from itertools import chain
from multiprocessing.pool import Pool
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from gaussian_process import ishigami
from interval_coverage import STUDIES
from seed_table import fill, lines

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import REPLICATE, SAMPLING, STATUS
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence, sobol_points
from uqpen.designs.replicated import ReplicatedDesign
from uqpen.designs.stopping.acceptance_claim import decide
from uqpen.designs.stopping.stopping_rule import doubling_looks
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


class Problem(NamedTuple):
    """A pool of outputs, what is asked of them, and the true values in the order of `KINDS`."""

    values: FloatArray
    quantity: QuantityOfInterest
    truth: FloatArray


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", choices=TABLES, help="one of the tables")
    parser.add_argument("--markdown", type=Path, metavar="FILE.md")
    options = parser.parse_args()
    for name in [options.only] if options.only else TABLES:
        with multiprocessing.get_context("fork").Pool(options.workers) as pool:
            text = "\n".join(TABLES[name](options.seeds, pool))
        print(text, flush=True)
        if options.markdown:
            fill(options.markdown, name, text)


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
    from uqpen.core.streams import Stream
    from uqpen.designs.monte_carlo import MonteCarlo
    from uqpen.execution import Progress

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


def estimates(case: tuple[str, int]) -> FloatArray:
    """Return the bounds of all statistics at all looks of a seed, shape (look, kind, 3)."""
    name, seed = case
    values, quantity, _ = problem(name)
    drawn = np.random.default_rng([2_062, seed]).choice(values, MOST)
    return np.array([bounds_of(_runs(drawn[:look]), quantity) for look in LOOKS])


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


def estimates_of_replicates(case: tuple[str, int]) -> FloatArray:
    """Return the bounds of all statistics of a seed, shape (function, look, kind, 3)."""
    name, seed = case
    looks = list(DESIGNS[name].draw(seed))
    return np.array(
        [
            [bounds_of(_runs(function(look.T).T), exact_problem(each).quantity) for look in looks]
            for each, function in FUNCTIONS.items()
        ]
    )


def _replicates_table(seeds: int, pool: Pool) -> Iterator[str]:
    head = ["design", "output", "target", "at the first look", "worst target"]
    yield from lines([*head, "of other seeds", "middle target"], ())
    truths = {name: exact_problem(name).truth for name in FUNCTIONS}
    for design in DESIGNS:
        cases = [(design, seed) for seed in range(seeds)]
        bounds = np.array(pool.map(estimates_of_replicates, cases, chunksize=5))
        for number, (name, truth) in enumerate(truths.items()):
            for kind, key in enumerate(KINDS):
                case = key, kind, bounds[:, number], truth[kind]
                cells = precision_cells(*case)
                cells.insert(2, f"{worst_of_other_seeds(*case):.1f}")
                yield f"| {design} | {name} | `{key}` | {' | '.join(cells)} |"


def _precision_table(seeds: int, pool: Pool) -> Iterator[str]:
    yield from lines(["output", "target", "fixed at 512", "worst target", "middle target"], ())
    for name in POOLS:
        truth = problem(name).truth
        cases = [(name, seed) for seed in range(seeds)]
        bounds = np.array(pool.map(estimates, cases, chunksize=10))
        for kind, key in enumerate(KINDS):
            cells = precision_cells(key, kind, bounds, truth[kind])
            yield f"| {name} | `{key}` | {' | '.join(cells)} |"


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


def _decision_table(seeds: int) -> Iterator[str]:
    yield (
        "| output | P | claim | right | wrong | undecided at 16 384 | runs, mean | 90 % by | "
        "interval covers | by intervals: wrong |"
    )
    yield "|---|---|---|---|---|---|---|---|---|---|"
    for name in POOLS:
        values, quantity, truth = problem(name)
        events_of_pool = values > quantity.thresholds[0].value
        p = float(truth[3])
        for limit in (0.2, 0.15, p):
            rows = []
            for seed in range(seeds):
                rng = np.random.default_rng([2_063, seed])
                rows.append(_decided(rng.choice(events_of_pool, MOST), limit, p))
            right, wrong, undecided, runs, covers, naive = np.array(rows).T
            claim = f"P < {limit:g}" if limit != p else "P < its true value"
            cells = [100 * each.mean() for each in (right, wrong, undecided)]
            counts = [f"{runs.mean():.0f}", f"{np.quantile(runs, 0.9):.0f}"]
            ends = [f"{100 * each.mean():.1f}" for each in (covers, naive)]
            shown = [*(f"{each:.1f}" for each in cells), *counts, *ends]
            yield f"| {name} | {p:.4f} | {claim} | {' | '.join(shown)} |"


def _decided(events: BoolArray, limit: float, p: float) -> tuple[float, ...]:
    """Return of one seed: right, wrong, undecided, runs, interval covers, wrong by intervals.

    At the limit itself "held" is wrong, and "not held" is right.
    """
    verdict, runs = decide(events, np.zeros(len(events), bool), limit, is_below=True)
    is_right = verdict == ("held" if p < limit else "not held")
    is_open = verdict == "undecided"
    lower, upper = anytime_interval(int(events[:runs].sum()), 0, runs)
    return (
        is_right,
        not is_open and not is_right,
        is_open,
        runs,
        lower <= p <= upper,
        _is_wrong_by_intervals(events, limit, p),
    )


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
    from scipy import stats

    runs = np.arange(MOST + 1)
    # The two-sided interval excludes the limit where a one-sided tail is at most 2.5 %.
    least = stats.binom.ppf(0.025, runs, limit) - 1
    least += stats.binom.cdf(least + 1, runs, limit) <= 0.025
    most = stats.binom.isf(0.025, runs, limit) + 1
    lower, _ = clopper_pearson(int(most[100]), 100, 0.95)
    assert lower > limit, "the counts are those of the interval"
    return least, most


TABLES = {
    "designs that end by themselves": lambda seeds, pool: chain(
        _precision_table(seeds, pool), [""], _decision_table(seeds)
    ),
    "replicates that end by themselves": _replicates_table,
}

if __name__ == "__main__":
    main()
