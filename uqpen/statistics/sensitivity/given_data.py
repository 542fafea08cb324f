"""First-order indices from any sample of the joint distribution."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import OF_FIELD
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import DistanceShape, ErrorModel, Sample, SampleShape
from uqpen.statistics.sensitivity.input_measures import (
    function_array,
    input_array,
    input_place_array,
    output_functions,
    reason_of_input,
)
from uqpen.statistics.sensitivity.local_regression import RegressionBins, ResidualVariance
from uqpen.statistics.standard_errors import standard_error

# A variable over runs, and the share of its variance that an input explains.

# Three bins: with fewer, a curved mean cannot be distinguished from noise.
_FEWEST_RUNS = 48
# An error below this, in standard deviations of the output, is that of rounding.
_ROUNDING = 1e-12
# Below this, the part that a jump hides in a bin is small compared with the error.
_LARGE = 0.5
# Above this, the residuals may come from the lines alone. For an output equal to one input, they
# were 1e-8 to 1e-3 of the variance, and the interval contained 1 in 0 to 84 % of the seeds.
_NEARLY_ALL = 0.995


@dataclass(frozen=True, eq=False)
class VarianceParts:
    """Variance of a variable, and the part of it that an input does not explain."""

    total: FloatArray  # (...): the variance
    left: FloatArray  # (...): its part about the lines of the input's bins
    squares: FloatArray  # (..., run): influence of each run on `total`, but for a constant
    left_influence: FloatArray  # (..., run): the same on `left`
    # (...): the part of the error of `left` from the products of pairs of runs.
    pair_noise: FloatArray


@dataclass(frozen=True)
class SampledVariable:
    """A variable over runs, and the interval of the share of its variance that an input explains.

    At places of a field it is a variable at each of them, and its numbers are arrays of shape
    (place,).
    """

    sample: Sample  # its values, of shape (run,) or (place, run)
    # True if the output that it derives from may have a heavy tail.
    has_doubtful_source: bool = False
    is_event: bool = False  # true if it is the indicator (0 or 1) of an event
    is_distance: bool = False  # true if its values are distances from a mean
    # True if they are of curves that end: the noise of pairs is then counted twice.
    has_ends: bool = False

    @cached_property
    def shape(self) -> SampleShape:
        """The shape of its tail."""
        return DistanceShape(self.sample) if self.is_distance else self.sample.shape

    @property
    def too_few_runs(self) -> str:
        """Reason why so few runs give no index; empty where there are enough."""
        if self.sample.size >= _FEWEST_RUNS:
            return ""
        # All places exist in the same runs, so that their number may be stated.
        return replace(self.sample, values=np.zeros(self.sample.size)).too_few_runs

    @cached_property
    def standardized(self) -> FloatArray:
        """Deviations from the mean, of variance 1; 0 where it is constant."""
        std = self.shape.deviations.std(axis=-1)
        return self.shape.deviations / np.where(std > 0, std, 1.0)[..., np.newaxis]

    @cached_property
    def squares(self) -> FloatArray:
        """Squares of `standardized`."""
        return self.standardized**2

    @cached_property
    def variance(self) -> FloatArray:
        """Variance of `standardized` about the mean of the distribution, not of the sample."""
        errors, freedom = standard_error(self.sample, self.standardized)
        return 1 + errors**2 if freedom else np.full(errors.shape, 1 + 1 / self.sample.size)

    def estimates(
        self, parts: VarianceParts, halved_shares: Callable[[BoolArray], FloatArray]
    ) -> Estimate:
        """Estimate the share of the variance that an input explains.

        Parameters
        ----------
        parts : VarianceParts
            Of the variable.
        halved_shares : callable
            Returns the shares that bins of half the size explain, at the places of a mask.
        """
        ratio = parts.left / parts.total
        if reason := self.sample.reason_without_intervals or self._reason_without_bounds:
            return Estimate.without_bounds(1 - ratio, reason)
        influence = ratio[..., np.newaxis] * parts.squares
        influence -= parts.left_influence
        influence /= parts.total[..., np.newaxis]
        error, freedom = standard_error(self.sample, influence)
        # Leaving out runs, or replicates, counts the noise of pairs of runs twice.
        noise, is_uncertain = (parts.pair_noise / parts.total) ** 2, self.shape.is_uncertain
        variance = np.maximum(np.where(is_uncertain, error**2, error**2 - noise), noise)
        half = student_quantile(freedom, self.sample.level) * np.sqrt(variance)
        value, upper = 1 - ratio, np.minimum(1 - ratio + half, 1.0)
        has_bounds = variance > _ROUNDING**2
        # In its bin, a jump along the input may hide a part of such an index.
        is_large = has_bounds & (value >= _LARGE) & (value <= _NEARLY_ALL)
        if is_large.any():
            hidden = np.zeros(value.shape)
            hidden[is_large] = np.maximum(halved_shares(is_large) - value[is_large], 0.0)
            upper = np.minimum(upper + 2 * hidden, 1.0)
        is_all = value > _NEARLY_ALL
        is_wider = is_uncertain | is_all | self.has_ends
        is_wider |= self.sample.error_model is ErrorModel.REPLICATED
        tail = self.shape.tail_note
        if self.shape.hidden_tail:
            tail = texts.ONLY_RUNS.format(runs=self.sample.size)
        doubt = np.where(self._is_doubtful, texts.DOUBTFUL_TAIL, "").astype(object)
        found = Estimate(
            value,
            value - half,
            np.where(is_all, 1.0, upper),
            texts.DELTA_METHOD.format(error_model=self.sample.error_model),
            np.where(is_wider, "conservative", "nominal").astype(object),
            np.where(is_uncertain, texts.DOUBTFUL_AS.format(reason=tail), doubt),
        )
        return found.remove_bounds_at(~has_bounds, texts.NO_SCATTER_OF_RUNS)

    @property
    def _is_doubtful(self) -> BoolArray:
        if self.is_event:
            # It has no tail that could be hidden.
            return np.zeros(self.sample.values.shape[:-1], dtype=np.bool_)
        # A logarithm shows less of a tail than the output does. Where 1 000 runs of the concrete
        # study showed none in it, the largest index was covered in 78 %.
        may_hide = self.has_doubtful_source & self.shape.has_few_effective_runs
        return self.shape.is_doubtful | may_hide

    @property
    def _reason_without_bounds(self) -> str:
        if self.sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET and self.sample.optimized_by:
            return texts.OPTIMIZED_POINTS
        if self.is_event and not has_enough_runs_around(self.sample, self.sample.values.sum()):
            return texts.TOO_ONE_SIDED
        return ""


# Shares of the variance of variables that inputs explain, by local regression over any sample.

# Hears an input's number, the lines of the bins through a field, and the parts about them.
Listener = Callable[[int, ResidualVariance, VarianceParts], None]


@dataclass(frozen=True)
class LocalRegressions:
    """The runs of a sample, put together by each of their inputs.

    Variables over these runs have the bins of the inputs in common.
    """

    sample: Sample

    def bins(self, column: int, *, halved: bool = False) -> RegressionBins:
        """Return the bins of an input, or these cut into two; all outputs have them in common."""
        return self.sample.run_inputs.once(
            ("bins", self.sample.error_model, column, halved),
            lambda: RegressionBins.from_sample(self.sample, column, halved=halved),
        )

    def indices(self, variable: SampledVariable, listener: Listener | None = None) -> Estimate:
        """Estimate the index of each input, along a further axis behind that of places.

        Parameters
        ----------
        variable : SampledVariable
        listener : callable, optional
            Called with each input that varies, and its lines and parts.
        """
        inputs = range(len(self.sample.inputs))
        columns = [self._input_indices(variable, column, listener) for column in inputs]
        return self.with_note(Estimate.stacked(columns))

    def with_note(self, found: Estimate) -> Estimate:
        """Return indices with a note on the dependence of the inputs, where there is one."""
        return found.with_note(texts.INCLUDES_CORRELATION if self.sample.dependence else "")

    def _input_indices(
        self, variable: SampledVariable, column: int, listener: Listener | None
    ) -> Estimate:
        nothing = np.full(variable.sample.values.shape[:-1], np.nan)
        if variable.too_few_runs:
            return Estimate.without_bounds(nothing, variable.too_few_runs)
        if reason := reason_of_input(self.sample, column):
            found = Estimate.without_bounds(nothing, reason)
        else:
            lines = ResidualVariance(self.bins(column), variable.standardized)
            left, squares = lines.variance, variable.squares
            parts = VarianceParts(
                variable.variance, left, squares, lines.influence, lines.pair_noise
            )
            if listener:
                listener(column, lines, parts)
            found = variable.estimates(parts, partial(self.halved_shares, variable, column))
        constant = texts.CONSTANT_EVENT if variable.is_event else texts.CONSTANT_OUTPUT
        none = Estimate.without_bounds(nothing, constant)
        return found.replace_at(variable.sample.is_constant, none)

    def halved_shares(self, variable: SampledVariable, column: int, rows: BoolArray) -> FloatArray:
        """Return the shares that bins of half the size explain, at some places."""
        values = variable.standardized
        chosen = values if values.ndim == 1 else values[rows]
        lines = ResidualVariance(self.bins(column, halved=True), chosen)
        return np.atleast_1d(1 - lines.variance / variable.variance[rows])


def first_order(sample: Sample, quantity: QuantityOfInterest) -> Iterator[tuple[str, xr.DataArray]]:
    """First-order indices: share of an output's variance that an input explains by itself.

    Yields
    ------
    name : str
        ``first_order``; ``log_first_order``, of the logarithm, where all values are positive;
        ``exceedance_first_order``, of the event that a threshold is exceeded, where thresholds are
        requested. For a categorical output, ``category_first_order`` alone.
    estimate : DataArray
        Along ``input`` and ``bound``; ``exceedance_first_order`` first along ``threshold``,
        ``category_first_order`` first along ``category``.
    """
    if not sample.inputs:
        return
    regressions = LocalRegressions(sample)
    is_positive = sample.size > 0 and bool(sample.values.min() > 0)
    is_doubtful = not quantity.output.categories and bool(sample.shape.is_doubtful)
    for function in output_functions(quantity, has_logarithm=is_positive):
        rows = []
        for row in function.rows:  # of many thresholds, the runs are in memory once
            values = row(sample.values)
            own = sample if values is sample.values else replace(sample, values=values)
            variable = SampledVariable(own, is_doubtful, is_event=bool(function.events))
            rows.append(regressions.indices(variable))
        name = _indices_name(function.title, sample)
        array = function_array(rows, function, sample.inputs, name, sample.level)
        yield f"{function.prefix}first_order", array


def event_first_order(sample: Sample, occurs: BoolArray) -> list[Estimate]:
    """Return the first-order index of each input, of whether an event occurs in the runs.

    Parameters
    ----------
    sample : Sample
        The runs in which the event is known.
    occurs : ndarray of bool, shape (run,)
    """
    if sample.weights is not None or not sample.size:
        reason = sample.reason_without_intervals or texts.NO_RUN
        if sample.weights is not None:
            reason = texts.NOT_WEIGHTED
        return [Estimate.without_bounds(math.nan, reason) for _ in sample.inputs]
    own = replace(sample, values=occurs.astype(np.float64))
    return LocalRegressions(own).indices(SampledVariable(own, is_event=True)).each()


def _indices_name(title: str, sample: Sample) -> str:
    """Return the meaning of the first-order indices of a variable over a sample."""
    name = f"first-order Sobol' indices of {title}"
    return f"{name}, {texts.INCLUDES_CORRELATION}" if sample.dependence else name


# The same at each place of a field, and of the field as a whole.

# Values that go through an input together: few enough for the cache of a processor.
_VALUES_TOGETHER = 2**18


def first_order_at_places(
    sample: FieldSample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """First-order indices of a field: at each place, and weighted by the variance over all places.

    A field has no indices of its logarithm or of events.

    Yields
    ------
    name : str
        ``first_order``; ``generalized_first_order``, the share of the field's variance, which is
        the mean over its places.
    estimate : DataArray
        Along the dimensions of the field, ``input`` and ``bound``; the generalized ones along
        ``input`` and ``bound``.

    References
    ----------
    Lamboni, M., Monod, H. & Makowski, D. (2011). Reliab. Eng. Syst. Saf. 96, 450-459.
    Gamboa, F., Janon, A., Klein, T. & Lagnoux, A. (2014). Electron. J. Stat. 8, 575-603.
    """
    inputs, level = sample.runs.inputs, sample.runs.level
    if not inputs:
        return
    sums = [_InputSums(*np.zeros((3, sample.runs.size))) for _ in inputs]
    places = Estimate.joined(
        (part.places, part.regressions.indices(part.variable, partial(_add_places, sums, part)))
        for part in _parts(sample)
    )
    title = _indices_name(quantity.output.title, sample.runs)
    yield "first_order", input_place_array(places, quantity.output, inputs, title, level)
    first = places[0].each()
    generalized = [
        _generalized_index(sample, column, own) if own.variance > 0 else first[column]
        for column, own in enumerate(sums)
    ]
    array = input_array(generalized, inputs, f"generalized {title}", level=level)
    yield f"{OF_FIELD}first_order", array


@dataclass(eq=False)
class _InputSums:
    """Sums over the places of a field, each with its weight, about the lines of one input."""

    squares: FloatArray  # (run,): squared distances of the runs from the mean of the field
    influence: FloatArray  # (run,): influence of each run on `variance`, of mean 0
    left_influence: FloatArray  # (run,): the same on `left`
    variance: float = 0.0  # of the field
    left: float = 0.0  # its part that the input does not explain
    # (bin, slot, slot): pair products.
    products: FloatArray = field(default_factory=lambda: np.zeros(1))


@dataclass(frozen=True, eq=False)
class _Part:
    """Places of a field that go through an input together."""

    places: IntArray  # (place,): by their positions in the field, flattened
    runs: IntArray  # (run,): the runs in which they exist, by their positions in the field
    regressions: LocalRegressions  # of these runs
    variable: SampledVariable  # the values at each place
    weights: FloatArray  # (place,): variance at each place, times its part of the grid


def _parts(sample: FieldSample) -> Iterator[_Part]:
    """Yield the places of a field, a few at a time."""
    # Squares of values over their range do not overflow.
    values = sample.matrix[np.isfinite(sample.matrix)]
    unit = float(np.ptp(values)) if values.size else 0.0
    whole = LocalRegressions(sample.runs) if sample.exists.all() else None
    for group in sample.samples():
        regressions = whole or LocalRegressions(group.runs)
        runs = np.flatnonzero(sample.exists[:, group.places[0]])
        size = max(_VALUES_TOGETHER // max(group.runs.size, 1), 1)
        for start in range(0, len(group.places), size):
            places = group.places[start : start + size]
            values = group.runs.values[start : start + size]
            variable = SampledVariable(replace(group.runs, values=values))
            weights = np.zeros(len(places))
            if not variable.too_few_runs:
                weights = sample.weights[places] * (variable.shape.std / (unit or 1.0)) ** 2
            yield _Part(places, runs, regressions, variable, weights)


def _add_places(
    sums: list[_InputSums], part: _Part, column: int, lines: ResidualVariance, parts: VarianceParts
) -> None:
    """Add places that exist in some of the runs to the sums of an input."""
    own, runs, weights = sums[column], part.runs, part.weights
    own.variance += float((weights * parts.total).sum())
    own.left += float((weights * parts.left).sum())
    squares, left = (
        np.einsum("v,vr->r", weights, each) for each in (parts.squares, parts.left_influence)
    )
    # A mean over a part of the runs: the others have no influence on it.
    fold = len(own.squares) / len(squares)
    if fold == 1:
        own.products = own.products + lines.pair_products(weights)
    own.squares[runs] += squares
    own.influence[runs] += fold * (squares - squares.mean())
    own.left_influence[runs] += fold * (left - left.mean())


def _generalized_index(sample: FieldSample, column: int, sums: _InputSums) -> Estimate:
    """Estimate the share of the variance of a whole field that an input explains."""
    regressions = LocalRegressions(sample.runs)
    has_ends = not sample.exists.all()
    # Where curves end, the bins of places differ, and the noise of pairs is counted twice.
    noise = 0.0 if has_ends else regressions.bins(column).pair_noise(sums.products)
    total, left, noise_of_pairs = map(np.asarray, (sums.variance, sums.left, noise))
    parts = VarianceParts(total, left, sums.influence, sums.left_influence, noise_of_pairs)

    def halved_share(_: BoolArray) -> FloatArray:
        explained = 0.0
        for part in _parts(sample):
            if not part.variable.too_few_runs:
                everywhere = np.ones(len(part.places), dtype=np.bool_)
                shares = part.regressions.halved_shares(part.variable, column, everywhere)
                explained += float((part.weights * part.variable.variance * shares).sum())
        return np.array([explained / sums.variance])

    distances = replace(sample.runs, values=np.sqrt(sums.squares))
    variable = SampledVariable(distances, is_distance=True, has_ends=has_ends)
    return regressions.with_note(variable.estimates(parts, halved_share))
