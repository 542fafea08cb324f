"""Statistics of a surrogate, each corrected by real runs as far as intervals are known to cover."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    BOUND,
    EQUIVALENT_RUNS,
    ESTIMATOR,
    INPUT,
    INTERVAL_LEVEL,
    NOTE,
    OF_EXCEEDANCE,
    OF_LOGARITHM,
    OF_MEAN,
    RANK,
    REFINED_FOR,
    REPEAT,
    REPLICATE,
    ROUND,
    RUN,
    SAMPLING,
    SENSITIVITY,
    STATUS,
    STOPPING_STATISTICS,
    SURROGATE_ESTIMATE,
    WEIGHT,
)
from uqpen.core.lookup import resolve
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.execution import first_repeats, mean_repeats, repeats_of
from uqpen.statistics import texts
from uqpen.statistics.analyze import (
    OutputStatistics,
    analyze,
    analyze_repeats,
    in_catalogue_order,
)
from uqpen.statistics.estimate import LEVEL, Estimate
from uqpen.statistics.intervals import equivalent_runs
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.statistics.stopped_runs import mark_uncertified
from uqpen.statistics.surrogate.corrected_cdf import CorrectedCdf
from uqpen.statistics.surrogate.corrected_indices import (
    FIRST_ORDER,
    TOTAL_ORDER,
    IndexedVariable,
    IndexedVariables,
    corrected_event_indices,
    corrected_indices,
)
from uqpen.statistics.surrogate.corrected_moments import (
    CorrectedMoments,
    quantile_estimates,
    quantile_probabilities,
)
from uqpen.statistics.surrogate.correction_runs import CorrectionRuns, FoldFit
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.surrogates.field_surrogate import FieldSurrogate
from uqpen.surrogates.fitted_surrogate import ClosedForms
from uqpen.surrogates.fitting import CrossFit

# Corrected estimates of one output, by the names of their statistics.

# The beginning of their names, and their kind.
_INDICES = {
    f"{prefix}{kind}": (prefix, kind)
    for prefix in ("", OF_LOGARITHM, OF_MEAN, OF_EXCEEDANCE)
    for kind in (FIRST_ORDER, TOTAL_ORDER)
}

# With fewer runs on a side, an event has no interval of its variance.
FEWEST_ON_A_SIDE = 10


@dataclass(frozen=True)
class OutputCorrection:
    """Real runs of one output, with its statistics."""

    runs: CorrectionRuns
    # By the beginning of the names of their indices.
    indexed: Mapping[str, tuple[IndexedVariable, ...]]
    quantity: QuantityOfInterest

    @staticmethod
    def problem(name: str) -> str:
        """Return why a statistic keeps the surrogate's own figures; empty if it is corrected."""
        is_known = name in CATALOGUE and "corrected" in CATALOGUE[name].by
        return "" if is_known else texts.NO_CORRECTION

    def own_problem(self, name: str) -> str:
        """Return why the surrogate's own figures of a statistic say too little; empty if not.

        It has to explain a share of the variance of the runs: of the logarithm for what is of that,
        and else of the output.
        """
        of_logarithm = self.indexed.get(OF_LOGARITHM, ()) if name.startswith(OF_LOGARITHM) else ()
        q2 = next((each.runs.q2_of_mean for each in of_logarithm), self.runs.q2_of_mean)
        if q2 >= _LEAST_Q2:
            return ""
        explained = texts.EXPLAINS_TOO_LITTLE.format(share=100 * max(q2, 0.0))
        return texts.TOO_LITTLE_ALONE.format(explained=explained)

    def estimates(self, name: str, array: xr.DataArray) -> list[Estimate]:
        """Return the corrected estimates of a statistic without a `problem`, and not of indices.

        The surrogate's own estimate array has what they are of.
        """
        found: Estimate = resolve(CATALOGUE[name].by["corrected"])(self, array)
        return self._with_notes(found.each())

    def indices(self, name: str) -> list[list[Estimate] | str]:
        """Return the corrected indices of each variable that a name has, or why there are none."""
        prefix, kind = _INDICES[name]
        return [
            self._index_problem(each, kind) or self._with_notes(self._indices(each, kind))
            for each in self.indexed[prefix]
        ]

    def _with_notes(self, found: list[Estimate]) -> list[Estimate]:
        """Return estimates with what holds of all intervals."""
        missing, placed = self.runs.missing, self.runs.placed
        notes = (
            texts.OF_ALL_ADMISSIBLE.format(missing=missing) if missing else "",
            texts.OF_PLACED_RUNS.format(placed=placed) if placed else "",
        )
        return [each if each.label == "none" else each.with_note(*notes) for each in found]

    # Estimates of statistics, to which their records in the catalogue refer.

    def mean(self, array: xr.DataArray) -> Estimate:
        """Return the mean."""
        return self._of_points(self._moments.mean())

    def std(self, array: xr.DataArray) -> Estimate:
        """Return the standard deviation."""
        return self._of_points(self._moments.std())

    def half_spread(self, array: xr.DataArray) -> Estimate:
        """Return half the 16 % to 84 % range."""
        value, lower, upper = self.cdf.half_spread()
        if math.isnan(upper - lower):
            too_few = texts.TOO_FEW_RUNS.format(runs=self.runs.size)
            return Estimate.without_bounds(value, too_few)
        return Estimate(value, lower, upper, texts.CORRECTED_TWO_WOODRUFF, "conservative")

    def exceedance(self, array: xr.DataArray) -> Estimate:
        """Return the probabilities of exceeding the thresholds."""
        return self.cdf.above(_values(self.quantity.thresholds))

    def below(self, array: xr.DataArray) -> Estimate:
        """Return the probabilities of lying below the thresholds."""
        return self.cdf.below(_values(self.quantity.lower_thresholds))

    def at_ranks(self, array: xr.DataArray) -> Estimate:
        """Return the distribution function at its corrected quantiles."""
        return self.cdf.at(self.cdf.quantile(array[RANK].values)[0])

    def quantiles(self, array: xr.DataArray) -> Estimate:
        """Return quantiles at the probabilities of an estimate array."""
        value, lower, upper = self.cdf.quantile(quantile_probabilities(array))
        found = quantile_estimates(value, lower, upper, texts.CORRECTED_WOODRUFF, self.runs.size)
        too_few = texts.TOO_FEW_RUNS.format(runs=self.runs.size)
        return found.remove_bounds_at(np.isnan(lower) & np.isnan(upper), too_few)

    @cached_property
    def cdf(self) -> CorrectedCdf:
        """The corrected distribution function."""
        return CorrectedCdf(self.runs)

    @cached_property
    def _moments(self) -> CorrectedMoments:
        return CorrectedMoments(self.runs)

    def _index_problem(self, variable: IndexedVariable, kind: str) -> str:
        """Return why the indices of a variable keep the surrogate's own figures; empty if not."""
        if reason := variable.reasons.get(kind, ""):
            return reason
        if variable.is_event:
            values = variable.runs.values
            on_a_side = min((values == side).sum() for side in (0, 1))
            return "" if on_a_side >= FEWEST_ON_A_SIDE else texts.TOO_ONE_SIDED
        moments = self._moments_of(variable)
        if variable.is_of_mean:
            of_mean = moments.variance_of_mean
            is_hidden = of_mean.value <= of_mean.half_width(self.runs.level)
            return moments.heavy_tail or (texts.NOISE_HIDES_IT if is_hidden else "")
        has_variance = moments.variance.value > 0
        return moments.heavy_tail or ("" if has_variance else texts.NO_VARIANCE_LEFT)

    def _indices(self, variable: IndexedVariable, kind: str) -> list[Estimate]:
        runs, parts = variable.runs, variable.parts[kind]
        if variable.is_event:
            return list(corrected_event_indices(runs, parts))
        moments = self._moments_of(variable)
        of_mean = variable.is_of_mean
        variance = moments.variance_of_mean if of_mean else moments.variance
        return [self._of_points(each) for each in corrected_indices(runs, parts, variance)]

    def _of_points(self, found: Estimate) -> Estimate:
        """Return an estimate that takes all repeats of a point, in words where there are any."""
        if self.runs.repeats is None or found.label == "none":
            return found
        return found.with_method(texts.CLUSTERS)

    def _moments_of(self, variable: IndexedVariable) -> CorrectedMoments:
        runs = variable.runs
        return self._moments if runs is self.runs else CorrectedMoments(runs)


