"""First-order indices from any sample of the joint distribution."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import OF_CATEGORY, OF_EXCEEDANCE, OF_LOGARITHM
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.probabilities import (
    category_coordinates,
    threshold_coordinates,
)
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel, Sample, SampleShape
from uqpen.statistics.sensitivity.input_measures import event_array, input_array, reason_of_input
from uqpen.statistics.sensitivity.local_regression import Lines, RegressionBins, ResidualVariance
from uqpen.statistics.standard_errors import standard_error
from uqpen.statistics.tally import Tally

__all__ = [
    "LocalRegressions",
    "SampledVariable",
    "SharedVariance",
    "TalliedLines",
    "TalliedVariance",
    "VarianceParts",
    "event_first_order",
    "first_order",
    "indices_name",
]

# A variable over runs, and the interval of the share of its variance that an input explains.

# Three bins: with fewer, a curved mean cannot be distinguished from noise.
_FEWEST_RUNS = 48
# An error below this, in standard deviations of the output, is that of rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class SampledVariable:
    """A variable over runs, and the interval of the share of its variance that an input explains.

    At places of a field it is a variable at each of them, and its numbers are arrays of shape
    (place,).

    Parameters
    ----------
    sample : Sample
        Its values, of shape (run,) or (place, run).
    has_doubtful_source : bool
        True if the output that it derives from may have a heavy tail.
    is_event : bool
        True if it is the indicator (0 or 1) of an event.
    """

    sample: Sample
    has_doubtful_source: bool = False
    is_event: bool = False

    @cached_property
    def shape(self) -> SampleShape:
        """The shape of its tail."""
        return self.sample.shape

    @property
    def too_few_runs(self) -> str:
        """Reason why so few runs give no index; empty where there are enough."""
        if self.sample.size >= _FEWEST_RUNS:
            return ""
        # All places exist in the same runs, so that their number may be stated.
        return replace(self.sample, values=np.zeros(self.sample.size)).too_few_runs

    @property
    def text_of_constant(self) -> str:
        """Reason why no input has an index where the variable is constant."""
        return texts.CONSTANT_EVENT if self.is_event else texts.CONSTANT_OUTPUT

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
        self, value: FloatArray, error: FloatArray, freedom: float, pair_noise: FloatArray
    ) -> Estimate:
        """Return indices with their bounds.

        Leaving out runs, or replicates, counts the noise of pairs of runs twice.
        """
        if reason := self.sample.reason_without_intervals or self._reason_without_bounds:
            return Estimate.without_bounds(value, reason)
        noise, is_uncertain = pair_noise**2, self.shape.is_uncertain
        variance = np.maximum(np.where(is_uncertain, error**2, error**2 - noise), noise)
        half = student_quantile(freedom, self.sample.level) * np.sqrt(variance)
        is_wider = is_uncertain | self._is_wider
        note = np.where(self._is_doubtful, texts.DOUBTFUL_TAIL, "").astype(object)
        found = Estimate(
            value,
            value - half,
            np.minimum(value + half, 1.0),
            texts.DELTA_METHOD.format(error_model=self.sample.error_model),
            np.where(is_wider, "conservative", "nominal").astype(object),
            np.where(is_uncertain, texts.DOUBTFUL_AS.format(reason=self._warning), note),
        )
        return found.remove_bounds_at(~(variance > _ROUNDING**2), texts.NO_SCATTER_OF_RUNS)

    @property
    def _is_wider(self) -> bool:
        return self.sample.error_model is ErrorModel.REPLICATED

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
    def _warning(self) -> str:
        if self.shape.hidden_tail:
            return texts.ONLY_RUNS.format(runs=self.sample.size)
        return self.shape.tail_note

    @property
    def _reason_without_bounds(self) -> str:
        if self.sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET and self.sample.optimized_by:
            return texts.OPTIMIZED_POINTS
        if self.is_event and not has_enough_runs_around(self.sample, self.sample.values.sum()):
            return texts.TOO_ONE_SIDED
        return ""


# Share of the variance that an input explains, from sums over independent runs.


class TalliedLines(Lines, Protocol):
    """Lines through a variable that go by compiled loops."""

    def share_tally(self, ratio: float, runs: int) -> Tally:
        """Return the tally of each run's influence on the share that the input explains.

        Parameters
        ----------
        ratio : float
            Of the variance about the lines to the variance.
        runs : int
            Number of independent runs.
        """


@dataclass(frozen=True, eq=False)
class TalliedVariance:
    """Variance of a variable over independent runs, and the part about the lines of an input."""

    total: FloatArray
    lines: TalliedLines

    def estimates(self, variable: SampledVariable) -> Estimate:
        """Return the share of the variance that the input explains, with its bounds."""
        ratio = self.lines.variance / self.total
        tally = self.lines.share_tally(float(ratio), variable.sample.size)
        errors, freedom = standard_error(variable.sample, tally.scaled(1 / float(self.total)))
        return variable.estimates(1 - ratio, errors, freedom, self.lines.pair_noise / self.total)


# Shares of the variance of variables that inputs explain, by local regression over any sample.

# Below this, the part that a jump hides in a bin is small compared with the error.
_LARGE = 0.5
# Above this, the residuals may come from the lines alone. For an output equal to one input, they
# were 1e-8 to 1e-3 of the variance, and the interval contained 1 in 0 to 84 % of the seeds.
_NEARLY_ALL = 0.995


@dataclass(frozen=True, eq=False)
class VarianceParts:
    """Variance of a variable, and the part of it that an input does not explain.

    Parameters
    ----------
    total, left : ndarray, shape (...)
        The variance, and its part about the lines of the input's bins.
    squares, left_influence : ndarray, shape (..., run)
        The influence of each run on them, but for a constant.
    pair_noise : ndarray, shape (...)
        The part of the error of `left` from the products of pairs of runs.
    """

    total: FloatArray
    left: FloatArray
    squares: FloatArray
    left_influence: FloatArray
    pair_noise: FloatArray

    @classmethod
    def about(cls, lines: Lines, variable: SampledVariable) -> VarianceParts:
        """Return the parts about the lines through a variable."""
        return cls(
            variable.variance, lines.variance, variable.squares, lines.influence, lines.pair_noise
        )

    def estimates(self, variable: SampledVariable) -> Estimate:
        """Return the share of the variance that the input explains, with its bounds."""
        ratio = self.left / self.total
        influence = ratio[..., np.newaxis] * self.squares - self.left_influence
        errors, freedom = standard_error(variable.sample, influence / self.total[..., np.newaxis])
        return variable.estimates(1 - ratio, errors, freedom, self.pair_noise / self.total)


class SharedVariance(Protocol):
    """The share of a variable's variance that an input explains, and its error."""

    def estimates(self, variable: SampledVariable) -> Estimate:
        """Return the share with its bounds."""


