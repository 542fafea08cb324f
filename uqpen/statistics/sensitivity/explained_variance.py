"""Shares of the variance of variables that inputs explain, by local regression over any sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.sample_shape import SampleShape
from uqpen.statistics.sensitivity.input_measures import reason_of_input, reason_of_output
from uqpen.statistics.sensitivity.local_regression import RegressionBins, ResidualVariance
from uqpen.statistics.standard_errors import standard_error

__all__ = ["LocalRegressions", "SampledVariable", "StandardizedVariables", "VarianceParts"]


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

    Parameters
    ----------
    sample : Sample
        Its values.
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

    @cached_property
    def reason_without_indices(self) -> str:
        """Reason why no input has an index; empty where inputs may have."""
        constant = texts.CONSTANT_EVENT if self.is_event else texts.CONSTANT_OUTPUT
        return reason_of_output(self.sample, _FEWEST_RUNS, constant)

    @property
    def std(self) -> float:
        """The standard deviation in the unit of the values."""
        return float(self.shape.scale * self.shape.deviations.std())

    @property
    def standardized(self) -> FloatArray:
        """Deviations from the mean, of variance 1."""
        return self.shape.deviations / self.shape.deviations.std()

    def estimate(self, value: float, error: float, freedom: float, pair_noise: float) -> Estimate:
        """Return an index with its bounds.

        Leaving out runs, or replicates, counts the noise of pairs of runs twice.
        """
        if reason := self.sample.reason_without_intervals or self._reason_without_bounds:
            return Estimate.without_bounds(value, reason)
        excess = error**2 - pair_noise**2
        variance = max(error**2 if self._warning else excess, pair_noise**2)
        if not variance > _ROUNDING**2:
            return Estimate.without_bounds(value, texts.NO_SCATTER_OF_RUNS)
        half = student_quantile(freedom, self.sample.level) * math.sqrt(variance)
        estimate = Estimate(
            value,
            value - half,
            min(value + half, 1.0),
            texts.DELTA_METHOD.format(error_model=self.sample.error_model),
            "conservative" if self._is_wider else "nominal",
        )
        if self._warning:
            return estimate.with_note(texts.DOUBTFUL_AS.format(reason=self._warning))
        return estimate.with_note(texts.DOUBTFUL_TAIL) if self._is_doubtful else estimate

    @property
    def _is_wider(self) -> bool:
        return bool(self._warning) or self.sample.error_model is ErrorModel.REPLICATED

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
        return self._tail_note if self.shape.is_heavy else ""

    @property
    def _tail_note(self) -> str:
        return self.shape.tail_note

    @property
    def _reason_without_bounds(self) -> str:
        if self.sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET and self.sample.optimized_by:
            return texts.OPTIMIZED_POINTS
        if self.is_event and not has_enough_runs_around(self.sample, self.sample.values.sum()):
            return texts.TOO_ONE_SIDED
        return ""


@dataclass(frozen=True, eq=False)
class StandardizedVariables:
    """Variables over the same runs, none of them constant."""

    each: Sequence[SampledVariable]

    @cached_property
    def standardized(self) -> FloatArray:
        """Their standardized values, shape (variable, run)."""
        return np.stack([variable.standardized for variable in self.each])

    @cached_property
    def variance(self) -> FloatArray:
        """Variance of each about the mean of its distribution, which differs from the sample's."""
        sample = self.each[0].sample
        errors, freedom = standard_error(sample, self.standardized)
        return 1 + errors**2 if freedom else np.full(len(self.each), 1 + 1 / sample.size)


@dataclass(frozen=True, eq=False)
class VarianceParts:
    """Variances of variables, and the parts of them that an input does not explain.

    Parameters
    ----------
    total, left : ndarray, shape (variable,)
        The variance, and its part about the lines of the input's bins.
    squares, left_influence : ndarray, shape (variable, run)
        The influence of each run on them, but for a constant.
    pair_noise : ndarray, shape (variable,)
        The part of the error of `left` from the products of pairs of runs.
    """

    total: FloatArray
    left: FloatArray
    squares: FloatArray
    left_influence: FloatArray
    pair_noise: FloatArray

    @classmethod
    def about(cls, lines: ResidualVariance, variables: StandardizedVariables) -> VarianceParts:
        """Return the parts about the lines through variables."""
        squares = variables.standardized**2
        return cls(variables.variance, lines.variance, squares, lines.influence, lines.pair_noise)

    def estimates(self, variables: Sequence[SampledVariable], sample: Sample) -> list[Estimate]:
        """Return the share of each variance that the input explains, with its bounds."""
        values = 1 - self.left / self.total
        ratio = (self.left / self.total)[:, None]
        influence = (ratio * self.squares - self.left_influence) / self.total[:, None]
        errors, freedom = standard_error(sample, influence)
        numbers = zip(values, errors, self.pair_noise / self.total, strict=True)
        return [
            variable.estimate(float(value), float(error), freedom, float(noise))
            for variable, (value, error, noise) in zip(variables, numbers, strict=True)
        ]


