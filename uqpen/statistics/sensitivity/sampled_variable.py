"""A variable over runs, and the interval of the share of its variance that an input explains."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around
from uqpen.statistics.estimate_vector import EstimateVector
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.sample_shape import SampleShape
from uqpen.statistics.standard_errors import standard_error

__all__ = ["SampledVariable"]

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
        return SampleShape(self.sample)

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
    ) -> EstimateVector:
        """Return indices with their bounds.

        Leaving out runs, or replicates, counts the noise of pairs of runs twice.
        """
        if reason := self.sample.reason_without_intervals or self._reason_without_bounds:
            return EstimateVector.without_bounds(value, reason)
        noise, is_uncertain = pair_noise**2, self.shape.is_uncertain
        variance = np.maximum(np.where(is_uncertain, error**2, error**2 - noise), noise)
        half = student_quantile(freedom, self.sample.level) * np.sqrt(variance)
        is_wider = is_uncertain | self._is_wider
        note = np.where(self._is_doubtful, texts.DOUBTFUL_TAIL, "").astype(object)
        found = EstimateVector(
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
