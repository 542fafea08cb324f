"""Correlations of an output with the inputs: of values and of ranks, simple and partial."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.ordering import Ordering
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample, SampleShape
from uqpen.statistics.sensitivity.correlated_pair import (
    CorrelatedPair,
    PairOfArrays,
    standardized,
)
from uqpen.statistics.sensitivity.input_measures import (
    input_array,
    reason_without_measure,
)
from uqpen.statistics.standard_errors import standard_error

if TYPE_CHECKING:
    from uqpen.statistics.sensitivity.compiled_pair import ColumnGroup

__all__ = ["ResidualWeights", "correlations"]

# Residuals of linear regressions of columns on each other, as weighted sums of the columns.


@dataclass(frozen=True, eq=False)
class ResidualWeights:
    """Regressions of inputs and an output on the other inputs, all from one inverse.

    Parameters
    ----------
    inverse : ndarray, shape (input, input)
        Of the mean products of the inputs (the precision matrix).
    slopes : ndarray, shape (input,)
        Of the output on all inputs.
    """

    inverse: FloatArray
    slopes: FloatArray

    @classmethod
    def of(cls, products: FloatArray) -> ResidualWeights:
        """Return the regressions, given the mean products of all columns, the output last."""
        inverse = _inverse(products[:-1, :-1])
        return cls(inverse, (inverse * products[-1, :-1]).sum(axis=1))

    def without(self, i: int) -> FloatArray:
        """Return the weights in the residuals of input `i` and of the output on the other inputs.

        Returns
        -------
        ndarray, shape (2, column)
            The column of the output is the last.
        """
        own = self.inverse[i] / self.inverse[i, i]
        slopes = self.slopes - self.slopes[i] * own
        slopes[i] = 0.0
        return np.stack([np.append(own, 0.0), np.append(-slopes, 1.0)])


def _inverse(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a positive definite matrix, by sweeping each of its columns.

    Its digits do not depend on the processor, as those of linear algebra do. Goodnight, J. H.
    (1979). Am. Stat. 33, 149-158.
    """
    swept = matrix.copy()
    for k in range(len(swept)):
        pivot, row, column = swept[k, k], swept[k].copy(), swept[:, k].copy()
        swept -= np.outer(column, row / pivot)
        swept[k], swept[:, k] = row / pivot, -column / pivot
        swept[k, k] = 1 / pivot
    return swept


_FEWEST_RUNS = 30
# The statistics: whether of ranks, whether partial, and what they are.
_CORRELATIONS = {
    "pearson": (False, False, "Pearson correlations"),
    "spearman": (True, False, "Spearman rank correlations"),
    "partial": (False, True, "partial correlations"),
    "partial_rank": (True, True, "partial rank correlations"),
}
# Correlations nearer to one than this are one but for rounding.
_ROUNDING = 1e-12


