"""What refined designs bring: coverage and width of corrected estimates, beside plain draws.

A table of docs/coverage/surrogates.md as `seed_table.py` makes it. Each seed has 300 runs: of plain
draws, or 100 of them and 200 that a surrogate places, for the means or for the probabilities. A
width is over that of the corrected interval of the 300 plain draws of the same seed.

Surrogates are those of ``corrected_coverage.py``: sparse expansions of an order fixed beforehand,
in five folds. True values are from a million points of a Sobol' sequence. A cell fails if its
intervals cover in less than 92 %.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import xarray as xr
from corrected_coverage import (
    FOLDS,
    FUNCTIONS,
    QUANTILES,
    Function,
    Problem,
    _corrected,
    _fit,
    _predicted,
)
from scipy import special
from seed_table import Row, SeedTable, lines, too_seldom, totals

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import RUN, STATUS, WEIGHT
from uqpen.core.model import Output, Results
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.statistics.surrogate.correction_runs import CorrectionRuns
from uqpen.surrogates.fitting import CrossFit
from uqpen.surrogates.refinement import RefinedOutput, place, predicted_errors

PLAIN, MEAN, PROBABILITIES = "plain draws", "for the mean", "for probabilities"
FIRST, ROUNDS = 100, (50, 75, 75)
CANDIDATES = 64
EXCEEDED = {"P 0.14": 0, "P 0.05": 1}
STATISTICS = ("mean", "std", *EXCEEDED, *(f"quantile {p:g}" for p in QUANTILES))
SUMS = ("intervals", "covers", "width", "ratio", "placed")


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


def _designs(
    problem: Problem, thresholds: FloatArray, seed: int
) -> Iterator[tuple[str, _Runs, np.random.Generator]]:
    streams = Stream(seed, "refined coverage")
    rng = streams.generator(PLAIN)
    count = FIRST + sum(ROUNDS)
    drawn = rng.random((count, problem.function.inputs))
    yield PLAIN, _made(problem, drawn, np.ones(count)), rng
    limits = tuple(float(thresholds[number]) for number in EXCEEDED.values())
    for name, target in ((MEAN, RefinedOutput("y")), (PROBABILITIES, RefinedOutput("y", limits))):
        rng = streams.generator(name)
        yield name, _refined(problem, target, rng), rng


def _rows(name: str, seeds: Sequence[int]) -> Iterator[Row]:
    problem = Problem(STUDIED[name])
    counts: dict[tuple[str, str], dict[str, float]]
    counts = defaultdict(lambda: dict.fromkeys(SUMS, 0))
    truth = problem.truth
    for seed in seeds:
        plain: dict[str, float] = {}
        for design, runs, rng in _designs(problem, truth.thresholds, seed):
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


def _cells(rows: Sequence[Row]) -> dict[tuple[str, str, str], SimpleNamespace]:
    return totals(rows, "function", "runs", "statistic")


def _page(rows: Sequence[Row]) -> Iterator[str]:
    cells = _cells(rows)
    of = []
    for name, design in product(STUDIED, (PLAIN, MEAN, PROBABILITIES)):
        if first := cells.get((name, design, STATISTICS[0])):
            texts = (_text(cells.get((name, design, each))) for each in STATISTICS)
            of.append([STUDIED[name].title, design, f"{first.placed / first.count:.0f}", *texts])
    yield from lines(["function", "runs", "placed", *STATISTICS], of)
    fewest = min(cell.count for cell in cells.values())
    error = 100 * math.sqrt(0.95 * 0.05 / fewest)
    yield ""
    yield f"{fewest} seeds or more; the standard error of a coverage is {error:.1f} points."


def _text(cell: SimpleNamespace | None) -> str:
    """Coverage in per cent, and the geometric mean of the ratios of the widths."""
    if cell is None:
        return "–"
    if cell.intervals < cell.count / 2:
        return "none"
    return f"{100 * cell.covers / cell.intervals:.0f} / {math.exp(cell.ratio / cell.width):.2f}"


TABLE = SeedTable(
    {"function": STUDIED},
    _rows,
    {"refined designs": _page},
    lambda rows: too_seldom(_cells(rows)),
    at_once=5,
)

if __name__ == "__main__":
    TABLE.main(__doc__)