def is_index(name: str) -> bool:
    """Check whether runs may correct a statistic as indices of one or of several variables."""
    return name in _INDICES


def _values(thresholds: Sequence[Threshold]) -> FloatArray:
    return np.array([each.value for each in thresholds])


# A surrogate that leaves more of the variance than it explains has no figure that no run corrects:
# half of a share of the variance can then be an error. Nor do the indices of the runs alone, which
# are of outputs that are smooth along an input, take its place: the output may be rougher than
# both can see, and with a useless surrogate of 100 runs they covered in 69 %.
_LEAST_Q2 = 0.5


@np.errstate(over="ignore", invalid="ignore")  # fourth powers may overflow: no interval then
def correct_statistics(
    found: Mapping[str, OutputStatistics],
    evidence: CorrectionEvidence,
    quantities: Sequence[QuantityOfInterest],
) -> dict[str, OutputStatistics]:
    """Correct the statistics of a surrogate by real runs.

    Parameters
    ----------
    found : mapping of str to mapping of str to DataArray
        By output, the surrogate's own estimate arrays.

    Returns
    -------
    dict of str to dict of str to DataArray
        Estimate arrays with the coordinates ``surrogate_estimate``, the surrogate's own figure,
        and ``equivalent_runs``, the number of plain runs whose interval would be as narrow; NaN
        where there is none. What runs cannot correct keeps its figure, with the reason, where the
        surrogate explains at least half of the variance of the runs; else it has none.

    Notes
    -----
    An interval is that of the runs alone where this is `narrower`.
    """
    wanted = {quantity.output.name: quantity for quantity in quantities}
    corrected = {
        name: _corrected(statistics, wanted[name], evidence) for name, statistics in found.items()
    }
    if not evidence.has_own_number:
        return corrected
    return mark_uncertified(corrected, {STOPPING_STATISTICS: "[]"})


