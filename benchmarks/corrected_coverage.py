"""How often the corrected estimates of surrogates cover, and how wide they are.

A table of docs/coverage/surrogates.md as `seed_table.py` makes it. A width is over that of the
plain interval of the same runs: of the mean, the standard deviation, half the 16 % to 84 % range,
quantiles, probabilities and first-order indices. An interval is that of the runs alone where the
program takes it; how many are wider than these stands below the tables.

A surrogate is a sparse polynomial chaos of an order fixed beforehand, in five folds. All statistics
of a seed share the fits. True values are from a million points of a Sobol' sequence. A cell fails
if its intervals cover in less than 92 %.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, cached_property
from itertools import islice, product
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from gaussian_process import CASES, ishigami
from scipy import special
from scipy.stats import qmc
from seed_table import (
    FEWEST,
    STUDIES,
    Case,
    Row,
    SeedTable,
    lines,
    per_cent,
    too_seldom,
    totals,
)
from skewed_coverage import Design

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.model import Output
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.distributions.univariate import Normal, Uniform
from uqpen.execution import Evaluator
from uqpen.statistics.distribution_function.probabilities import event_probability
from uqpen.statistics.distribution_function.quantiles import quantile_estimates
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.moments.sample_moments import sample_moments
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample
from uqpen.statistics.sensitivity.given_data import first_order
from uqpen.statistics.surrogate.corrected_cdf import CorrectedCdf
from uqpen.statistics.surrogate.corrected_indices import InputParts, corrected_indices
from uqpen.statistics.surrogate.corrected_moments import CorrectedMoments
from uqpen.statistics.surrogate.corrected_statistics import narrower
from uqpen.statistics.surrogate.correction_runs import CorrectionRuns
from uqpen.study.load import load_study
from uqpen.surrogates.chaos.basis import ProductBasis, univariate_basis
from uqpen.surrogates.chaos.coefficients import sparse_regression

FOLDS = 5
QUANTITY = QuantityOfInterest(Output("y", "1"), "1")
QUANTILES = np.array(QUANTITY.quantiles)
EXCEEDED = (0.14, 0.05, 0.01)
SIZES = (100, 200, 500)
# Sets of quasi-random draws at which the fits are evaluated, and points of each.
SETS, POINTS = 16, 256
_TRUTH_POINTS = 20
SUMS = ("covers", "intervals", "width", "plain_covers", "plain_intervals", "plain_width")
SUMS += ("alone", "wider")

CONCRETE = load_study(STUDIES / "concrete.toml")


class Function(NamedTuple):
    """A function of points of the unit cube; NaN where they are inadmissible.

    Its polynomials are of uniform inputs, or of normal scores. Runs at some points may fail.
    """

    inputs: int
    values: Callable[[FloatArray], FloatArray]
    order: dict[int, int]
    title: str
    is_normal: bool = False
    is_logarithm: bool = False
    has_indices: bool = False
    correlation: float = 0.0
    fails_at: Callable[[FloatArray], BoolArray] | None = None

    def points(self, cube: FloatArray) -> FloatArray:
        """Return dependent points, if the inputs depend on each other."""
        if not self.correlation:
            return cube
        scores = special.ndtri(cube)
        shared = math.sqrt(self.correlation) * scores[:, :1]
        return np.asarray(special.ndtr(math.sqrt(1 - self.correlation) * scores + shared))


def _ishigami(u: FloatArray) -> FloatArray:
    return ishigami(math.pi * (2 * u[:, :3] - 1))


def _borehole(u: FloatArray) -> FloatArray:
    function, lower, upper, _ = CASES["borehole"]
    return function(np.array(lower) + u * np.subtract(upper, lower))


def _additive(u: FloatArray) -> FloatArray:
    return np.asarray(
        4 * u[:, 0] + (3 * u[:, 1] - 1) ** 2 + np.exp(u[:, 2]) + np.sin(3 * u[:, 3]) + u[:, 4] ** 3
    )


def _step(u: FloatArray) -> FloatArray:
    return np.asarray(2.0 * (u[:, 0] + 0.6 * u[:, 1] > 0.9) + u[:, 2])


def _rough(u: FloatArray) -> FloatArray:
    return np.asarray(np.sin(41 * u[:, 0]) * np.cos(37 * u[:, 1]) + 0.5 * np.sin(53 * u[:, 2]))


def _concrete(u: FloatArray) -> FloatArray:
    return _rods(u, "penetration_depth")


def _residue(u: FloatArray) -> FloatArray:
    return _rods(u, "projectile_residue")


def _rods(u: FloatArray, output: str) -> FloatArray:
    joint, (variant,) = CONCRETE.joint, CONCRETE.models.values()
    fixed = {each.variable.name: np.full(len(u), each.value) for each in joint.fixed}
    results = Evaluator(variant.model, CONCRETE.constraints)({**fixed, **joint.ppf(u)})
    return np.where(results.status == Status.OK, results.outputs[output], np.nan)


def _scores(u: FloatArray) -> FloatArray:
    return np.asarray(special.ndtri(u))


def _orders(few: int, more: int, most: int) -> dict[int, int]:
    return dict(zip(SIZES, (few, more, most), strict=True))


FUNCTIONS = {
    "concrete": Function(
        4, _concrete, _orders(3, 4, 5), "concrete depth", is_normal=True, is_logarithm=True
    ),
    "residue": Function(4, _residue, _orders(3, 4, 5), "concrete residue", is_normal=True),
    "ishigami": Function(3, _ishigami, _orders(7, 9, 10), "Ishigami", has_indices=True),
    "borehole": Function(8, _borehole, _orders(2, 3, 3), "borehole", has_indices=True),
    "additive": Function(5, _additive, _orders(3, 4, 5), "additive", has_indices=True),
    "step": Function(3, _step, _orders(4, 5, 7), "step", has_indices=True),
    "rough": Function(3, _rough, _orders(3, 4, 5), "rough (useless surrogate)", has_indices=True),
    "lognormal": Function(
        2, lambda u: np.exp(_scores(u[:, 0])), _orders(4, 5, 6), "exp z", is_normal=True
    ),
    "pareto": Function(1, lambda u: (1 - u[:, 0]) ** (-1 / 3.3), _orders(8, 10, 12), "Pareto 3.3"),
    "modulus": Function(
        2,
        lambda u: np.exp(np.abs(_scores(u[:, 0]))),
        _orders(6, 8, 10),
        "exp abs z",
        is_normal=True,
    ),
    "reciprocal": Function(2, lambda u: 1 / (0.02 + u[:, 0]), _orders(8, 10, 12), "1/(0.02 + u)"),
    "dependent": Function(
        3, _ishigami, _orders(7, 9, 10), "Ishigami, inputs correlated by 0.6", correlation=0.6
    ),
    "failures": Function(
        3,
        _ishigami,
        _orders(7, 9, 10),
        "Ishigami, failures in a corner",
        fails_at=lambda u: (u[:, 0] > 0.7) & (u[:, 1] > 0.5),
    ),
}
_HYPERCUBE = LatinHypercube(runs=20, replicates=10)


def _designs(runs: int) -> dict[str, Design]:
    return {
        "monte-carlo": Design(lambda rng, n, d: rng.random((n, d)), 0, runs),
        "latin-hypercube × 10": Design(_HYPERCUBE.draw, 10, runs // 10),
    }


class Truth(NamedTuple):
    """True values by statistic, and the thresholds of the probabilities."""

    values: dict[str, float]
    thresholds: FloatArray


class Problem:
    """A function with its true statistics, its polynomials, and draws for its surrogates."""

    def __init__(self, function: Function) -> None:
        self.function = function

    @cached_property
    def truth(self) -> Truth:
        """The true statistics."""
        function = self.function
        drawn = qmc.Sobol(function.inputs, seed=1).random_base2(_TRUTH_POINTS)
        values = function.values(function.points(drawn))
        values = values[~np.isnan(values)]
        thresholds = np.quantile(values, [1 - p for p in EXCEEDED])
        found = {"mean": float(values.mean()), "std": float(values.std())}
        for p, threshold in zip(EXCEEDED, thresholds, strict=True):
            found[f"P {p:g}"] = float((values > threshold).mean())
        for p, value in zip(QUANTILES, np.quantile(values, QUANTILES), strict=True):
            found[f"quantile {p:g}"] = float(value)
        low, high = np.quantile(values, (0.16, 0.84))
        found["half_spread"] = float(high - low) / 2
        if function.has_indices:
            found |= dict(self._indices())
        return Truth(found, thresholds)

    def _indices(self) -> Iterator[tuple[str, float]]:
        inputs = self.function.inputs
        both = qmc.Sobol(2 * inputs, seed=2).random_base2(_TRUTH_POINTS)
        one, other = both[:, :inputs], both[:, inputs:]
        values, others = self.function.values(one), self.function.values(other)
        variance = values.var()
        for name in range(inputs):
            mixed = one.copy()
            mixed[:, name] = other[:, name]
            changed = self.function.values(mixed)
            first = float((others * (changed - values)).mean() / variance)
            yield f"first {name}", max(first, 0.0)
            yield f"total {name}", float(((values - changed) ** 2).mean() / (2 * variance))

    @cache  # noqa: B019 - problems last as long as the script
    def terms(self, runs: int) -> tuple[ProductBasis, IntArray]:
        """Return the polynomials of a fit to a number of runs, and their degrees."""
        order = self.function.order[runs]
        names = [f"x{number}" for number in range(self.function.inputs)]
        law = Normal(mean=0.0, std=1.0) if self.function.is_normal else Uniform(lower=0, upper=1)
        basis = ProductBasis(tuple(univariate_basis(name, law, order) for name in names))
        return basis, basis.indices(order, 1.0)

    def matrix(self, runs: int, points: FloatArray) -> FloatArray:
        """Return the values of the terms at points."""
        basis, indices = self.terms(runs)
        columns = _scores(points) if self.function.is_normal else points
        return basis.matrix(dict(zip(basis.names, columns.T, strict=True)), indices)

    def draws(self, runs: int, seed: int) -> tuple[FloatArray, IntArray]:
        """Return the terms at the draws of a seed, and the set of each draw."""
        function, inputs = self.function, self.function.inputs
        drawn = [
            qmc.Sobol(inputs, seed=1000 * seed + number).random_base2(POINTS.bit_length() - 1)
            for number in range(10, 10 + SETS)
        ]
        points = function.points(np.concatenate(drawn))
        is_admissible = ~np.isnan(function.values(points))
        return (
            self.matrix(runs, points[is_admissible]),
            np.repeat(np.arange(SETS), POINTS)[is_admissible],
        )


class Seed(NamedTuple):
    """The runs of one seed: a sample of them, and what corrects a surrogate."""

    sample: Sample
    runs: CorrectionRuns
    parts: tuple[InputParts, InputParts] | None


def _seed(problem: Problem, design: Design, runs: int, seed: int) -> Seed:
    """Fit a surrogate in folds to the runs of a seed."""
    function = problem.function
    rng = Stream(seed, "coverage").generator()
    cube, whole = design.sample(rng, function.inputs)
    points = function.points(cube)
    values = function.values(points)
    is_missing = (
        function.fails_at(points) if function.fails_at else np.zeros(len(points), dtype=np.bool_)
    )
    completed = ~np.isnan(values) & ~is_missing
    unit = whole.replicates if design.replicates else np.arange(len(points))
    fold = (rng.permutation(int(unit.max()) + 1) % FOLDS)[unit]
    matrix = problem.matrix(runs, points)
    at_draws, draw_set = problem.draws(runs, seed)
    fits = [
        _fit(matrix[completed & (fold != k)], values[completed & (fold != k)], function)
        for k in range(FOLDS)
    ]
    predictions = np.empty(len(points))
    draws = np.empty((FOLDS, len(at_draws)))
    for k, fit in enumerate(fits):
        predictions[fold == k] = _predicted(matrix[fold == k], fit, function)
        draws[k] = _predicted(at_draws, fit, function)
    sample = replace(
        whole,
        values=values[completed],
        used=np.flatnonzero(completed),
        missing=np.flatnonzero(is_missing),
        columns=InputColumns.from_matrix(
            tuple(f"x{number}" for number in range(function.inputs)), points
        ),
    )
    is_exact = (
        not function.is_logarithm and not function.correlation and len(draw_set) == SETS * POINTS
    )
    moments = [(fit[0], math.sqrt(fit[1:] @ fit[1:])) for fit in fits] if is_exact else None
    found = CorrectionRuns(
        values[completed],
        predictions[completed],
        fold[completed],
        draws,
        draw_set,
        predictions[is_missing],
        fold[is_missing],
        None if moments is None else np.array(moments),
    )
    parts = _parts(problem, runs, matrix, fits, fold) if function.has_indices else None
    return Seed(sample, found, parts)


def _fit(matrix: FloatArray, values: FloatArray, function: Function) -> FloatArray:
    """Return the coefficients of all terms."""
    fitted = np.log(values) if function.is_logarithm else values
    centre, spread = fitted.mean(), fitted.std()
    fit = sparse_regression(matrix, (fitted - centre) / spread)
    coefficients = np.zeros(matrix.shape[1])
    if fit is not None:
        coefficients[fit.terms] = fit.coefficients * spread
    coefficients[0] += centre
    return coefficients


def _predicted(matrix: FloatArray, coefficients: FloatArray, function: Function) -> FloatArray:
    used = np.flatnonzero(coefficients)
    found = matrix[:, used] @ coefficients[used]
    return np.exp(found) if function.is_logarithm else found


def _parts(
    problem: Problem, runs: int, matrix: FloatArray, fits: list[FloatArray], fold: IntArray
) -> tuple[InputParts, InputParts]:
    _, indices = problem.terms(runs)
    is_in = indices > 0
    is_alone = is_in & (is_in.sum(axis=1) == 1)[:, None]
    return tuple(
        InputParts(
            np.array([row * fits[k] @ terms for row, k in zip(matrix, fold, strict=True)]),
            np.array([fit**2 @ terms for fit in fits]),
        )
        for terms in (is_alone, is_in)
    )


def _corrected(
    runs: CorrectionRuns, truth: Truth, all_parts: tuple[InputParts, ...] | None = None
) -> Iterator[tuple[str, Estimate]]:
    """Yield the corrected estimates of a seed."""
    moments = CorrectedMoments(runs)
    yield "mean", moments.mean()
    yield "std", moments.std()
    cdf = CorrectedCdf(runs)
    above = cdf.above(truth.thresholds)
    of = zip(EXCEEDED, above.value, above.lower, above.upper, strict=True)
    for p, value, lower, upper in of:
        yield f"P {p:g}", Estimate(value, lower, upper, "", "discrete")
    ends = cdf.quantile(QUANTILES)
    for p, value, lower, upper in zip(QUANTILES, *ends, strict=True):
        yield f"quantile {p:g}", Estimate(value, lower, upper, "", "discrete")
    yield "half_spread", Estimate(*cdf.half_spread(), "", "conservative")
    if all_parts and not moments.heavy_tail:
        for order, parts in zip(("first", "total"), all_parts, strict=True):
            for name, estimate in enumerate(corrected_indices(runs, parts, moments.variance)):
                yield f"{order} {name}", estimate


def _plain(seed: Seed, truth: Truth) -> Iterator[tuple[str, FloatArray]]:
    """Yield value and bounds of the plain estimates of a seed."""
    for statistic, array in islice(sample_moments(seed.sample, QUANTITY), 3):
        yield statistic, array.values
    for p, limit in zip(EXCEEDED, truth.thresholds, strict=True):
        found = event_probability(seed.sample, seed.sample.values > limit)
        yield f"P {p:g}", np.array([found.value, found.lower, found.upper])
    ((_, quantiles),) = quantile_estimates(seed.sample, QUANTITY)
    for p, ends in zip(QUANTILES, quantiles.values, strict=True):
        yield f"quantile {p:g}", ends
    if seed.parts:
        indices = dict(first_order(seed.sample, QUANTITY))["first_order"]
        for name, ends in enumerate(indices.values):
            yield f"first {name}", ends


@cache
def _problem(name: str) -> Problem:
    return Problem(FUNCTIONS[name])


def _cases() -> Iterator[Case]:
    for runs, name in product(SIZES, FUNCTIONS):
        yield from ((name, design, runs) for design in _designs(runs))


def _rows(name: str, design: str, runs: int, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the counts of each statistic."""
    problem = _problem(name)
    counts: dict[str, dict[str, float]] = defaultdict(lambda: dict.fromkeys(SUMS, 0))
    for number in seeds:
        seed = _seed(problem, _designs(runs)[design], runs, number)
        plain = dict(_plain(seed, problem.truth))
        corrected = dict(_corrected(seed.runs, problem.truth, seed.parts))
        for statistic, true in problem.truth.values.items():
            count = counts[statistic]
            value, low, high = plain.get(statistic, (math.nan,) * 3)
            lower = upper = math.nan
            if statistic in corrected:
                alone = Estimate(value, low, high, "alone", "nominal")
                is_index = statistic.startswith(("first", "total"))
                found = narrower(corrected[statistic], alone, seed.runs, is_index=is_index)
                count["alone"] += found.method == "alone"
                _, lower, upper = found.bounds
            if math.isnan(upper - lower):
                continue
            count["intervals"] += 1
            count["covers"] += bool(lower <= true <= upper)
            if not math.isnan(high - low):
                count["plain_intervals"] += 1
                count["plain_covers"] += bool(low <= true <= high)
                count["wider"] += bool(upper - lower > high - low)
                count["width"] += float(upper - lower)
                count["plain_width"] += float(high - low)
    for statistic, count in counts.items():
        yield {"statistic": statistic, **count}