# Hears an input's number, variables, the lines of the input's bins, and the parts about them.
Listener = Callable[[int, StandardizedVariables, ResidualVariance, VarianceParts], None]


@dataclass(frozen=True)
class LocalRegressions:
    """The runs of a sample, put together by each of their inputs.

    StandardizedVariables over these runs have the bins of the inputs in common.
    """

    sample: Sample

    @cached_property
    def inputs(self) -> range:
        """The inputs, by their numbers."""
        return range(len(self.sample.inputs))

    @cached_property
    def bins(self) -> list[RegressionBins]:
        """The bins of each input."""
        return [RegressionBins.from_sample(self.sample, column) for column in self.inputs]

    @cached_property
    def _halved_bins(self) -> dict[int, RegressionBins]:
        """Bins of inputs, each cut into two, as far as they were needed."""
        return {}

    def indices(
        self, variables: Sequence[SampledVariable], listener: Listener | None = None
    ) -> list[list[Estimate]]:
        """Estimate the index of each input, for each variable.

        Parameters
        ----------
        variables : sequence of SampledVariable
        listener : callable, optional
            Called with each input, the variables that vary, and their lines and parts.
        """
        known = StandardizedVariables(
            [each for each in variables if not each.reason_without_indices]
        )
        columns = [self._input_indices(known, column, listener) for column in self.inputs]
        rows = zip(*columns, strict=True)
        return [self.row(each.reason_without_indices or next(rows)) for each in variables]

    def row(self, found: Iterable[Estimate] | str) -> list[Estimate]:
        """Return the indices of all inputs, or the reason why there are none, with their note."""
        if isinstance(found, str):
            found = [Estimate.without_bounds(math.nan, found) for _ in self.inputs]
        note = texts.INCLUDES_CORRELATION if self.sample.dependence else ""
        return [each.with_note(each.note, note) for each in found]

    def _input_indices(
        self, known: StandardizedVariables, column: int, listener: Listener | None
    ) -> list[Estimate]:
        if not known.each:
            return []
        if reason := reason_of_input(self.sample, column):
            return [Estimate.without_bounds(math.nan, reason) for _ in known.each]
        lines = ResidualVariance(self.bins[column], known.standardized)
        parts = VarianceParts.about(lines, known)
        if listener:
            listener(column, known, lines, parts)
        return self.estimates(
            known.each, parts, lambda rows: self.halved_shares(known, column, rows)
        )

    def halved_shares(
        self, known: StandardizedVariables, column: int, rows: list[int]
    ) -> FloatArray:
        """Return the shares that bins of half the size explain, of some variables."""
        if column not in self._halved_bins:
            bins = RegressionBins.from_sample(self.sample, column, halved=True)
            self._halved_bins[column] = bins
        lines = ResidualVariance(self._halved_bins[column], known.standardized[rows])
        return 1 - lines.variance / known.variance[rows]

    def estimates(
        self,
        variables: Sequence[SampledVariable],
        parts: VarianceParts,
        halved_shares: Callable[[list[int]], FloatArray],
    ) -> list[Estimate]:
        """Estimate the index of an input, for each variable.

        Parameters
        ----------
        variables : sequence of SampledVariable
        parts : VarianceParts
            Their variances about the lines of the input's bins.
        halved_shares : callable
            Returns the shares that bins of half the size explain, of some of the variables.
        """
        found = parts.estimates(variables, self.sample)
        large = [row for row, each in enumerate(found) if _may_hide_a_jump(each)]
        for row, share in zip(large, halved_shares(large) if large else (), strict=True):
            hidden = max(float(share) - found[row].value, 0.0)
            found[row] = replace(found[row], upper=min(found[row].upper + 2 * hidden, 1.0))
        return [_up_to_all(each) for each in found]


def _may_hide_a_jump(estimate: Estimate) -> bool:
    """Return True if a jump along the input may hide a part of the index, in the bin with it."""
    return estimate.label != "none" and _LARGE <= estimate.value <= _NEARLY_ALL


def _up_to_all(estimate: Estimate) -> Estimate:
    if estimate.label == "none" or estimate.value <= _NEARLY_ALL:
        return estimate
    return replace(estimate, upper=1.0, label="conservative")