# Hears an input's number, the lines of the bins through a field, and the parts about them.
Listener = Callable[[int, ResidualVariance, VarianceParts], None]


@dataclass(frozen=True)
class LocalRegressions:
    """The runs of a sample, put together by each of their inputs.

    Variables over these runs have the bins of the inputs in common.
    """

    sample: Sample

    @cached_property
    def inputs(self) -> range:
        """The inputs, by their numbers."""
        return range(len(self.sample.inputs))

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
        columns = [self._input_indices(variable, column, listener) for column in self.inputs]
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
        none = Estimate.without_bounds(nothing, variable.text_of_constant)
        if reason := reason_of_input(self.sample, column):
            unknown = Estimate.without_bounds(nothing, reason)
            return unknown.replace_at(variable.sample.is_constant, none)
        parts = self._parts(variable, column, listener)
        found = self.estimates(
            variable, parts, lambda rows: self.halved_shares(variable, column, rows)
        )
        return found.replace_at(variable.sample.is_constant, none)

    def _parts(
        self, variable: SampledVariable, column: int, listener: Listener | None
    ) -> SharedVariance:
        """Return the part of a variable's variance that an input explains."""
        values, is_loop = variable.standardized, self._goes_by_loops(variable.standardized)
        if is_loop and self.sample.error_model is ErrorModel.INDEPENDENT:
            tallied = self._compiled_lines(column, values, has_influence=False)
            return TalliedVariance(variable.variance, tallied)
        lines: Lines
        if is_loop:
            lines = self._compiled_lines(column, values)
        else:
            lines = ResidualVariance(self.bins(column), values)
        parts = VarianceParts.about(lines, variable)
        if listener and isinstance(lines, ResidualVariance):
            listener(column, lines, parts)
        return parts

    def halved_shares(self, variable: SampledVariable, column: int, rows: BoolArray) -> FloatArray:
        """Return the shares that bins of half the size explain, at some places."""
        values = variable.standardized
        if self._goes_by_loops(values):
            lines: Lines = self._compiled_lines(column, values, halved=True, has_influence=False)
        else:
            chosen = values if values.ndim == 1 else values[rows]
            lines = ResidualVariance(self.bins(column, halved=True), chosen)
        return np.atleast_1d(1 - lines.variance / variable.variance[rows])

    def _goes_by_loops(self, values: FloatArray) -> bool:
        """Return True if compiled loops take a variable."""
        return values.ndim == 1 and self.sample.run_inputs.are_many

    def _compiled_lines(
        self, column: int, values: FloatArray, *, halved: bool = False, has_influence: bool = True
    ) -> TalliedLines:
        """Return the lines of an input's bins through a variable, by compiled loops."""
        from uqpen.statistics.sensitivity.sorted_bins import CompiledVariance, SortedBins

        bins = self.sample.run_inputs.once(
            ("sorted bins", self.sample.error_model, column, halved),
            lambda: SortedBins.from_sample(self.sample, column, halved=halved),
        )
        return CompiledVariance.about(bins, values, has_influence=has_influence)

    def estimates(
        self,
        variable: SampledVariable,
        parts: SharedVariance,
        halved_shares: Callable[[BoolArray], FloatArray],
    ) -> Estimate:
        """Estimate the index of an input.

        Parameters
        ----------
        variable : SampledVariable
        parts : SharedVariance
            The share of its variance that the input explains.
        halved_shares : callable
            Returns the shares that bins of half the size explain, at the places of a mask.
        """
        found = parts.estimates(variable)
        # In its bin, a jump along the input may hide a part of such an index.
        large = found.has_bounds & (found.value >= _LARGE) & (found.value <= _NEARLY_ALL)
        hidden = np.zeros(found.value.shape)
        if large.any():
            hidden[large] = np.maximum(halved_shares(large) - found.value[large], 0.0)
        is_all = found.has_bounds & (found.value > _NEARLY_ALL)
        return replace(
            found,
            upper=np.where(is_all, 1.0, np.minimum(found.upper + 2 * hidden, 1.0)),
            label=np.where(is_all, "conservative", found.label),
        )


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
    title = quantity.output.title
    neighbours = _Indices(sample)
    if kinds := quantity.output.categories:
        events = (sample.values == kind for kind in range(len(kinds)))
        coordinates = category_coordinates(quantity)
        yield neighbours.event_indices(events, coordinates, OF_CATEGORY, f"the kind of {title}")
        return
    yield neighbours.variable_indices(sample.values, "", title)
    if sample.size and sample.values.min() > 0:
        logarithm = np.log(sample.values)
        yield neighbours.variable_indices(logarithm, OF_LOGARITHM, f"the logarithm of {title}")
    if quantity.thresholds:
        events = (sample.values > threshold.value for threshold in quantity.thresholds)
        coordinates = threshold_coordinates(quantity)
        what = f"whether {title} exceeds a value"
        yield neighbours.event_indices(events, coordinates, OF_EXCEEDANCE, what)


