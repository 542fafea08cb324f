"""First-order indices from any sample of the joint distribution."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.probabilities import (
    category_coordinates,
    threshold_coordinates,
)
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.sample_shape import SampleShape
from uqpen.statistics.sensitivity.input_measures import (
    event_array,
    input_array,
    reason_without_measure,
)
from uqpen.statistics.sensitivity.local_regression import RegressionBins, ResidualVariance
from uqpen.statistics.standard_errors import standard_error

__all__ = ["first_order"]


# Three bins: with fewer, a curved mean cannot be distinguished from noise.
_FEWEST_RUNS = 48
# Below this, the part that a jump hides in a bin is small compared with the error.
_LARGE = 0.5
# Above this, the residuals may come from the lines alone. For an output equal to one input, they
# were 1e-8 to 1e-3 of the variance, and the interval contained 1 in 0 to 84 % of the seeds.
_NEARLY_ALL = 0.995
# An error below this, in standard deviations of the output, is that of rounding.
_ROUNDING = 1e-12


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
    neighbours = _LocalRegressions(sample)
    if kinds := quantity.output.categories:
        events = [sample.values == kind for kind in range(len(kinds))]
        coordinates = category_coordinates(quantity)
        yield neighbours.event_indices(events, coordinates, "category_", f"the kind of {title}")
        return
    yield neighbours.variable_indices(sample.values, "", title)
    if sample.size and sample.sorted_values[0] > 0:
        logarithm = np.log(sample.values)
        yield neighbours.variable_indices(logarithm, "log_", f"the logarithm of {title}")
    if quantity.thresholds:
        events = [sample.values > threshold.value for threshold in quantity.thresholds]
        coordinates = threshold_coordinates(quantity)
        what = f"whether {title} exceeds a value"
        yield neighbours.event_indices(events, coordinates, "exceedance_", what)


@dataclass(frozen=True)
class _LocalRegressions:
    """The runs of a sample, put together by each of their inputs."""

    sample: Sample

    @cached_property
    def bins(self) -> list[RegressionBins]:
        """The bins of each input."""
        inputs = range(len(self.sample.inputs))
        return [RegressionBins.from_sample(self.sample, column) for column in inputs]

    @cached_property
    def halved_bins(self) -> list[RegressionBins]:
        """Bins of each input, each cut into two."""
        inputs = range(len(self.sample.inputs))
        return [RegressionBins.from_sample(self.sample, column, halved=True) for column in inputs]

    def variable_indices(
        self, values: FloatArray, prefix: str, title: str
    ) -> tuple[str, xr.DataArray]:
        """Indices of a variable over the runs, along ``input``."""
        has_doubtful_source = bool(SampleShape(self.sample).is_doubtful)
        variable = _Variable(replace(self.sample, values=values), has_doubtful_source)
        inputs, long_name = self.sample.inputs, self._long_name(title)
        estimates, level = self._indices(variable), self.sample.level
        return f"{prefix}first_order", input_array(estimates, inputs, long_name, level=level)

    def event_indices(
        self, events: Sequence[BoolArray], coordinates: Mapping[str, Any], prefix: str, title: str
    ) -> tuple[str, xr.DataArray]:
        """Indices of events, given the runs in which each event occurs."""
        samples = [replace(self.sample, values=event.astype(np.float64)) for event in events]
        rows = [self._indices(_Variable(sample, is_event=True)) for sample in samples]
        inputs, long_name = self.sample.inputs, self._long_name(title)
        array = event_array(rows, coordinates, inputs, long_name, self.sample.level)
        return f"{prefix}first_order", array

    def _long_name(self, title: str) -> str:
        long_name = f"first-order Sobol' indices of {title}"
        return f"{long_name}, {texts.INCLUDES_CORRELATION}" if self.sample.dependence else long_name

    def _indices(self, variable: _Variable) -> list[Estimate]:
        found = [self._index(variable, column) for column in range(len(self.sample.inputs))]
        if not self.sample.dependence:
            return found
        return [estimate.with_note(estimate.note, texts.INCLUDES_CORRELATION) for estimate in found]

    def _index(self, variable: _Variable, column: int) -> Estimate:
        """Estimate the share of a variable's variance that an input explains."""
        constant = texts.CONSTANT_EVENT if variable.is_event else texts.CONSTANT_OUTPUT
        if reason := reason_without_measure(variable.sample, column, _FEWEST_RUNS, constant):
            return Estimate.without_bounds(math.nan, reason)
        estimate = variable.index(self.bins[column])
        if estimate.label == "none" or estimate.value < _LARGE:
            return estimate
        if estimate.value > _NEARLY_ALL:
            return replace(estimate, upper=1.0, label="conservative")
        # If the output jumps along the input, the bin with the jump hides a part of the index.
        hidden = variable.explained_share(self.halved_bins[column]) - estimate.value
        return replace(estimate, upper=min(estimate.upper + 2 * max(hidden, 0.0), 1.0))