def _corrected(
    statistics: OutputStatistics, quantity: QuantityOfInterest, evidence: CorrectionEvidence
) -> OutputStatistics:
    """Return the statistics of one output."""
    output = quantity.output.name
    if reason := evidence.reasons.get(output, ""):
        return {name: _uncorrected(name, array, reason) for name, array in statistics.items()}
    correction = OutputCorrection(evidence.runs[output], evidence.indexed[output], quantity)
    plain = evidence.plain[output]
    found = {}
    if correction.runs.repeats is not None:
        statistics = in_catalogue_order(statistics | _of_mean(statistics))
    for name, array in statistics.items():
        if RANK in array.dims:
            found[name] = _at_ranks(name, array, correction, plain.get(name))
        elif is_index(name):
            found[name] = _at_inputs(name, array, correction, plain.get(name))
        elif reason := correction.problem(name):
            found[name] = _uncorrected(name, array, reason, correction.own_problem(name))
        else:
            estimates = correction.estimates(name, array)
            estimates = _narrower_ones(estimates, plain.get(name), correction, is_index=False)
            own = array.values[..., 0]
            found[name] = _with_estimates(array, estimates, own, correction, plain.get(name))
    return found


def _of_mean(statistics: OutputStatistics) -> OutputStatistics:
    """Return the surrogate's own indices as those of the mean given the inputs, which it learns."""
    return {
        name: statistics[kind].assign_attrs(
            long_name=f"{statistics[kind].attrs['long_name']}, of its mean given the inputs"
        )
        for name, (prefix, kind) in _INDICES.items()
        if prefix == OF_MEAN and kind in statistics
    }


