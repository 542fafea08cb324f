"""Shares of the variance of variables that inputs explain, by local regression over any sample."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics import texts
from uqpen.statistics.estimate_vector import EstimateVector
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.sensitivity.input_measures import reason_of_input
from uqpen.statistics.sensitivity.local_regression import Lines, RegressionBins, ResidualVariance
from uqpen.statistics.sensitivity.sampled_variable import SampledVariable
from uqpen.statistics.sensitivity.tallied_variance import TalliedLines, TalliedVariance
from uqpen.statistics.standard_errors import standard_error

__all__ = ["LocalRegressions", "SharedVariance", "VarianceParts"]


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
    ) -> EstimateVector:
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
