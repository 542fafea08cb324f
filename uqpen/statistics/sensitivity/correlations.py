"""Correlations of an output with the inputs: of values and of ranks, simple and partial."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.input_columns import Ordering
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample, SampleShape
from uqpen.statistics.sensitivity.input_measures import input_array, reason_without_measure
from uqpen.statistics.standard_errors import standard_error

# Residuals of linear regressions of columns on each other, as weighted sums of the columns.


@dataclass(frozen=True, eq=False)
class ResidualWeights:
    """Regressions of inputs and an output on the other inputs, all from one inverse."""

    inverse: FloatArray  # (input, input): of the mean products of the inputs (the precision matrix)
    slopes: FloatArray  # (input,): of the output on all inputs

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
# Values of sums of columns that go through an order together: few enough for a cache.
_MOST_VALUES = 2**17


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
        columns = _CorrelatedColumns(sample, is_ranked)
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
        return [*map(inputs.ordering, range(len(self.sample.inputs))), self.sample.ordering]

    @cached_property
    def standardized(self) -> FloatArray:
        """The columns, of mean 0 and variance 1, as rows; 0 where one does not vary."""
        columns = np.empty((len(self.sample.inputs) + 1, self.sample.size))
        if self.is_ranked:
            for row, ordering in zip(columns, self.orderings, strict=True):
                row[:] = ordering.mean_ranks
        else:
            for number, row in enumerate(columns[:-1]):
                row[:] = self.sample.run_inputs[number]
            columns[-1] = self.shape.deviations
        for row in columns:
            _standardize(row)
        return columns

    @cached_property
    def _varying(self) -> IntArray:
        return np.flatnonzero(self.standardized.any(axis=1))

    def correlations(self, *, is_partial: bool) -> list[Estimate]:
        """Estimate the correlation of the output with each input."""
        inputs = range(len(self.sample.inputs))
        reasons = [reason_without_measure(self.sample, i, _FEWEST_RUNS) for i in inputs]
        residuals = None
        if is_partial and not all(reasons):
            residuals = self._residual_weights()
            if residuals is None:
                reasons = [reason or texts.LINEARLY_DEPENDENT for reason in reasons]
        weights = []
        for i in (i for i, reason in enumerate(reasons) if not reason):
            own = np.zeros((2, len(self.standardized)))
            if residuals:
                own[:, self._varying] = residuals.without(int(np.searchsorted(self._varying, i)))
            else:
                own[0, i] = own[1, -1] = 1
            weights.append(own)
        found = self._estimates(weights)
        return [
            Estimate.without_bounds(math.nan, reason) if reason else next(found)
            for reason in reasons
        ]

    def _residual_weights(self) -> ResidualWeights | None:
        """Weights of the columns that vary in their residuals; None where some are dependent."""
        varying = self._varying
        # More columns than runs are always dependent.
        if len(varying) > self.sample.size:
            return None
        is_whole = len(varying) == len(self.standardized)
        columns = self.standardized if is_whole else self.standardized[varying]
        # `einsum` adds in one order on every processor; the kernels of `@` each have their own.
        products = np.einsum("ir,jr->ij", columns, columns) / self.sample.size
        return None if np.linalg.cond(products) > 1 / _ROUNDING else ResidualWeights.of(products)

    def _estimates(self, weights: Sequence[FloatArray]) -> Iterator[Estimate]:
        """Yield the correlation of each pair of weighted sums of the columns."""
        reason = self.sample.reason_without_intervals or self._reason_without_bounds
        together = max(1, _MOST_VALUES // (2 * max(self.sample.size, 1)))
        for first in range(0, len(weights), together):
            some = np.stack(weights[first : first + together])
            sums = np.einsum("psk,kr->spr", some, self.standardized)
            stds = sums.std(axis=-1, keepdims=True)
            sums /= stds
            values = (sums[0] * sums[1]).mean(axis=-1)
            if reason:
                yield from (Estimate.without_bounds(value, reason) for value in values.tolist())
                continue
            influence = self._influence(some / stds.swapaxes(0, 1), sums, values[:, np.newaxis])
            yield from map(self._with_bounds, values.tolist(), influence)

    def _influence(self, weights: FloatArray, sums: FloatArray, values: FloatArray) -> FloatArray:
        """Return each run's influence on the correlations of pairs of sums, shape (pair, run).

        Parameters
        ----------
        weights : ndarray, shape (pair, 2, column)
        sums : ndarray, shape (2, pair, run)
            Of variance 1.
        values : ndarray, shape (pair, 1)
            Their correlations.
        """
        one, other = sums
        influence: FloatArray = one * other - values / 2 * (one**2 + other**2)
        if not self.is_ranked:
            return influence
        # A run moves the ranks of all others too.
        targets = np.stack([other - values * one, one - values * other])
        for ordering, factors in zip(self.orderings, weights.transpose(2, 1, 0), strict=True):
            pairs = np.flatnonzero(factors.any(axis=0))
            if pairs.size:
                moved = np.einsum("sp,spr->pr", factors[:, pairs], targets[:, pairs])
                influence[pairs] += ordering.sums_above(moved) / ordering.rank_std
        return influence

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


def _standardize(values: FloatArray) -> None:
    """Give values the mean 0 and the variance 1; 0 to a constant."""
    values -= values.mean()
    largest = np.abs(values).max(initial=0.0)
    if not np.ptp(values) > 0:
        values[:] = 0.0
        return
    values /= largest
    values /= float(np.sqrt((values**2).mean()))
