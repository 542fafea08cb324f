"""How often the corrected indices of surrogates cover where draws stand in for terms.

A table of docs/coverage.md as `seed_table.py` makes it.

Some studies have inadmissible draws, some dependent inputs; a depth is fitted as its logarithm. A
surrogate is a sparse polynomial chaos of an order fixed beforehand, in five folds. Seeds take turns
with two families of pairs of draws, so that the terms there are computed once. True indices are
from pairs of draws of the model. An index that is refused for the tail of its variable is measured
all the same. A cell fails if its intervals cover in less than 92 %.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, cached_property
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.stats import qmc
from seed_table import LOWEST, Case, Row, SeedTable, lines, per_cent

from uqpen.core.model import Results
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.execution import Evaluator
from uqpen.statistics.surrogate.corrected_indices import (
    InputParts,
    corrected_event_indices,
    corrected_indices,
)
from uqpen.statistics.surrogate.corrected_moments import CorrectedMoments
from uqpen.statistics.surrogate.corrected_statistics import FEWEST_ON_A_SIDE
from uqpen.statistics.surrogate.correction_runs import CorrectionRuns
from uqpen.statistics.surrogate.surrogate_draws import (
    ConditionalDraws,
    PickFreezePairs,
    paired_outputs,
)
from uqpen.study.load import load_study, parse_study
from uqpen.study.study import ValidatedStudy
from uqpen.surrogates.chaos.basis import ProductBasis
from uqpen.surrogates.chaos.coefficients import sparse_regression

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Function = Callable[[FloatArray], FloatArray]

FOLDS = 5
# Sets of draws and of pairs, and the points of each; draws that share inputs with a run.
SETS, POINTS, SHARED = 16, 1024, 32
_FAMILIES = 2
_TRUTHS = 2

_ISHIGAMI = """
seed = 1
[model]
use = "ishigami"
[inputs]
x1 = { uniform = { lower = -3.141592653589793, upper = 3.141592653589793 } }
x2 = { uniform = { lower = -3.141592653589793, upper = 3.141592653589793 } }
x3 = { uniform = { lower = -3.141592653589793, upper = 3.141592653589793 } }
[outputs.y]
exceeds = [7]
[designs.some]
kind = "monte-carlo"
runs = 10
"""
_DEPENDENT = """
[dependence]
copula = "gaussian"
of = "normal-scores"
pairs = [
    { inputs = ["x1", "x2"], correlation = 0.6 },
    { inputs = ["x1", "x3"], correlation = 0.6 },
    { inputs = ["x2", "x3"], correlation = 0.6 },
]
"""
_PARTIAL = """
[constraints]
keep = ["x1 + x2 < 3"]
"""
_CONCRETE = Path(__file__).parents[1] / "studies" / "concrete.toml"


class Variable(NamedTuple):
    """An output, its logarithm, or whether it exceeds a value."""

    name: str
    output: str
    function: Function
    is_event: bool = False


class Problem:
    """A study with the polynomials of its surrogate, and draws for it."""

    def __init__(self, title: str, study: ValidatedStudy, order: int, logarithm: str = "") -> None:
        self.title, self.study, self.order, self.logarithm = title, study, order, logarithm
        (self.variant,) = study.models.values()
        self.evaluator = Evaluator(self.variant.model, study.constraints)
        self.basis = ProductBasis.from_distribution(study.joint, order, logarithms=False)
        self.terms = self.basis.indices(order, 1.0)
        self.inputs = len(study.joint.random)
        self.single = [1 << number for number in range(self.inputs)]
        self.others = [sum(self.single) - each for each in self.single]

    @property
    def outputs(self) -> list[str]:
        """The outputs with numbers."""
        return [each.name for each in self.variant.model.outputs if not each.categories]

    @cached_property
    def variables(self) -> list[Variable]:
        """All variables with indices."""
        found = [Variable(name, name, lambda values: values) for name in self.outputs]
        if self.logarithm:
            found.append(Variable(f"log {self.logarithm}", self.logarithm, np.log))
        for quantity in self.study.model_quantities(self.variant.model):
            for each in quantity.thresholds:
                name = f"{quantity.output.name} > {each.text}"
                found.append(Variable(name, quantity.output.name, _event(each.value), True))
        return found

    def draws(self, stream: Stream) -> ConditionalDraws:
        """Return the admissible distribution to draw from."""
        return ConditionalDraws(self.evaluator, self.study.joint, self.variant.given, stream)

    @cached_property
    def truth(self) -> dict[tuple[str, str], FloatArray]:
        """The indices of the model itself, by variable and kind."""
        found = defaultdict(list)
        for number in range(_TRUTHS):
            draws = self.draws(Stream(number, "truth"))
            subsets = sorted({0, *self.single, *self.others})
            (pairs,) = paired_outputs(draws, [self.evaluator], subsets)
            for variable in self.variables:
                for kind, _, squares in self.parts_of(variable, pairs):
                    whole = np.nanvar(variable.function(pairs.first[variable.output]))
                    found[variable.name, kind].append(squares.mean(axis=1) / whole)
        return {key: np.mean(each, axis=0) for key, each in found.items()}

    def parts_of(
        self, variable: Variable, pairs: PickFreezePairs
    ) -> Iterator[tuple[str, list[int], FloatArray]]:
        """Yield a kind, the shared inputs, and the mean squares, shape (input, replicate)."""
        of = (variable.output, variable.function)
        yield "first", self.single, np.array([pairs.explained(*of, each) for each in self.single])
        if self.study.joint.is_independent:
            yield "total", self.others, np.array([pairs.left(*of, each) for each in self.others])

    def matrix(self, inputs: Mapping[str, FloatArray]) -> FloatArray:
        """Return the values of the terms."""
        return self.basis.matrix(inputs, self.terms)

    @cache  # noqa: B019 - problems last as long as the script
    def pairs(self, family: int) -> PickFreezePairs:
        """Return the terms at a family of pairs, as the output "terms"."""

        def terms(inputs: dict[str, FloatArray]) -> Results:
            rows = len(next(iter(inputs.values()))) // SETS
            first = (np.arange(SETS)[:, None] * rows + np.arange(POINTS)).ravel()
            matrix = self.matrix({name: each[first] for name, each in inputs.items()})
            return Results({"terms": matrix}, np.zeros(len(matrix), dtype=np.int8))

        subsets = sorted({0, *self.single, *self.others})
        (found,) = paired_outputs(self.draws(Stream(family, "pairs")), [terms], subsets)  # type: ignore[list-item]
        return found

    @cache  # noqa: B019
    def sample(self, family: int) -> tuple[FloatArray, IntArray]:
        """Return the terms at a family of draws, and the set of each."""
        sets = [qmc.Sobol(self.inputs, seed=100 * family + n).random(POINTS) for n in range(SETS)]
        points = self.study.joint.conditional_probabilities(np.concatenate(sets), {})
        inputs = self._fixed(len(points)) | self.study.joint.ppf(points)
        is_in = self.evaluator(inputs).status == Status.OK
        matrix = self.matrix({name: each[is_in] for name, each in inputs.items()})
        return matrix, np.repeat(np.arange(SETS), POINTS)[is_in]

    def _fixed(self, runs: int) -> dict[str, FloatArray]:
        fixed = {entry.variable.name: entry.value for entry in self.study.joint.fixed}
        return {name: np.full(runs, value) for name, value in fixed.items()}

    def fit(self, matrix: FloatArray, values: FloatArray, output: str) -> FloatArray:
        """Return the coefficients of all terms."""
        fitted = np.log(values) if output == self.logarithm else values
        centre, spread = fitted.mean(), fitted.std()
        found = sparse_regression(matrix, (fitted - centre) / spread)
        coefficients = np.zeros(matrix.shape[1])
        if found is not None:
            coefficients[found.terms] = found.coefficients * spread
        coefficients[0] += centre
        return coefficients

    def predicted(self, sums: FloatArray, output: str) -> FloatArray:
        """Return the output from the sums of the terms."""
        return np.exp(sums) if output == self.logarithm else sums


def _event(limit: float) -> Function:
    return lambda values: np.where(np.isnan(values), np.nan, values > limit)


@cache
def problems() -> dict[str, Problem]:
    """Return the problems by name."""
    concrete, whole = load_study(_CONCRETE), parse_study(_ISHIGAMI)
    dependent, partial = (parse_study(_ISHIGAMI + each) for each in (_DEPENDENT, _PARTIAL))
    return {
        "dependent": Problem("Ishigami, dependent", dependent, 8),
        "partial": Problem("Ishigami, inadmissible draws", partial, 8),
        "poor": Problem("Ishigami, order 4", whole, 4),
        "concrete": Problem("concrete", concrete, 4, "penetration_depth"),
    }


def _indices(problem: Problem, runs: int, seed: int) -> Iterator[Row]:
    """Yield the indices of a seed."""
    stream = Stream(seed, "coverage")
    draws, rng = problem.draws(stream), stream.generator("runs")
    made = draws.draw(rng.random((runs, problem.inputs)), {}, "runs")
    outputs, matrix = problem.evaluator(made.inputs).outputs, problem.matrix(made.inputs)
    fold = rng.permutation(runs) % FOLDS
    fits = {
        name: np.array(
            [problem.fit(matrix[fold != k], outputs[name][fold != k], name) for k in range(FOLDS)]
        )
        for name in problem.outputs
    }
    at_draws, of_set = problem.sample(seed % _FAMILIES)
    pairs = problem.pairs(seed % _FAMILIES)
    shared = _terms_at_runs(problem, draws, made.points, rng)
    for variable in problem.variables:
        fit, name = fits[variable.output], variable.output
        own = problem.predicted((matrix * fit[fold]).sum(axis=1), name)
        none = np.empty(0)
        whole = CorrectionRuns(
            outputs[name], own, fold, problem.predicted(fit @ at_draws.T, name), of_set,
            none, none.astype(np.int64),
        ).of(variable.function)  # fmt: skip
        of_folds = [_predicted_pairs(problem, pairs, each, name) for each in fit]
        moments = CorrectedMoments(whole)
        for kind, parts in _parts(problem, variable, whole, of_folds, shared, fit):
            found = (
                corrected_event_indices(whole, parts)
                if variable.is_event
                else corrected_indices(whole, parts, moments.variance)
            )
            for number, estimate in enumerate(found):
                ends = dict(zip(("value", "lower", "upper"), estimate.bounds, strict=True))
                yield {
                    "statistic": f"{variable.name}, {kind}",
                    "input": number,
                    "true": problem.truth[variable.name, kind][number],
                    **ends,
                    "kurtosis": moments.kurtosis,
                    "refused": int(_is_refused(variable, whole, moments)),
                }


def _terms_at_runs(
    problem: Problem, draws: ConditionalDraws, points: FloatArray, rng: np.random.Generator
) -> dict[int, FloatArray]:
    """Return the terms at draws that share inputs with runs, (run × draw, term), by the inputs."""
    size = len(points) * SHARED
    unit = qmc.Sobol(problem.inputs, rng=rng).random_base2((size - 1).bit_length())[:size]
    given, found = np.repeat(points, SHARED, axis=0), {}
    for subset in {*problem.single, *problem.others}:
        some = {each: given[:, each] for each in range(problem.inputs) if subset >> each & 1}
        found[subset] = problem.matrix(draws.draw(unit, some, f"shared {subset}").inputs)
    return found


def _predicted_pairs(
    problem: Problem, pairs: PickFreezePairs, fit: FloatArray, output: str
) -> PickFreezePairs:
    def of(terms: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        return {output: problem.predicted(terms["terms"] @ fit, output)}

    second = {subset: of(each) for subset, each in pairs.second.items()}
    return PickFreezePairs(pairs.dimension, of(pairs.first), second)


def _parts(
    problem: Problem,
    variable: Variable,
    runs: CorrectionRuns,
    pairs: Sequence[PickFreezePairs],
    shared: Mapping[int, FloatArray],
    fits: FloatArray,
) -> Iterator[tuple[str, InputParts]]:
    """Yield the projections of the fits by kind, as the package has them from draws."""
    coefficients = np.repeat(fits[runs.fold], SHARED, axis=0)
    means = {
        subset: variable.function(
            problem.predicted((terms * coefficients).sum(axis=1), variable.output)
        )
        .reshape(-1, SHARED)
        .mean(axis=1)
        for subset, terms in shared.items()
    }
    centres = [np.nanmean(variable.function(each.first[variable.output])) for each in pairs]
    by_kind: dict[str, list[FloatArray]] = defaultdict(list)
    sets: dict[str, list[int]] = {}
    for each in pairs:
        for kind, subsets, squares in problem.parts_of(variable, each):
            by_kind[kind].append(squares)
            sets[kind] = subsets
    for kind, folds in by_kind.items():
        found = np.array(folds)
        pooled = np.tensordot(runs.shares, found, axes=1)
        error = pooled.std(axis=-1, ddof=1) / np.sqrt(pooled.shape[-1])
        columns = np.column_stack([means[subset] for subset in sets[kind]])
        if kind == "first":
            values = columns - np.array(centres)[runs.fold, None]
        else:
            values = runs.predictions[:, None] - columns
        yield kind, InputParts(values, found.mean(axis=-1), error)


def _is_refused(variable: Variable, runs: CorrectionRuns, moments: CorrectedMoments) -> bool:
    if not variable.is_event:
        return bool(moments.heavy_tail)
    return min((runs.values == side).sum() for side in (0, 1)) < FEWEST_ON_A_SIDE


def _cases() -> Iterator[Case]:
    yield from product(problems(), (100, 500))


def _rows(case: Case, seeds: Sequence[int], _: Namespace) -> Iterator[Row]:
    study, runs = case
    for seed in seeds:
        yield from _indices(problems()[str(study)], int(runs), seed)


def _cells(rows: Sequence[Row]) -> dict[tuple[str, int, str], list[Row]]:
    cells: dict[tuple[str, int, str], list[Row]] = defaultdict(list)
    for row in rows:
        cells[row["study"], row["runs"], row["statistic"]].append(row)
    return cells


def _page(rows: Sequence[Row]) -> Iterator[str]:
    head = ("study", "runs", "index of", "seeds", "coverage", "width", "given", "refused cover")
    cells = sorted(_cells(rows).items())
    of = ([problems()[study].title, *key, *_texts(cell)] for (study, *key), cell in cells)
    yield from lines(head, of)


def _texts(rows: Sequence[Row]) -> list[str]:
    given, refused = ([row for row in rows if row["refused"] == each] for each in (0, 1))
    width = np.mean([row["upper"] - row["lower"] for row in given or refused])
    seeds = len({row["first"] for row in rows})
    share = f"{100 * len(given) / len(rows):.0f} %"
    return [str(seeds), _coverage(given), f"{width:.3f}", share, _coverage(refused)]


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for key, found in _cells(rows).items():
        given = [row for row in found if not row["refused"]]
        if _covering(given) < LOWEST * len(given):
            yield f"{key}: {_covering(given)} of {len(given)}"


def _covering(rows: Sequence[Row]) -> int:
    return sum(row["lower"] <= row["true"] <= row["upper"] for row in rows)


def _coverage(rows: Sequence[Row]) -> str:
    return per_cent(_covering(rows), len(rows)) if rows else "–"


TABLE = SeedTable(
    ("study", "runs"), _cases, _rows, {"corrected indices": _page}, _failing, seeds=300
)

if __name__ == "__main__":
    sys.exit(TABLE.main(__doc__))