def _at_ranks(
    name: str, array: xr.DataArray, correction: OutputCorrection, plain: xr.DataArray | None
) -> xr.DataArray:
    """Return a statistic of the distribution function, at its corrected quantiles."""
    values, _, _ = correction.cdf.quantile(array[RANK].values)
    if BOUND not in array.dims:
        return array.copy(data=values)
    estimates = correction.estimates("cdf", array)
    if correction.problem(name):
        estimates = [Estimate.without_bounds(each.value, texts.NO_BAND_KNOWN) for each in estimates]
    share = correction.cdf.surrogate_share(values)
    return _with_estimates(array, estimates, share, correction, plain)


def _at_inputs(
    name: str, array: xr.DataArray, correction: OutputCorrection, plain: xr.DataArray | None
) -> xr.DataArray:
    """Return the indices of one variable, or of several, each corrected if that is possible."""
    found = correction.indices(name)
    inputs, problem = array.sizes[INPUT], correction.own_problem(name)
    figures = _own_figures(array)
    estimates: list[Estimate] = []
    for start, indices in zip(range(0, len(figures), inputs), found, strict=True):
        reason = indices if isinstance(indices, str) else ""
        of_variable = figures[start : start + inputs]
        own = _own_estimates(name, of_variable, reason, problem if reason else "")
        if isinstance(indices, str):
            estimates += own
        else:
            estimates += [each.with_note(old.note) for each, old in zip(indices, own, strict=True)]
    estimates = _narrower_ones(estimates, plain, correction, is_index=True)
    own_values = array.values[..., 0]
    if all(isinstance(each, str) for each in found):
        none = np.full(own_values.shape, math.nan)
        return _corrected_array(array, estimates, none if problem else own_values, none)
    return _with_estimates(array, estimates, own_values, correction, plain)


def _uncorrected(name: str, array: xr.DataArray, reason: str, problem: str = "") -> xr.DataArray:
    """Return the surrogate's own figures without bounds; what is no number keeps its reason.

    With a problem, there are none.
    """
    if BOUND not in array.dims:
        return array
    own = np.full(array.shape[:-1], math.nan) if problem else array.values[..., 0]
    found = _own_estimates(name, _own_figures(array), reason, problem)
    return _corrected_array(array, found, own, np.full(own.shape, math.nan))


def _own_figures(array: xr.DataArray) -> list[tuple[float, str]]:
    """Return the surrogate's own figures of an estimate array, each with its note."""
    values, notes = array.values[..., 0], array.coords[NOTE].values
    return [*zip(values.ravel().tolist(), map(str, notes.ravel()), strict=True)]


def _own_estimates(
    name: str, figures: Sequence[tuple[float, str]], reason: str, problem: str
) -> list[Estimate]:
    """Return the surrogate's own figures as estimates without bounds; none with a problem."""
    keeps_note = name in CATALOGUE and CATALOGUE[name].note_is_of_estimate
    found = []
    for value, note in figures:
        if problem and not math.isnan(value):
            found.append(Estimate.without_bounds(math.nan, problem))
            continue
        reasons = (note,) if math.isnan(value) else (reason, note if keeps_note else "")
        found.append(Estimate.without_bounds(value, *reasons))
    return found


def narrower(found: Estimate, plain: Estimate, runs: CorrectionRuns, *, is_index: bool) -> Estimate:
    """Return a corrected estimate, with the interval of the runs alone where this is narrower.

    That interval has to hold the corrected estimate: else the two contradict each other, and the
    wider one stays. A surrogate that explains nothing has nothing to correct, so that the interval
    is that of the runs alone without a look at widths. Indices keep theirs if the surrogate
    explains less than half. So does all that missing runs or placed ones correct: the runs alone
    are then of another distribution, or fewer.

    Parameters
    ----------
    found, plain : Estimate
        The corrected one, and that of the runs alone.
    is_index : bool
        Whether they are of a sensitivity index.
    """
    width, plain_width = found.upper - found.lower, plain.upper - plain.lower
    is_other = bool(runs.missing or runs.placed) or math.isnan(plain_width)
    if is_other or "none" in (found.label, plain.label):
        return found
    is_narrower = math.isnan(width) or plain_width < width
    if is_index and is_narrower and runs.q2 < _LEAST_Q2:
        explained = texts.EXPLAINS_TOO_LITTLE.format(share=100 * max(runs.q2, 0.0))
        return found.with_note(texts.NARROWER_IF_SMOOTH, explained)
    if not is_narrower and (is_index or runs.q2 > 0):
        return found
    if not plain.lower <= found.value <= plain.upper:
        return found.with_note(texts.NARROWER_ELSEWHERE) if is_narrower else found
    notes = dict.fromkeys(("" if math.isnan(width) else found.note, plain.note))
    taken = replace(plain, value=found.value, note="")
    return taken.with_note(*notes, texts.OF_RUNS_ALONE)