def _cells(rows: Sequence[Row]) -> dict[tuple[str, str, int, str], SimpleNamespace]:
    """Return the sums of each cell; the indices of all inputs are one."""
    merged = []
    for row in rows:
        kind, _, _ = row["statistic"].partition(" ")
        merged.append({**row, "statistic": kind} if kind in ("first", "total") else row)
    return totals(merged, "function", "design", "runs", "statistic")


def _page(rows: Sequence[Row]) -> Iterator[str]:
    cells = _cells(rows)
    statistics = list(dict.fromkeys(statistic for *_, statistic in cells))
    for design in dict.fromkeys(design for _, design, _, _ in cells):
        of = []
        for name, runs in product(FUNCTIONS, SIZES):
            row = [cells.get((name, design, runs, each)) for each in statistics]
            if any(row):
                of.append([FUNCTIONS[name].title, runs, *map(_text, row)])
        for runs in SIZES:
            texts = (_pooled(cells, design, runs, each) for each in statistics)
            of.append(["**all functions**", runs, *texts])
        yield from lines([design, "runs", *statistics], of)
        yield ""
    yield from _widths(cells)
    fewest = min(cell.count for key, cell in cells.items() if key[3] == "mean")
    error = 100 * math.sqrt(0.95 * 0.05 / fewest)
    yield f"Seeds of a cell: {fewest} or more. Its standard error is up to {error:.1f} points."


