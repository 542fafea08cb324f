"""Sobol' indices of a variable, by a surrogate and corrected by real runs.

What an input explains of a variable f is E(Pf)², where P is a projection: on the functions of the
input alone (first order), or on those with no part without it (total order). For a surrogate g

    E(Pf)² = 2 E(f Pg) − E(Pg)² + E(P(f − g))²,  and  0 ≤ E(P(f − g))² ≤ E(f − g)²

So the first two terms, which real runs estimate without bias, are a lower bound; with the square of
the errors they are an upper bound. Where the surrogate is good, the two are close. This holds for
inputs that depend on each other, too: the projections are conditional means.

References
----------
Zhang, L. & Janson, L. (2020). arXiv:2007.01283 (floodgate: the lower bound).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import OF_EXCEEDANCE, OF_LOGARITHM, OF_MEAN
from uqpen.designs.quasi_monte_carlo import sobol_points
from uqpen.execution import Evaluator
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import ratio_error, student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.surrogate.corrected_moments import CorrectedMean
from uqpen.statistics.surrogate.correction_runs import CorrectionRuns, FoldFit
from uqpen.statistics.surrogate.surrogate_draws import (
    ConditionalDraws,
    PickFreezePairs,
    SurrogateDraws,
    paired_outputs,
)
from uqpen.surrogates.fitted_surrogate import ClosedForms

FIRST_ORDER, TOTAL_ORDER = "first_order", "total_order"

Function = Callable[[FloatArray], FloatArray]

# Both ends move out by this: errors below it are those of the true values of the simulations.
_RESOLUTION = 0.001


@dataclass(frozen=True, eq=False)
class InputParts:
    """Projections of the surrogate, by input."""

    values: FloatArray  # (run, input): the projection of the fit of each run's fold, at the run
    squares: FloatArray  # (fold, input): the mean square of the projection of each fold's fit
    # (input,): standard error that draws leave to the mean of the squares over all runs.
    error: FloatArray | float = 0.0

    def each(self) -> Iterator[tuple[FloatArray, FloatArray, float]]:
        """Yield values, mean squares and their error for each input."""
        error = np.broadcast_to(self.error, self.squares.shape[1:]).tolist()
        yield from zip(self.values.T, self.squares.T, error, strict=True)


def corrected_indices(
    runs: CorrectionRuns, parts: InputParts, variance: CorrectedMean
) -> Iterator[Estimate]:
    """Yield the index of each input, between the intervals of its two bounds.

    The squares of the errors of means of repeated runs have noise in them, which no input explains.
    It is known from the repeats, and taken out.

    Parameters
    ----------
    variance : CorrectedMean
        Of the output, or of its mean given the inputs.
    """
    errors = runs.means() - runs.predictions
    errors = errors - errors.mean()
    for values, squares, draws_error in parts.each():
        least = squares[runs.fold] + 2 * errors * values
        share = _Share(runs, variance, draws_error)
        value, lower, least_upper = share.interval(least)
        _, _, upper = share.interval(least + (errors**2 - runs.noise_of_means))
        # Without the noise, the mean square of errors may come out below 0.
        if runs.repeats is not None:
            upper = max(upper, least_upper)
        yield _bracket(value, lower, upper)


def corrected_event_indices(runs: CorrectionRuns, parts: InputParts) -> Iterator[Estimate]:
    """Yield the index of each input for an event, a variable that is 0 or 1.

    Bonett and Price add a run in which the event happened by the model alone, and one in which it
    happened by the surrogate alone. So do both bounds, each with the runs that move it out: where
    the runs show few disagreements, their scatter is too small.
    """
    errors = runs.values - runs.predictions
    centre = float(runs.pooled(runs.draws).mean() + errors.mean())
    squares_of_fits = (runs.draws - centre) ** 2
    # (f − c)² − (g − c)² for the two values of f and of g.
    influence = squares_of_fits.mean(axis=1)[runs.fold] + errors * (1 - 2 * centre)
    noise, _ = ratio_error(runs.pooled(squares_of_fits), runs.draw_replicate, runs.draw_replicates)
    added = float(influence.mean()) + (1 - 2 * centre) * np.array([1.0, -1.0])
    variance = CorrectedMean(np.append(influence, added), 1.0, float(noise) ** 2)
    errors = errors - errors.mean()
    for values, squares, draws_error in parts.each():
        least = squares[runs.fold] + 2 * errors * values
        value = float(least.mean()) / float(influence.mean())
        share = _Share(runs, variance, draws_error)
        added = np.full(2, squares.mean()) - 2 * _at_the_border(values, runs.values)
        _, lower, _ = share.interval(np.append(least, added))
        added = np.full(2, squares.mean()) + 2 * _at_the_border(values, runs.values) + 1
        _, _, upper = share.interval(np.append(least + errors**2, added))
        yield _bracket(value, lower, upper)


def _at_the_border(values: FloatArray, events: FloatArray) -> float:
    """Return the size of a projection at the border of an event, where its runs meet the others."""
    sides = [float((values[events == side] ** 2).mean()) for side in (0.0, 1.0)]
    return math.sqrt(sum(sides) / 2)


def _bracket(value: float, lower: float, upper: float) -> Estimate:
    """Return an index between two bounds."""
    value = min(max(value, 0.0), 1.0)
    return Estimate(
        value,
        min(max(lower - _RESOLUTION, 0.0), value),
        max(min(upper + _RESOLUTION, 1.0), value),
        texts.CORRECTED_BRACKET,
        "conservative",
    )


@dataclass(frozen=True, eq=False)
class _Share:
    """Share of the variance of a variable, by the delta method."""

    runs: CorrectionRuns
    variance: CorrectedMean  # of the variable
    draws_error: float  # standard error of the part that draws leave

    def interval(self, terms: FloatArray) -> tuple[float, float, float]:
        """Return the mean of some terms as a share, with its bounds."""
        variance, whole = self.variance, self.variance.value
        share = float(terms.mean()) / whole
        influence = (terms - share * variance.influence) / whole
        noise = (share**2 * variance.draws_variance + self.draws_error**2) / whole**2
        found = CorrectedMean(influence, 1.0, noise)
        half = student_quantile(self.runs.size - 2, self.runs.level) * found.error
        if math.isnan(half):
            return share, -math.inf, math.inf
        half += found.missing_margin(self.runs)
        return share, share - half, share + half


# Projections of each fold's fit, by draws that share inputs with its runs and with each other.
#
# No terms of a fit are needed: the part of an output that an input explains is a conditional mean.
# At a run it is the mean over some draws that share the input with the run. They are unbiased,
# however few they are. Its mean square follows from pairs of draws that share the input. All draws
# are admissible, so that the parts are those of the distribution given admissible, and they may be
# of inputs that depend on each other.

# Draws that share inputs with a run: their scatter, divided by their number, adds to that of the
# errors. Fewer of them for many runs or inputs.
_MOST_DRAWS = 32
_FEWEST_DRAWS = 4
_EVALUATIONS = 2**20


# Variables whose indices runs correct: an output, its logarithm, and whether it exceeds a value.
#
# What the fits have of each input follows from their terms, where these are those of the variable,
# and else from draws that share inputs.


def _itself(values: FloatArray) -> FloatArray:
    return values


@dataclass(frozen=True, eq=False)
class IndexedVariable:
    """Variable with the projections of its fits."""

    output: CorrectionRuns  # of the output that it follows from
    parts: Mapping[str, InputParts]  # by the kind of the indices
    reasons: Mapping[str, str]  # why there are no projections for the other kinds
    function: Function = _itself  # function of the output that the variable is
    is_event: bool = False  # true if the variable is 0 or 1
    is_of_mean: bool = False  # true if it is the mean of the output given the inputs

    @property
    def runs(self) -> CorrectionRuns:
        """The runs of the variable; those of many thresholds are not in memory together."""
        return self.output if self.function is _itself else self.output.of(self.function)

    @classmethod
    def without(
        cls, output: CorrectionRuns, reason: str, function: Function = _itself
    ) -> IndexedVariable:
        """Return a variable without projections, for one reason."""
        return cls(output, {}, dict.fromkeys((FIRST_ORDER, TOTAL_ORDER), reason), function)


@dataclass(frozen=True)
class IndexedVariables:
    """Folds of real runs, with the projections of their fits."""

    draws: SurrogateDraws  # of the fit to all training runs; its model has scalar outputs
    folds: Sequence[FoldFit]

    def of_output(
        self, quantity: QuantityOfInterest, runs: CorrectionRuns
    ) -> dict[str, tuple[IndexedVariable, ...]]:
        """Return the variables of an output, by the beginning of the names of their indices."""
        name = quantity.output.name
        is_log = name in self.draws.model.logarithms
        output = self._variable(name, _itself, runs, is_fitted=not is_log)
        found: dict[str, tuple[IndexedVariable, ...]] = {"": (output,)}
        if runs.repeats is not None:
            found[OF_MEAN] = (replace(output, is_of_mean=True),)
        if is_log and (runs.every > 0).all():
            found[OF_LOGARITHM] = (self._variable(name, np.log, runs, is_fitted=True),)
        elif is_log:
            found[OF_LOGARITHM] = (IndexedVariable.without(runs, texts.NOT_POSITIVE_IN_RUNS),)
        found[OF_EXCEEDANCE] = tuple(
            replace(self._variable(name, exceeds, runs, is_fitted=False), is_event=True)
            for exceeds in (_event(each.value) for each in quantity.thresholds)
        )
        return found

    def _variable(
        self,
        output: str,
        function: Function,
        runs: CorrectionRuns,
        *,
        is_fitted: bool,
    ) -> IndexedVariable:
        """Return a function of an output, which may be the variable that was fitted."""
        variable = runs if function is _itself else runs.of(function)
        if runs.placed:
            reason = texts.NO_INDICES_OF_PLACED.format(placed=runs.placed)
            return IndexedVariable.without(runs, reason, function)
        if not np.isfinite(variable.draws).all():
            return IndexedVariable.without(runs, texts.NOT_FINITE_PREDICTIONS)
        if is_fitted and (terms := self._from_terms(output, variable)):
            return terms
        joint = self.draws.joint
        if joint.conditional_reason:
            return IndexedVariable.without(runs, joint.conditional_reason, function)
        parts = {FIRST_ORDER: self._projections(FIRST_ORDER, output, function, variable)}
        if not joint.is_independent:
            return IndexedVariable(runs, parts, {TOTAL_ORDER: texts.DEPENDENT_INPUTS}, function)
        parts[TOTAL_ORDER] = self._projections(TOTAL_ORDER, output, function, variable)
        return IndexedVariable(runs, parts, {}, function)

    def _from_terms(self, output: str, variable: CorrectionRuns) -> IndexedVariable | None:
        """Return the variable with the terms of all fits; None where these are not known."""
        if not (self.draws.joint.is_independent and self.draws.all_are_admissible):
            return None
        known = [each for fold in self.folds if (each := _terms(fold, output))]
        if len(known) < len(self.folds):
            return None
        alone, in_all, first, total, moments = zip(*known, strict=True)
        parts = {
            FIRST_ORDER: InputParts(np.concatenate(alone), np.array(first)),
            TOTAL_ORDER: InputParts(np.concatenate(in_all), np.array(total)),
        }
        return IndexedVariable(replace(variable, exact_moments=np.array(moments)), parts, {})

    def _projections(
        self, kind: str, output: str, function: Function, runs: CorrectionRuns
    ) -> InputParts:
        """Return the conditional means given each input; or what is left without all the others.

        They are of a function of the output, and so are the runs.
        """
        sets = self._single if kind == FIRST_ORDER else self._others
        values, squares = [], []
        for number, (at_runs, pairs) in enumerate(zip(self._at_runs, self._pairs, strict=True)):
            own = runs.predictions[runs.fold == number]
            means = [_row_means(function(at_runs[each][output]), own) for each in sets]
            if kind == FIRST_ORDER:
                centre = float(np.nanmean(function(pairs.first[output])))
                values.append(np.column_stack(means) - centre)
                squares.append([pairs.explained(output, function, each) for each in sets])
            else:
                values.append(own[:, None] - np.column_stack(means))
                squares.append([pairs.left(output, function, each) for each in sets])
        # The scatter of mean squares, (fold, input, replicate).
        found = np.array(squares)
        pooled = np.tensordot(runs.shares, found, axes=1)
        error = pooled.std(axis=-1, ddof=1) / np.sqrt(pooled.shape[-1])
        return InputParts(np.concatenate(values), found.mean(axis=-1), error)

    @property
    def _single(self) -> list[int]:
        """Sets of one input each, as bits."""
        return [1 << number for number in range(len(self.draws.joint.random))]

    @property
    def _others(self) -> list[int]:
        """Sets of all inputs but one."""
        whole = (1 << len(self.draws.joint.random)) - 1
        return [whole ^ each for each in self._single]

    @cached_property
    def _conditional(self) -> ConditionalDraws:
        draws = self.draws
        evaluator = Evaluator(draws.model, draws.constraints)
        return ConditionalDraws(evaluator, draws.joint, draws.given, draws.stream.child("indices"))

    @cached_property
    def _pairs(self) -> list[PickFreezePairs]:
        subsets = sorted({0, *self._single, *self._others})
        return paired_outputs(self._conditional, [*map(self._evaluator, self.folds)], subsets)

    def _evaluator(self, fold: FoldFit) -> Evaluator:
        return Evaluator(fold.model, self.draws.constraints)

    @cached_property
    def _at_runs(self) -> list[dict[int, Mapping[str, FloatArray]]]:
        """Outputs of each fold's fit, by shared inputs, each of shape (run, draw)."""
        return [self._at_runs_of(number, fold) for number, fold in enumerate(self.folds)]

    def _at_runs_of(self, number: int, fold: FoldFit) -> dict[int, Mapping[str, FloatArray]]:
        subsets = sorted({*self._single, *self._others})
        runs = sum(each.size for each in self.folds)
        affordable = _EVALUATIONS // (len(subsets) * max(runs, 1))
        count = 1 << min(max(affordable, _FEWEST_DRAWS), _MOST_DRAWS).bit_length() - 1
        rng = self._conditional.stream.generator("runs", number)
        unit = sobol_points(rng, max(fold.size, 1) * count, len(self._single))
        unit = unit[: fold.size * count]
        given = {name: np.repeat(each, count) for name, each in fold.inputs(fold.completed).items()}
        points = self._conditional.probabilities(given, unit)
        names = list(given)
        found: dict[int, Mapping[str, FloatArray]] = {}
        for subset in subsets:
            some = [each for each in range(len(names)) if subset >> each & 1]
            sample = self._conditional.draw(
                unit,
                {each: points[:, each] for each in some},
                f"run {number}, {subset}",
                {names[each]: given[names[each]] for each in some},
            )
            outputs = self._evaluator(fold)(sample.inputs).outputs
            found[subset] = {name: each.reshape(-1, count) for name, each in outputs.items()}
        return found


def _row_means(values: FloatArray, otherwise: FloatArray) -> FloatArray:
    """Return the means over the draws of each run; another value for a run without any."""
    is_known = np.isfinite(values)
    count = is_known.sum(axis=1)
    sums = np.where(is_known, values, 0.0).sum(axis=1)
    return np.where(count > 0, sums / np.maximum(count, 1), otherwise)


def _terms(fold: FoldFit, output: str) -> tuple[FloatArray, ...] | None:
    """Return the parts of the inputs at the runs of a fold, their mean squares, and moments."""
    forms = fold.model
    if not isinstance(forms, ClosedForms):
        return None
    if output not in fold.model.logarithms and not forms.has_closed_form(output):
        return None
    found = forms.closed_form_parts(output, fold.inputs(fold.completed))
    if found is None:
        return None
    mean, std = forms.closed_form_moments(output)
    shares = forms.closed_form_indices(output)
    return *found, shares.first * std**2, shares.total * std**2, np.array([mean, std])


def _event(limit: float) -> Function:
    """Return a function for the event that an output exceeds a value; NaN for an output of NaN."""
    return lambda values: np.where(np.isnan(values), np.nan, values > limit)
