"""How often the corrected estimates of surrogates cover, and how wide they are.

Tables of docs/coverage/surrogates.md as `seed_table.py` makes them. A surrogate is a sparse
polynomial chaos of an order fixed beforehand, in five folds. All statistics of a seed share the
fits. True values are from a million points of a Sobol' sequence. A cell fails if its intervals
cover in less than 92 %.

`corrected`: a width is over that of the plain interval of the same runs: of the mean, the standard
deviation, half the 16 % to 84 % range, quantiles, probabilities and first-order indices. An
interval is that of the runs alone where the program takes it; how many are wider than these stands
below the tables.

`refined`: what refined designs bring. Each seed has 300 runs: of plain draws, or 100 of them and
200 that a surrogate places, for the means or for the probabilities. A width is over that of the
corrected interval of the 300 plain draws of the same seed.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, cached_property, partial
from itertools import islice, product
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from gaussian_process import CASES, ishigami
from scipy import special
from scipy.stats import qmc
from seed_table import FEWEST, STUDIES, Row, SeedTable, lines, main, per_cent, too_seldom, totals
from skewed_coverage import Design

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import RUN, STATUS, WEIGHT
from uqpen.core.model import Output, Results
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
from uqpen.surrogates.fitting import CrossFit
from uqpen.surrogates.refinement import RefinedOutput, place, predicted_errors

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


def _rods(output: str, u: FloatArray) -> FloatArray:
    joint, (variant,) = CONCRETE.joint, CONCRETE.models.values()
    fixed = {each.variable.name: np.full(len(u), each.value) for each in joint.fixed}
    results = Evaluator(variant.model, CONCRETE.constraints)({**fixed, **joint.ppf(u)})
    return np.where(results.status == Status.OK, results.outputs[output], np.nan)


def _scores(u: FloatArray) -> FloatArray:
    return np.asarray(special.ndtri(u))


def _function(
    title: str, inputs: int, values: Callable[..., Any], *orders: int, **settings: Any
) -> Function:
    return Function(inputs, values, dict(zip(SIZES, orders, strict=True)), title, **settings)


_DEPTH, _RESIDUE = (partial(_rods, each) for each in ("penetration_depth", "projectile_residue"))
NORMAL, INDICES = {"is_normal": True}, {"has_indices": True}
FUNCTIONS = {
    "concrete": _function("concrete depth", 4, _DEPTH, 3, 4, 5, is_logarithm=True, **NORMAL),
    "residue": _function("concrete residue", 4, _RESIDUE, 3, 4, 5, **NORMAL),
    "ishigami": _function("Ishigami", 3, _ishigami, 7, 9, 10, **INDICES),
    "borehole": _function("borehole", 8, _borehole, 2, 3, 3, **INDICES),
    "additive": _function(
        "additive",
        5,
        lambda u: (
            4 * u[:, 0]
            + (3 * u[:, 1] - 1) ** 2
            + np.exp(u[:, 2])
            + np.sin(3 * u[:, 3])
            + u[:, 4] ** 3
        ),
        *(3, 4, 5),
        **INDICES,
    ),
    "step": _function(
        "step", 3, lambda u: 2.0 * (u[:, 0] + 0.6 * u[:, 1] > 0.9) + u[:, 2], 4, 5, 7, **INDICES
    ),
    "rough": _function(
        "rough (useless surrogate)",
        3,
        lambda u: np.sin(41 * u[:, 0]) * np.cos(37 * u[:, 1]) + 0.5 * np.sin(53 * u[:, 2]),
        *(3, 4, 5),
        **INDICES,
    ),
    "lognormal": _function("exp z", 2, lambda u: np.exp(_scores(u[:, 0])), 4, 5, 6, **NORMAL),
    "pareto": _function("Pareto 3.3", 1, lambda u: (1 - u[:, 0]) ** (-1 / 3.3), 8, 10, 12),
    "modulus": _function(
        "exp abs z", 2, lambda u: np.exp(np.abs(_scores(u[:, 0]))), 6, 8, 10, **NORMAL
    ),
    "reciprocal": _function("1/(0.02 + u)", 2, lambda u: 1 / (0.02 + u[:, 0]), 8, 10, 12),
    "dependent": _function(
        "Ishigami, inputs correlated by 0.6", 3, _ishigami, 7, 9, 10, correlation=0.6
    ),
    "failures": _function(
        "Ishigami, failures in a corner",
        *(3, _ishigami, 7, 9, 10),
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
    cases=lambda: (
        (name, design, runs)
        for runs, name in product(SIZES, FUNCTIONS)
        for design in _designs(runs)
    ),
)


PLAIN, MEAN, PROBABILITIES = "plain draws", "for the mean", "for probabilities"
FIRST, ROUNDS = 100, (50, 75, 75)
CANDIDATES = 64
REFINED_EXCEEDED = {"P 0.14": 0, "P 0.05": 1}
STATISTICS = ("mean", "std", *REFINED_EXCEEDED, *(f"quantile {p:g}" for p in QUANTILES))
REFINED_SUMS = ("intervals", "covers", "width", "ratio", "placed")


def _two_modes(u: FloatArray) -> FloatArray:
    """Two far regions of large values, with a kink between (a series system's two branches)."""
    one, other = special.ndtri(u).T
    return np.asarray(np.abs(one + other) / math.sqrt(2) - 0.1 * (one - other) ** 2)


NAMES = ("step", "ishigami", "borehole", "rough", "concrete", "residue")
STUDIED = {name: FUNCTIONS[name]._replace(has_indices=False) for name in NAMES}
STUDIED["two modes"] = Function(
    2, _two_modes, {100: 6, 200: 8, 500: 10}, "two modes", is_normal=True
)


class _Fold(NamedTuple):
    """A fit without a fold, as the placement of runs needs it."""

    problem: Problem
    size: int
    coefficients: FloatArray
    outputs: tuple[Output, ...] = (Output("y", "1"),)

    @property
    def without_fields(self) -> _Fold:
        return self

    @property
    def random_inputs(self) -> tuple[str, ...]:
        return tuple(f"x{number}" for number in range(self.problem.function.inputs))

    def values(self, points: FloatArray) -> FloatArray:
        matrix = self.problem.matrix(self.size, points)
        return _predicted(matrix, self.coefficients, self.problem.function)

    def evaluate(self, columns: Mapping[str, FloatArray]) -> Results:
        points = np.column_stack([columns[name] for name in self.random_inputs])
        return Results({"y": self.values(points)}, np.zeros(len(points), dtype=np.int8))


class _Runs(NamedTuple):
    """Completed runs with their weights."""

    points: FloatArray
    values: FloatArray
    weights: FloatArray

    def with_more(self, other: _Runs) -> _Runs:
        return _Runs(*map(np.concatenate, zip(self, other, strict=True)))

    def cross_fit(self, problem: Problem, rng: np.random.Generator) -> CrossFit:
        size = 100 if len(self.values) < 180 else 200
        matrix = problem.matrix(size, self.points)
        fold = rng.permutation(len(self.values)) % FOLDS
        seen = ((matrix[fold != k], self.values[fold != k]) for k in range(FOLDS))
        fits = (_Fold(problem, size, _fit(*each, problem.function)) for each in seen)
        return CrossFit(fold, tuple(fits))  # type: ignore[arg-type] # all that placement needs

    def dataset(self) -> xr.Dataset:
        columns = {f"x{number}": (RUN, column) for number, column in enumerate(self.points.T)}
        status = np.full(len(self.values), Status.OK)
        columns |= {"y": (RUN, self.values), STATUS: (RUN, status)}
        return xr.Dataset(columns, {WEIGHT: (RUN, self.weights)})


def _made(problem: Problem, points: FloatArray, weights: FloatArray) -> _Runs:
    values = problem.function.values(points)
    is_admissible = ~np.isnan(values)
    return _Runs(points[is_admissible], values[is_admissible], weights[is_admissible])


def _refined(problem: Problem, target: RefinedOutput, rng: np.random.Generator) -> _Runs:
    """Return the runs of a refined design."""
    inputs = problem.function.inputs
    runs = _made(problem, rng.random((FIRST, inputs)), np.ones(FIRST))
    for size in ROUNDS:
        candidates = rng.random((size * CANDIDATES, inputs))
        columns = {f"x{number}": column for number, column in enumerate(candidates.T)}
        folds = runs.cross_fit(problem, rng)
        errors = list(predicted_errors(folds, runs.dataset(), columns, [target]))
        placed = place(errors, size, CANDIDATES, float(runs.weights.max()), rng)
        runs = runs.with_more(_made(problem, candidates[placed.candidates], placed.weights))
    return runs


def _evidence(
    problem: Problem, runs: _Runs, rng: np.random.Generator, family: int
) -> CorrectionRuns:
    folds = runs.cross_fit(problem, rng)
    size = folds.models[0].size  # type: ignore[attr-defined]
    at_draws, draw_set = problem.draws(size, family)
    predictions = np.empty(len(runs.values))
    draws = []
    for number, model in enumerate(folds.models):
        own = folds.fold == number
        predictions[own] = model.values(runs.points[own])  # type: ignore[attr-defined]
        coefficients = model.coefficients  # type: ignore[attr-defined]
        draws.append(_predicted(at_draws, coefficients, problem.function))
    is_weighted = bool((runs.weights != 1).any())
    return CorrectionRuns(
        runs.values,
        predictions,
        folds.fold,
        np.array(draws),
        draw_set,
        np.empty(0),
        np.empty(0, dtype=np.int64),
        weights=runs.weights if is_weighted else None,
        missing_weights=np.empty(0) if is_weighted else None,
    )


def _refined_designs(
    problem: Problem, thresholds: FloatArray, seed: int
) -> Iterator[tuple[str, _Runs, np.random.Generator]]:
    streams = Stream(seed, "refined coverage")
    rng = streams.generator(PLAIN)
    count = FIRST + sum(ROUNDS)
    drawn = rng.random((count, problem.function.inputs))
    yield PLAIN, _made(problem, drawn, np.ones(count)), rng
    limits = tuple(float(thresholds[number]) for number in REFINED_EXCEEDED.values())
    for name, target in ((MEAN, RefinedOutput("y")), (PROBABILITIES, RefinedOutput("y", limits))):
        rng = streams.generator(name)
        yield name, _refined(problem, target, rng), rng


def _refined_rows(name: str, seeds: Sequence[int]) -> Iterator[Row]:
    problem = Problem(STUDIED[name])
    counts: dict[tuple[str, str], dict[str, float]]
    counts = defaultdict(lambda: dict.fromkeys(REFINED_SUMS, 0))
    truth = problem.truth
    for seed in seeds:
        plain: dict[str, float] = {}
        for design, runs, rng in _refined_designs(problem, truth.thresholds, seed):
            evidence = _evidence(problem, runs, rng, seed % 2)
            found = dict(_corrected(evidence, truth))
            for statistic in STATISTICS:
                estimate = found[statistic]
                count = counts[design, statistic]
                count["placed"] += int((runs.weights != 1).sum())
                width = estimate.upper - estimate.lower
                if math.isnan(width):
                    continue
                count["intervals"] += 1
                count["covers"] += bool(estimate.lower <= truth.values[statistic] <= estimate.upper)
                if design == PLAIN:
                    plain[statistic] = width
                if statistic in plain:
                    count["width"] += 1
                    count["ratio"] += math.log(width / plain[statistic])
    for (design, statistic), count in counts.items():
        yield {"runs": design, "statistic": statistic, **count}


def _refined_cells(rows: Sequence[Row]) -> dict[tuple[str, str, str], SimpleNamespace]:
    return totals(rows, "function", "runs", "statistic")


def _refined_page(rows: Sequence[Row]) -> Iterator[str]:
    cells = _refined_cells(rows)
    of = []
    for name, design in product(STUDIED, (PLAIN, MEAN, PROBABILITIES)):
        if first := cells.get((name, design, STATISTICS[0])):
            texts = (_refined_text(cells.get((name, design, each))) for each in STATISTICS)
            of.append([STUDIED[name].title, design, f"{first.placed / first.count:.0f}", *texts])
    yield from lines(["function", "runs", "placed", *STATISTICS], of)
    fewest = min(cell.count for cell in cells.values())
    error = 100 * math.sqrt(0.95 * 0.05 / fewest)
    yield ""
    yield f"{fewest} seeds or more; the standard error of a coverage is {error:.1f} points."


def _refined_text(cell: SimpleNamespace | None) -> str:
    """Coverage in per cent, and the geometric mean of the ratios of the widths."""
    if cell is None:
        return "–"
    if cell.intervals < cell.count / 2:
        return "none"
    return f"{100 * cell.covers / cell.intervals:.0f} / {math.exp(cell.ratio / cell.width):.2f}"


REFINED_TABLE = SeedTable(
    {"function": STUDIED},
    _refined_rows,
    {"refined designs": _refined_page},
    lambda rows: too_seldom(_refined_cells(rows)),
    at_once=5,
)

if __name__ == "__main__":
    main({"corrected": TABLE, "refined": REFINED_TABLE}, __doc__)
