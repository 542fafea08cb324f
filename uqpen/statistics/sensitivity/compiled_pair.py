"""Correlations of weighted sums of columns, by compiled loops over their runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics.kernels import add_sums_above, pair_influence, pair_products, pair_sums
from uqpen.statistics.ordering import Numbers, Ordering
from uqpen.statistics.sensitivity.correlated_pair import CorrelatedPair

__all__ = ["ColumnGroup", "CompiledPair", "compiled_pairs"]

# Values of columns whose orders are put together, and of sums that are added at a time.
_MANY = 2**21


@dataclass(frozen=True, eq=False)
class ColumnGroup:
    """The orders of neighbouring columns, in arrays that a loop takes at a time.

    Parameters
    ----------
    columns : slice
        Which columns.
    orders, levels : ndarray of int, shape (column, run)
    is_above : ndarray of bool, shape (column, run) or (0, 0)
        As `add_sums_above` takes it.
    rank_stds : ndarray, shape (column, 1)
        Standard deviations of the ranks.
    """

    columns: slice
    orders: Numbers
    levels: Numbers
    is_above: BoolArray
    rank_stds: FloatArray

    @classmethod
    def of(cls, orderings: Sequence[Ordering]) -> list[ColumnGroup]:
        """Return all columns together where they are small; else each by itself."""
        if sum(len(each.order) for each in orderings) <= _MANY:
            return [cls._of(0, orderings)] if orderings else []
        return [cls._of(number, [each]) for number, each in enumerate(orderings)]

    @classmethod
    def _of(cls, first: int, orderings: Sequence[Ordering]) -> ColumnGroup:
        is_above = np.empty((0, 0), dtype=np.bool_)
        if any(each.is_above is not None for each in orderings):
            distinct = np.ones(len(orderings[0].order), dtype=np.bool_)
            is_above = np.stack(
                [distinct if each.is_above is None else each.is_above for each in orderings]
            )
        orders = _rows([each.order for each in orderings])
        levels = _rows([each.level for each in orderings])
        stds = np.array([[each.rank_std] for each in orderings])
        return cls(slice(first, first + len(orderings)), orders, levels, is_above, stds)

    def factors(self, weights: FloatArray) -> FloatArray:
        """Return the weights of its columns over the deviations of their ranks; 0 for none."""
        varies = self.rank_stds > 0
        return np.where(varies, weights[self.columns], 0.0) / np.where(varies, self.rank_stds, 1.0)


def _rows(columns: Sequence[Numbers]) -> Numbers:
    """Return columns as rows of an array; a single one is not copied."""
    return columns[0][np.newaxis] if len(columns) == 1 else np.stack(columns)


@dataclass(frozen=True, eq=False)
class CompiledPair(CorrelatedPair):
    """Two weighted sums of columns, added a few runs at a time.

    Parameters
    ----------
    sums : ndarray, shape (run, 2)
        Are written over when there is an influence.
    groups : sequence of ColumnGroup
        Of columns that have ranks, which other runs move; else none.
    """

    sums: FloatArray
    groups: Sequence[ColumnGroup]

    @cached_property
    def _products(self) -> tuple[float, float, float]:
        """Mean squares of both sums, and their mean product."""
        return pair_products(self.sums)

    @cached_property
    def value(self) -> float:
        """The correlation."""
        square, other, product = self._products
        return product / math.sqrt(square) / math.sqrt(other)

    @cached_property
    def influence(self) -> FloatArray:
        """Influence of each run on the correlation, shape (run,)."""
        stds = np.sqrt(self._products[:2])
        influence, memory = np.empty(len(self.sums)), np.empty(len(self.sums))
        pair_influence(self.sums, stds[0], stds[1], self.value, influence)
        weights = (self.weights / stds[:, np.newaxis]).T
        for group in self.groups:
            # A run moves the ranks of all others too.
            factors = group.factors(weights)
            if factors.any():
                order = group.orders, group.is_above, group.levels
                add_sums_above(*order, factors, self.sums, memory, influence)
        return influence


def compiled_pairs(
    columns: FloatArray, weights: Sequence[FloatArray], groups: Sequence[ColumnGroup]
) -> Iterator[CompiledPair]:
    """Yield a pair of sums of columns, shape (column, run), for each of some weights."""
    together = max(1, _MANY // (2 * columns.shape[1]))
    for first in range(0, len(weights), together):
        some = weights[first : first + together]
        # What has been yielded is not held: of many runs, the sums are two columns of them.
        of_pairs = np.empty((len(some), columns.shape[1], 2))
        pair_sums(columns, np.stack(some), of_pairs)
        sums = list(of_pairs)
        del of_pairs
        for own in some:
            yield CompiledPair(own, sums.pop(0), groups)
