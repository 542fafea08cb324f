"""Correlations of an output with the inputs: of values and of ranks, simple and partial."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.input_columns import Ordering, sums_above
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample, SampleShape
from uqpen.statistics.sensitivity.input_measures import input_array, reason_without_measure
from uqpen.statistics.standard_errors import standard_error

# Residuals of linear regressions of columns on each other, as weighted sums of the columns.


@dataclass(frozen=True, eq=False)
class ResidualWeights:
    """Weights of columns, the output last, in what is left of them after regressions.

    Of each input the others are taken off, and of the output all inputs. What is left of the output
    after all inputs but one is `rest`, and `slopes` times what is left of this one.
    """

    own: FloatArray  # (input, column)
    rest: FloatArray  # (column,)
    slopes: FloatArray  # (input,): of the output on all inputs
    has_regressions: bool = True

    @classmethod
    def of(cls, columns: FloatArray) -> ResidualWeights | None:
        """Return the weights of columns, all from one inverse; None where some are dependent.

        Parameters
        ----------
        columns : ndarray, shape (column, run)
            Of mean 0 and variance 1, or 0 where an input does not vary.
        """
        varying = np.flatnonzero(columns.any(axis=1))
        # More columns than runs are always dependent.
        if len(varying) > columns.shape[1]:
            return None
        some = columns if len(varying) == len(columns) else columns[varying]
        # `einsum` adds in one order on every processor; the kernels of `@` each have their own.
        products = np.empty((len(some), len(some)))
        for i, row in enumerate(some):
            products[i, i:] = products[i:, i] = np.einsum("r,jr->j", row, some[i:])
        products /= columns.shape[1]
        if np.linalg.cond(products) > 1 / _ROUNDING:
            return None
        inverse, inputs = _inverse(products[:-1, :-1]), varying[:-1]
        weights = replace(cls.none(len(columns) - 1), has_regressions=True)
        weights.own[np.ix_(inputs, inputs)] = inverse / np.diag(inverse)[:, np.newaxis]
        weights.slopes[inputs] = (inverse * products[-1, :-1]).sum(axis=1)
        weights.rest[:-1] = -weights.slopes
        return weights

    @classmethod
    def none(cls, inputs: int) -> ResidualWeights:
        """Return the weights without regressions: each column is left as it is."""
        identity = np.eye(inputs + 1)
        return cls(identity[:-1], identity[-1], np.zeros(inputs), has_regressions=False)

    def left(self, columns: FloatArray, inputs: IntArray, *, out: FloatArray) -> FloatArray:
        """Return what is left of some inputs, in place of the values of an array.

        Parameters
        ----------
        columns : ndarray, shape (column, run)
        inputs : ndarray of int, shape (input,)
        out : ndarray, shape (input, run)
        """
        if self.has_regressions:
            return np.einsum("pk,kr->pr", self.own[inputs], columns, out=out)
        return np.take(columns, inputs, axis=0, out=out, mode="clip")

    def output(self, columns: FloatArray) -> FloatArray:
        """Return what is left of the output, shape (run,)."""
        if self.has_regressions:
            return np.einsum("k,kr->r", self.rest, columns)
        return columns[-1]


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
# Values that go through the orders of all columns together: few enough for a cache.
_MOST_VALUES = 2**17
# Fewer variables than this gain nothing from each other.
_FEWEST_TOGETHER = 8


def correlations(
    sample: Sample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Correlations of an output with each random input.

    Yields
    ------
    name : str
        ``pearson``, ``spearman``; ``partial`` and ``partial_rank``: correlation of the residuals
        of output and input after linear regression on the other inputs, without codes of texts.
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
    def _rank_stds(self) -> FloatArray:
        """Standard deviations of the ranks; infinite where a column does not vary."""
        stds = np.array([ordering.rank_std for ordering in self.orderings])
        return np.where(stds > 0, stds, np.inf)

    @cached_property
    def standardized(self) -> FloatArray:
        """The columns, of mean 0 and variance 1, as rows; 0 where one does not vary."""
        columns = np.empty((len(self.sample.inputs) + 1, self.sample.size))
        if self.is_ranked:
            for row, ordering, std in zip(columns, self.orderings, self._rank_stds, strict=True):
                row[:] = ordering.mean_ranks
                row -= (len(row) + 1) / 2
                row /= std
        else:
            for number, row in enumerate(columns[:-1]):
                row[:] = self.sample.run_inputs[number]
            columns[-1] = self.shape.deviations
            for row in columns:
                _standardize(row)
        # A line along codes of texts would follow an order that they do not have.
        columns[[*map(self.sample.columns.is_coded, range(len(columns) - 1)), False]] = 0.0
        return columns

    def correlations(self, *, is_partial: bool) -> list[Estimate]:
        """Estimate the correlation of the output with each input."""
        inputs = range(len(self.sample.inputs))
        reasons = [
            reason_without_measure(self.sample, i, _FEWEST_RUNS, needs_order=True) for i in inputs
        ]
        weights: ResidualWeights | None = ResidualWeights.none(len(inputs))
        if is_partial and not all(reasons):
            weights = ResidualWeights.of(self.standardized)
        if not weights:
            reasons = [reason or texts.LINEARLY_DEPENDENT for reason in reasons]
        chosen = [i for i in inputs if not reasons[i]]
        found = self._estimates(chosen, weights) if chosen and weights else iter(())
        return [
            Estimate.without_bounds(math.nan, reason) if reason else next(found)
            for reason in reasons
        ]

    def _estimates(self, inputs: Sequence[int], weights: ResidualWeights) -> Iterator[Estimate]:
        """Yield the correlation of what is left of the output with what is left of each input."""
        columns, reason = self.standardized, self._reason_without_bounds
        reason = self.sample.reason_without_intervals or reason
        rest = weights.output(columns)
        above = rest_above = np.empty((0, 0))
        if self.is_ranked and not reason:
            # A run moves the ranks of all others too: by so much those of `rest` in each column.
            above = np.empty_like(columns)
            for row, ordering, std in zip(above, self.orderings, self._rank_stds, strict=True):
                row[:] = sums_above([ordering], np.array([[1 / std]]), rest[:, np.newaxis])[:, 0]
            rest_above = weights.output(above)
        together = _MOST_VALUES // self.sample.size
        together = min(together if together >= _FEWEST_TOGETHER else 1, len(inputs))
        # Large arrays are overwritten, as memory costs more than sums.
        arrays = np.empty((3, together, self.sample.size))
        for first in range(0, len(inputs), together):
            some = np.array(inputs[first : first + together])
            own, slopes = weights.own[some], weights.slopes[some, np.newaxis]
            one, other, influence = arrays[:, : len(some)]
            weights.left(columns, some, out=one)
            np.multiply(slopes, one, out=other)
            other += rest
            # Their means are 0.
            one_std, other_std = _root_mean_squares(one), _root_mean_squares(other)
            one /= one_std
            other /= other_std
            values = np.einsum("pr,pr->p", one, other)[:, np.newaxis] / self.sample.size
            if reason:
                yield from (
                    Estimate.without_bounds(value, reason) for value in values[:, 0].tolist()
                )
                continue
            # The influence of a run is one · other − value / 2 · (one² + other²).
            np.multiply(one, -values / 2, out=influence)
            influence += other
            influence *= one
            other *= other
            other *= values / 2
            influence -= other
            if self.is_ranked:
                # Of a correlation v, other − v one and one − v other, as sums of `rest` and `one`.
                slope = slopes * one_std / other_std
                of_one = (slope - values) / one_std + slopes * (1 - values * slope) / other_std
                of_rest = (1 - values * slope) / other_std
                factors = (of_one * own + of_rest * weights.rest) / self._rank_stds
                influence += sums_above(self.orderings, factors.T, one.T).T
                moved = weights.left(above, some, out=other)
                moved *= (1 / one_std - values * slopes / other_std) / other_std
                influence += moved
                influence -= np.multiply(values / other_std**2, rest_above, out=moved)
            yield from map(self._with_bounds, values[:, 0].tolist(), influence)

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
    lowest, highest = values.min(initial=0.0), values.max(initial=0.0)
    if not highest > lowest:
        values[:] = 0.0
        return
    values /= max(-lowest, highest)
    values /= _root_mean_squares(values[np.newaxis])[0]


def _root_mean_squares(values: FloatArray) -> FloatArray:
    """Return the root of the mean square of each row, shape (row, 1)."""
    return np.sqrt(np.einsum("pr,pr->p", values, values)[:, np.newaxis] / values.shape[-1])