def _narrower_ones(
    estimates: Sequence[Estimate],
    plain: xr.DataArray | None,
    correction: OutputCorrection,
    *,
    is_index: bool,
) -> list[Estimate]:
    """Return estimates, each with the interval of the runs alone where this is narrower."""
    if plain is None or plain.size != 3 * len(estimates):
        return list(estimates)
    alone = Estimate.from_array(plain).each()
    pairs = zip(estimates, alone, strict=True)
    return [narrower(each, other, correction.runs, is_index=is_index) for each, other in pairs]


def _with_estimates(
    array: xr.DataArray,
    estimates: Sequence[Estimate],
    own: FloatArray,
    correction: OutputCorrection,
    plain: xr.DataArray | None,
) -> xr.DataArray:
    """Return corrected estimates as the estimate array of a statistic."""
    runs, placed = correction.runs.size, correction.runs.placed
    estimator = texts.CORRECTED_BY.format(estimator=array.attrs[ESTIMATOR], runs=runs)
    if placed:
        estimator += texts.PLACED_AMONG.format(placed=placed)
    found = array.assign_attrs({ESTIMATOR: estimator})
    return _corrected_array(found, estimates, own, _equivalent_runs(estimates, plain))


def _equivalent_runs(estimates: Sequence[Estimate], plain: xr.DataArray | None) -> FloatArray:
    """Return how many plain runs would give intervals as narrow, NaN where that is unknown."""
    width = np.array([estimate.upper - estimate.lower for estimate in estimates])
    if plain is None or plain.size != 3 * width.size:
        return np.full(width.shape, math.nan)
    _, lower, upper = plain.values.reshape(-1, 3).T
    return equivalent_runs(width, upper - lower, int(plain.attrs["runs_used"]))


def _corrected_array(
    array: xr.DataArray, estimates: Sequence[Estimate], own: FloatArray, equivalent: FloatArray
) -> xr.DataArray:
    """Return an estimate array with other estimates, and what stands beside them."""
    stacked = Estimate.stacked(estimates)
    has_level = array.ndim > 1 or stacked.has_bounds.any()
    level = float(array.attrs.get(INTERVAL_LEVEL, LEVEL)) if has_level else None
    beside = {SURROGATE_ESTIMATE: own, EQUIVALENT_RUNS: equivalent}
    return stacked.in_place_of(array, level=level, **beside)


# Evidence on the errors of a surrogate: real runs, with predictions that have not seen them.

# By the beginning of the names of their indices: those of exceedance are one for each threshold.
Indexed = Mapping[str, tuple[IndexedVariable, ...]]

# The first of each set of the surrogate's quasi-random draws: every fold's fit is evaluated there,
# and the error that they leave is a part of the interval.
_DRAWS_OF_SET = 1024

# Fewer runs have no meaningful scatter.
_FEWEST_RUNS = 10


@dataclass(frozen=True, eq=False)
class CorrectionEvidence:
    """Evidence on the errors of a surrogate."""

    runs: Mapping[str, CorrectionRuns]  # by scalar output
    reasons: Mapping[str, str]  # the reason why nothing corrects each other output
    # By output and by the beginning of their names, what indices follow from.
    indexed: Mapping[str, Indexed] = field(default_factory=dict)
    # Estimates of the runs of one design alone, before a surrogate placed any, for comparison.
    plain: Mapping[str, OutputStatistics] = field(default_factory=dict)
    has_own_number: bool = False  # true if runs decided their own number