def _text(cell: SimpleNamespace | None) -> str:
    """Coverage in per cent, and the width over that of the plain interval."""
    if cell is None:
        return "–"
    if cell.intervals < FEWEST and cell.intervals < cell.count / 2:
        return "none"
    coverage = f"{100 * cell.covers / cell.intervals:.0f}"
    return f"{coverage} / {cell.width / cell.plain_width:.2f}" if cell.plain_width else coverage


def _widths(cells: dict[tuple[str, str, int, str], SimpleNamespace]) -> Iterator[str]:
    """Yield how many intervals are those of the runs alone, and how many are wider than these.

    Failed runs make the two estimates of different distributions; they are not counted.
    """
    of_same_runs = {key: cell for key, cell in cells.items() if not FUNCTIONS[key[0]].fails_at}
    for what, is_index in (("first-order indices", True), ("other statistics", False)):
        found = [cell for key, cell in of_same_runs.items() if (key[3] == "first") is is_index]
        if both := sum(cell.plain_intervals for cell in found):
            alone, wider = (per_cent(sum(getattr(c, n) for c in found), both) for n in SUMS[-2:])
            yield f"Of {both} intervals of {what} that both have, {alone} % are those of the runs"
            yield f"alone, and {wider} % are wider."
    yield ""


def _pooled(
    cells: dict[tuple[str, str, int, str], SimpleNamespace], design: str, runs: int, statistic: str
) -> str:
    """Coverage in per cent over all functions, with the number of intervals."""
    found = [cell for key, cell in cells.items() if key[1:] == (design, runs, statistic)]
    intervals, covers = (sum(getattr(c, n) for c in found) for n in ("intervals", "covers"))
    return f"{per_cent(covers, intervals)} of {intervals}" if intervals else "none"


TABLE = SeedTable(
    ("function", "design", "runs"),
    _rows,
    {"corrected estimates of surrogates": _page},
    lambda rows: too_seldom(_cells(rows)),
    at_once=5,
    cases=_cases,
)

if __name__ == "__main__":
    TABLE.main(__doc__)
