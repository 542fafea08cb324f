"""Shares of the variance of variables that inputs explain, by local regression over any sample."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around
from uqpen.statistics.estimate_vector import EstimateVector
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.sample_shape import SampleShape
from uqpen.statistics.sensitivity.input_measures import reason_of_input
from uqpen.statistics.sensitivity.local_regression import Lines, RegressionBins, ResidualVariance
from uqpen.statistics.standard_errors import standard_error

__all__ = ["LocalRegressions", "SampledVariable", "VarianceParts"]


# Three bins: with fewer, a curved mean cannot be distinguished from noise.
_FEWEST_RUNS = 48
# Below this, the part that a jump hides in a bin is small compared with the error.
_LARGE = 0.5
# Above this, the residuals may come from the lines alone. For an output equal to one input, they
# were 1e-8 to 1e-3 of the variance, and the interval contained 1 in 0 to 84 % of the seeds.
_NEARLY_ALL = 0.995
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

    @property
    def std(self) -> FloatArray:
        """The standard deviation in the unit of the values; 0 where it is constant."""
        return self.shape.scale * self.shape.deviations.std(axis=-1)

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
        noise = pair_noise**2
        variance = np.maximum(np.where(self._is_warned, error**2, error**2 - noise), noise)
        half = student_quantile(freedom, self.sample.level) * np.sqrt(variance)
        is_wider = self._is_warned | self._is_wider
        note = np.where(self._is_doubtful, texts.DOUBTFUL_TAIL, "").astype(object)
        found = EstimateVector(
            value,
            value - half,
            np.minimum(value + half, 1.0),
            texts.DELTA_METHOD.format(error_model=self.sample.error_model),
            np.where(is_wider, "conservative", "nominal").astype(object),
            np.where(self._is_warned, texts.DOUBTFUL_AS.format(reason=self._warning), note),
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

    @cached_property
    def _is_warned(self) -> BoolArray:
        """True where `_warning` applies."""
        return bool(self.shape.hidden_tail) | self.shape.is_heavy

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

    def estimates(self, variable: SampledVariable) -> EstimateVector:
        """Return the share of the variance that the input explains, with its bounds."""
        ratio = self.left / self.total
        influence = ratio[..., np.newaxis] * self.squares - self.left_influence
        errors, freedom = standard_error(variable.sample, influence / self.total[..., np.newaxis])
        return variable.estimates(1 - ratio, errors, freedom, self.pair_noise / self.total)


class SharedVariance(Protocol):
    """The share of a variable's variance that an input explains, and its error."""

    def estimates(self, variable: SampledVariable) -> EstimateVector:
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

    def indices(
        self, variable: SampledVariable, listener: Listener | None = None
    ) -> EstimateVector:
        """Estimate the index of each input, along a further axis behind that of places.

        Parameters
        ----------
        variable : SampledVariable
        listener : callable, optional
            Called with each input that varies, and its lines and parts.
        """
        columns = [self._input_indices(variable, column, listener) for column in self.inputs]
        return self.with_note(EstimateVector.stack(columns))

    def with_note(self, found: EstimateVector) -> EstimateVector:
        """Return indices with a note on the dependence of the inputs, where there is one."""
        return found.with_further_note(texts.INCLUDES_CORRELATION if self.sample.dependence else "")

    def _input_indices(
        self, variable: SampledVariable, column: int, listener: Listener | None
    ) -> EstimateVector:
        nothing = np.full(variable.sample.values.shape[:-1], np.nan)
        if variable.too_few_runs:
            return EstimateVector.without_bounds(nothing, variable.too_few_runs)
        none = EstimateVector.without_bounds(nothing, variable.text_of_constant)
        if reason := reason_of_input(self.sample, column):
            unknown = EstimateVector.without_bounds(nothing, reason)
            return unknown.replace_at(variable.sample.is_constant, none)
        lines = self._lines(column, variable.standardized)
        parts = VarianceParts.about(lines, variable)
        if listener and isinstance(lines, ResidualVariance):
            listener(column, lines, parts)
        found = self.estimates(
            variable, parts, lambda rows: self.halved_shares(variable, column, rows)
        )
        return found.replace_at(variable.sample.is_constant, none)

    def halved_shares(self, variable: SampledVariable, column: int, rows: BoolArray) -> FloatArray:
        """Return the shares that bins of half the size explain, at some places."""
        values = variable.standardized
        lines = self._lines(column, values if values.ndim == 1 else values[rows], halved=True)
        return np.atleast_1d(1 - lines.variance / variable.variance[rows])

    def _lines(self, column: int, values: FloatArray, *, halved: bool = False) -> Lines:
        """Return the lines of an input's bins through variables, shape (..., run)."""
        inputs = self.sample.run_inputs
        if values.ndim > 1 or not inputs.are_many:
            return ResidualVariance(self.bins(column, halved=halved), values)
        from uqpen.statistics.sensitivity.sorted_bins import CompiledVariance, SortedBins

        bins = inputs.once(
            ("sorted bins", self.sample.error_model, column, halved),
            lambda: SortedBins.of(RegressionBins.from_sample(self.sample, column, halved=halved)),
        )
        return CompiledVariance.about(bins, values)

    def estimates(
        self,
        variable: SampledVariable,
        parts: VarianceParts,
        halved_shares: Callable[[BoolArray], FloatArray],
    ) -> EstimateVector:
        """Estimate the index of an input.

        Parameters
        ----------
        variable : SampledVariable
        parts : VarianceParts
            Its variance about the lines of the input's bins.
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