def correction_evidence(
    draws: SurrogateDraws,
    folds: CrossFit,
    training: xr.Dataset,
    check: xr.Dataset | None,
    quantities: Sequence[QuantityOfInterest],
    only: Collection[str] | None = None,
) -> CorrectionEvidence:
    """Collect the runs that correct a surrogate.

    Parameters
    ----------
    folds : CrossFit
        The fits without a fold each.
    training, check : Dataset
        Runs of the design that it was fitted to, and of another one, if there is one. Where the
        first repeats its points and the other does not, the check runs correct nothing besides.
    only : collection of str, optional
        Keys of the analyses whose statistics are corrected; all by default.
    """
    fitted = {output.name for output in draws.model.outputs}
    wanted = [each for each in quantities if each.output.name in fitted and not each.output.dims]
    used = [training] if folds.models else []
    points = mean_repeats(training)
    parts = [
        FoldFit.of(fit, points.isel({RUN: np.flatnonzero(folds.fold == number)}))
        for number, fit in enumerate(folds.models)
    ]
    knows_noise = REPEAT in training.coords if used else True
    # Other check runs are no draws of the distribution of the inputs.
    drawn = (Sampling.INDEPENDENT, Sampling.STRATIFIED)
    if (
        check is not None
        and Sampling(check.attrs[SAMPLING]) in drawn
        and WEIGHT not in check.coords
        and not (used and knows_noise and REPEAT not in check.coords)
    ):
        used.append(check)
        of_points = mean_repeats if knows_noise else first_repeats
        parts.append(FoldFit.of(draws.model, of_points(check)))
    if not used or not wanted:
        reason = folds.reason or texts.NO_CORRECTING_RUN
        return CorrectionEvidence({}, {each.output.name: reason for each in wanted})
    scalars = draws.model.scalars if isinstance(draws.model, FieldSurrogate) else draws.model
    collected = _Collected(replace(draws, model=scalars), parts)
    reasons = {each.output.name: collected.problem(each.output.name) for each in wanted}
    runs = {
        each.output.name: collected.runs(each) for each in wanted if not reasons[each.output.name]
    }
    has_indices = only is None or SENSITIVITY in only
    return CorrectionEvidence(
        runs,
        {name: reason for name, reason in reasons.items() if reason},
        {
            name: collected.variables.of_output(each, runs[name]) if has_indices else {}
            for each in wanted
            if (name := each.output.name) in runs
        },
        _alone(used[0], wanted, only),
        any(STOPPING_STATISTICS in each.attrs for each in used),
    )


def _alone(
    runs: xr.Dataset, quantities: Sequence[QuantityOfInterest], only: Collection[str] | None
) -> Mapping[str, OutputStatistics]:
    """Return the statistics of runs alone."""
    found = analyze(_first_draws(first_repeats(runs)), quantities, only=only)
    of_all = analyze_repeats(runs, quantities)
    return {name: each | of_all.get(name, {}) for name, each in found.items()}


def _first_draws(runs: xr.Dataset) -> xr.Dataset:
    """Return the runs before a surrogate placed any."""
    if REFINED_FOR not in runs.attrs or ROUND not in runs.coords:
        return runs
    first = np.flatnonzero(runs[ROUND].values == 0)
    return runs.isel({RUN: first}).drop_vars([WEIGHT, ROUND])