@dataclass(frozen=True)
class _Variable:
    """A variable over runs, and the share of its variance that an input explains."""

    sample: Sample
    # The output that it derives from may have a heavy tail.
    has_doubtful_source: bool = False
    # It is the indicator (0 or 1) of an event.
    is_event: bool = False

    @cached_property
    def shape(self) -> SampleShape:
        return SampleShape(self.sample)

    @cached_property
    def standardized(self) -> FloatArray:
        """Deviations from the mean, of variance 1."""
        return self.shape.deviations / self.shape.deviations.std()

    @cached_property
    def variance(self) -> float:
        """Variance of the distribution about its own mean, which differs from the sample mean."""
        error, freedom = standard_error(self.sample, self.standardized)
        return 1 + float(error) ** 2 if freedom else 1 + 1 / self.sample.size

    def explained_share(self, bins: RegressionBins) -> float:
        """Return the share of the variance that the lines of an input's bins explain."""
        return 1 - ResidualVariance(bins, self.standardized).variance / self.variance

    def index(self, bins: RegressionBins) -> Estimate:
        """Estimate the index, with its bounds."""
        value = self.explained_share(bins)
        if reason := self.sample.reason_without_intervals or self._reason_without_bounds:
            return Estimate.without_bounds(value, reason)
        left = ResidualVariance(bins, self.standardized)
        influence = left.variance / self.variance * self.standardized**2 - left.influence
        error, freedom = standard_error(self.sample, influence / self.variance)
        return self._with_bounds(value, float(error), freedom, left.pair_noise / self.variance)

    def _with_bounds(self, value: float, error: float, freedom: float, noise: float) -> Estimate:
        """Return an index with its bounds.

        Leaving out runs, or replicates, counts the noise of pairs of runs twice.
        """
        excess = error**2 - noise**2
        variance = max(error**2 if self._warning else excess, noise**2)
        if not variance > _ROUNDING**2:
            return Estimate.without_bounds(value, texts.NO_SCATTER_OF_RUNS)
        half = student_quantile(freedom, self.sample.level) * math.sqrt(variance)
        is_wider = bool(self._warning) or self.sample.error_model is ErrorModel.REPLICATED
        estimate = Estimate(
            value,
            value - half,
            min(value + half, 1.0),
            texts.DELTA_METHOD.format(error_model=self.sample.error_model),
            "conservative" if is_wider else "nominal",
        )
        if self._warning:
            return estimate.with_note(texts.DOUBTFUL_AS.format(reason=self._warning))
        return estimate.with_note(texts.DOUBTFUL_TAIL) if self._is_doubtful else estimate

    @property
    def _is_doubtful(self) -> bool:
        if self.is_event:
            # It has no tail that could be hidden.
            return False
        # A logarithm shows less of a tail than the output does. Where 1 000 runs of the concrete
        # study showed none in it, the largest index was covered in 78 %.
        may_hide = self.has_doubtful_source and self.shape.has_few_effective_runs
        return bool(self.shape.is_doubtful or may_hide)

    @property
    def _warning(self) -> str:
        if self.shape.hidden_tail:
            return texts.ONLY_RUNS.format(runs=self.sample.size)
        return self.shape.tail_note if self.shape.is_heavy else ""

    @property
    def _reason_without_bounds(self) -> str:
        if self.sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET and self.sample.optimized_by:
            return texts.OPTIMIZED_POINTS
        if self.is_event and not has_enough_runs_around(self.sample, self.sample.values.sum()):
            return texts.TOO_ONE_SIDED
        return ""