def event_first_order(sample: Sample, occurs: BoolArray) -> list[Estimate]:
    """Return the first-order index of each input, of whether an event occurs in the runs.

    Parameters
    ----------
    sample : Sample
        The runs in which the event is known.
    occurs : ndarray of bool, shape (run,)
    """
    if sample.weights is not None:
        return [Estimate.without_bounds(math.nan, texts.NOT_WEIGHTED) for _ in sample.inputs]
    if not sample.size:
        reason = sample.reason_without_intervals or texts.NO_RUN
        return [Estimate.without_bounds(math.nan, reason) for _ in sample.inputs]
    own = replace(sample, values=occurs.astype(np.float64))
    return LocalRegressions(own).indices(SampledVariable(own, is_event=True)).each()


@dataclass(frozen=True)
class _Indices:
    """First-order indices of an output and of functions of it, as estimate arrays."""

    sample: Sample

    @cached_property
    def regressions(self) -> LocalRegressions:
        """The runs, put together by each of their inputs."""
        return LocalRegressions(self.sample)

    def variable_indices(
        self, values: FloatArray, prefix: str, title: str
    ) -> tuple[str, xr.DataArray]:
        """Indices of a variable over the runs, along ``input``."""
        has_doubtful_source = bool(self.sample.shape.is_doubtful)
        is_own = values is self.sample.values
        sample = self.sample if is_own else replace(self.sample, values=values)
        variable = SampledVariable(sample, has_doubtful_source)
        estimates = self.regressions.indices(variable).each()
        name = indices_name(title, self.sample)
        array = input_array(estimates, self.sample.inputs, name, level=self.sample.level)
        return f"{prefix}first_order", array

    def event_indices(
        self, events: Iterable[BoolArray], coordinates: Mapping[str, Any], prefix: str, title: str
    ) -> tuple[str, xr.DataArray]:
        """Indices of events, given the runs in which each event occurs."""
        rows = []
        for event in events:  # of many thresholds, the runs are in memory once
            sample = replace(self.sample, values=event.astype(np.float64))
            rows.append(self.regressions.indices(SampledVariable(sample, is_event=True)).each())
        inputs, name = self.sample.inputs, indices_name(title, self.sample)
        array = event_array(rows, coordinates, inputs, name, self.sample.level)
        return f"{prefix}first_order", array


def indices_name(title: str, sample: Sample) -> str:
    """Return the meaning of the first-order indices of a variable over a sample."""
    name = f"first-order Sobol' indices of {title}"
    return f"{name}, {texts.INCLUDES_CORRELATION}" if sample.dependence else name