@dataclass(frozen=True)
class _Collected:
    """Folds of real runs, with draws of the input distribution given admissible."""

    draws: SurrogateDraws
    folds: Sequence[FoldFit]

    @cached_property
    def _points(self) -> xr.Dataset:
        """The draws at which each fit is evaluated: the first of each set."""
        runs = self.draws.runs
        replicate = runs[REPLICATE].values
        position = np.arange(len(replicate)) - np.searchsorted(replicate, replicate)
        is_admissible = runs[STATUS].values != Status.INADMISSIBLE
        return runs.isel({RUN: np.flatnonzero(is_admissible & (position < _DRAWS_OF_SET))})

    @cached_property
    def _at_runs(self) -> list[Mapping[str, FloatArray]]:
        return [fold.predictions(fold.completed) for fold in self.folds]

    @cached_property
    def _at_missing(self) -> list[Mapping[str, FloatArray]]:
        return [fold.predictions(fold.missing) for fold in self.folds]

    @cached_property
    def _at_draws(self) -> list[Mapping[str, FloatArray]]:
        return [fold.predictions(self._points) for fold in self.folds]

    def problem(self, output: str) -> str:
        """Return why no run corrects an output; empty if some do."""
        for fold in self.folds:
            if output not in {each.name for each in fold.model.outputs}:
                reason = fold.model.reasons.get(output, "")
                return texts.NOT_FITTED_WITHOUT.format(reason=reason)
        runs = sum(fold.size for fold in self.folds)
        if runs < _FEWEST_RUNS:
            return texts.FEW_CORRECTING_RUNS.format(runs=runs)
        if np.unique(self._points[REPLICATE].values).size < 2:
            return texts.NO_ADMISSIBLE_DRAW
        if not all(np.isfinite(fold.completed[output].values).all() for fold in self.folds):
            return texts.WITHOUT_VALUE_IN_RUNS
        predicted = (*self._at_runs, *self._at_missing, *self._at_draws)
        are_finite = all(np.isfinite(each[output]).all() for each in predicted)
        return "" if are_finite else texts.NOT_FINITE_PREDICTIONS

    def runs(self, quantity: QuantityOfInterest) -> CorrectionRuns:
        """Return the runs that correct an output."""
        name = quantity.output.name
        sizes = [fold.size for fold in self.folds]
        repeats = self._repeats(name)
        if repeats is None:
            values = [fold.completed[name].values.astype(np.float64) for fold in self.folds]
        else:
            first = np.argmin(np.isnan(repeats), axis=1)
            values = [repeats[np.arange(len(repeats)), first]]
        _, replicate = np.unique(self._points[REPLICATE].values, return_inverse=True)
        return CorrectionRuns(
            np.concatenate(values),
            np.concatenate([each[name] for each in self._at_runs]),
            np.repeat(np.arange(len(sizes)), sizes),
            np.array([each[name] for each in self._at_draws]),
            replicate.astype(np.int64),
            np.concatenate([each[name] for each in self._at_missing]),
            np.repeat(np.arange(len(sizes)), [each.missing.sizes[RUN] for each in self.folds]),
            self._exact_moments(name),
            quantity.confidence_level,
            *self._weights(),
            repeats,
        )

    def _repeats(self, output: str) -> FloatArray | None:
        """Return all runs at each point, shape (run, repeat); None where they are not repeated."""
        found = [repeats_of(fold.completed, output) for fold in self.folds]
        known = [each for each in found if each is not None]
        if len(known) < len(found):
            return None
        most = max(each.shape[1] for each in known)
        padded = [
            np.pad(each, ((0, 0), (0, most - each.shape[1])), constant_values=math.nan)
            for each in known
        ]
        return np.concatenate(padded)

    def _weights(self) -> tuple[FloatArray | None, FloatArray | None]:
        """Return the weights of completed and of missing runs; None where all are 1."""
        completed, missing = (
            np.concatenate([_weights_of(part) for part in parts])
            for parts in zip(*((each.completed, each.missing) for each in self.folds), strict=True)
        )
        is_weighted = (completed != 1).any() or (missing != 1).any()
        return (completed, missing) if is_weighted else (None, None)

    def _exact_moments(self, output: str) -> FloatArray | None:
        """Return the moments of each fit where all are known without draws."""
        models = [fold.model for fold in self.folds]
        if not self.draws.all_are_admissible:
            return None
        found = [
            model.closed_form_moments(output)
            for model in models
            if isinstance(model, ClosedForms) and model.has_closed_form(output)
        ]
        return np.array(found) if len(found) == len(models) else None

    @cached_property
    def variables(self) -> IndexedVariables:
        """The variables whose indices they correct."""
        return IndexedVariables(self.draws, self.folds)


def _weights_of(runs: xr.Dataset) -> FloatArray:
    weights = runs[WEIGHT].values if WEIGHT in runs.coords else np.ones(runs.sizes[RUN])
    return np.asarray(weights, dtype=np.float64)