def correlations(
    sample: Sample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Correlations of an output with each random input.

    Yields
    ------
    name : str
        ``pearson``, ``spearman``; ``partial`` and ``partial_rank``: correlation of the residuals
        of output and input after linear regression on the other inputs.
    estimate : DataArray
        Along ``input`` and ``bound``.
    """
    if quantity.output.categories or not sample.inputs:
        return
    for is_ranked in (False, True):
        # The columns of values are not needed any more when those of ranks are made.
        columns = _CorrelatedColumns(sample, is_ranked=is_ranked)
        for statistic, (goes_by_ranks, is_partial, adjective) in _CORRELATIONS.items():
            if goes_by_ranks == is_ranked:
                estimates = columns.correlations(is_partial=is_partial)
                name = f"{adjective} of {quantity.output.title} with the inputs"
                if sample.dependence and not is_partial:
                    name = f"{name}, {texts.INCLUDES_CORRELATION}"
                yield statistic, input_array(estimates, sample.inputs, name, level=sample.level)
        del columns


@dataclass(frozen=True)
class _CorrelatedColumns:
    """The inputs and the output of a sample, or their ranks, and how they correlate."""

    sample: Sample
    is_ranked: bool

    @cached_property
    def shape(self) -> SampleShape:
        return self.sample.shape

    @cached_property
    def orderings(self) -> list[Ordering]:
        """The order of each column, the output last."""
        inputs = self.sample.run_inputs
        return [*map(inputs.ordering, range(len(inputs.columns.names))), self.sample.ordering]

    @cached_property
    def standardized(self) -> FloatArray:
        """The columns, of mean 0 and variance 1, as rows; 0 where one does not vary."""
        columns = np.empty((len(self.orderings), self.sample.size))
        for row, column in zip(columns, self._columns, strict=True):
            standardized(column, row)
        return columns

    @property
    def _columns(self) -> Iterator[FloatArray]:
        if self.is_ranked:
            return (each.mean_ranks for each in self.orderings)
        return chain(self._inputs, [self.shape.deviations])

    @property
    def _inputs(self) -> Iterator[FloatArray]:
        """Each input over the completed runs."""
        inputs = self.sample.run_inputs
        return (inputs[number] for number in range(len(inputs.columns.names)))

    @cached_property
    def _varying(self) -> IntArray:
        return np.flatnonzero(self.standardized.any(axis=1))

    @cached_property
    def _products(self) -> FloatArray:
        """Mean products of the columns that vary: how they correlate."""
        varying = self._varying
        is_whole = len(varying) == len(self.standardized)
        columns = self.standardized if is_whole else self.standardized[varying]
        # `einsum` adds in one order on every processor; the kernels of `@` each have their own.
        return np.einsum("ir,jr->ij", columns, columns) / self.sample.size

    def correlations(self, *, is_partial: bool) -> list[Estimate]:
        """Estimate the correlation of the output with each input."""
        reasons = []
        for i in range(len(self.sample.inputs)):
            reason = reason_without_measure(self.sample, i, _FEWEST_RUNS)
            if not reason and is_partial and self._residual_weights is None:
                reason = texts.LINEARLY_DEPENDENT
            reasons.append(reason)
        weights_of = self._partial_weights if is_partial else self._simple_weights
        # One after the other: of thousands of inputs they take hundreds of MB together.
        pairs = self._pairs(weights_of(i) for i, reason in enumerate(reasons) if not reason)
        return [
            Estimate.without_bounds(math.nan, reason) if reason else self._estimate(next(pairs))
            for reason in reasons
        ]

    def _estimate(self, pair: CorrelatedPair) -> Estimate:
        if reason := self.sample.reason_without_intervals or self._reason_without_bounds:
            return Estimate.without_bounds(pair.value, reason)
        value, influence = pair.value, pair.influence
        del pair  # with its sums
        return self._with_bounds(value, influence)

    def _pairs(self, weights: Iterator[FloatArray]) -> Iterator[CorrelatedPair]:
        """Yield a pair for each of some weights; its type follows from the number of values."""
        if self.sample.run_inputs.are_many:
            from uqpen.statistics.sensitivity.compiled_pair import compiled_pairs

            yield from compiled_pairs(self.standardized, [*weights], self._groups)
        else:
            columns, orderings = self.standardized, self._orderings_of_ranks
            yield from (PairOfArrays(each, columns, orderings) for each in weights)

    @cached_property
    def _groups(self) -> list[ColumnGroup]:
        from uqpen.statistics.sensitivity.compiled_pair import ColumnGroup

        return ColumnGroup.of(self._orderings_of_ranks)

    @property
    def _orderings_of_ranks(self) -> list[Ordering]:
        return self.orderings if self.is_ranked else []

    def _simple_weights(self, i: int) -> FloatArray:
        """Weights of the columns, 1 for the input and 1 for the output, shape (2, column)."""
        weights = np.zeros((2, len(self.standardized)))
        weights[0, i] = weights[1, -1] = 1
        return weights

    @cached_property
    def _residual_weights(self) -> ResidualWeights | None:
        """Weights of the columns that vary in their residuals; None where some are dependent."""
        # More columns than runs are always dependent.
        if len(self._varying) > self.sample.size:
            return None
        if np.linalg.cond(self._products) > 1 / _ROUNDING:
            return None
        return ResidualWeights.of(self._products)

    def _partial_weights(self, i: int) -> FloatArray:
        """Weights of the columns in the residuals of input and output over the other inputs."""
        assert self._residual_weights is not None
        weights = np.zeros((2, len(self.standardized)))
        mine = int(np.searchsorted(self._varying, i))
        weights[:, self._varying] = self._residual_weights.without(mine)
        return weights

    def _with_bounds(self, value: float, influence: FloatArray) -> Estimate:
        """Return a correlation with its bounds, by the delta method on Fisher's transform."""
        error, freedom = standard_error(self.sample, influence)
        if 1 - abs(value) < _ROUNDING or not error > _ROUNDING:
            return Estimate.without_bounds(value, texts.NO_SCATTER_OF_RUNS)
        half = student_quantile(freedom, self.sample.level) * error / (1 - value**2)
        centre = math.atanh(value)
        estimate = Estimate(
            value,
            math.tanh(centre - half),
            math.tanh(centre + half),
            texts.DELTA_ON_FISHER.format(error_model=self.sample.error_model),
            "nominal",
        )
        # Ranks have no tail that could be hidden.
        is_doubtful = self.shape.is_doubtful and not self.is_ranked
        return estimate.with_note(texts.DOUBTFUL_TAIL) if is_doubtful else estimate

    @property
    def _reason_without_bounds(self) -> str:
        if self.is_ranked:
            return ""
        if self.shape.hidden_tail:
            return f"{self.shape.hidden_tail}; {texts.SEE_RANKS}"
        if self.shape.is_heavy:
            heavy = texts.NO_INTERVAL_AS.format(reason=self.shape.tail_note)
            return f"{heavy}; {texts.SEE_RANKS}"
        return ""
