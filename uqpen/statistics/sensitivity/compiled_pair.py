"""Correlation of two weighted sums of columns, by compiled loops over their runs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.statistics.sensitivity.correlated_pair import CorrelatedPair
from uqpen.statistics.sensitivity.kernels import (
    add_sums_above,
    pair_influence,
    pair_products,
    pair_sums,
)

__all__ = ["CompiledPair"]

_NONE_EQUAL = np.empty(0, dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class CompiledPair(CorrelatedPair):
    """Two weighted sums of columns, added a few runs at a time."""

    @cached_property
    def _sums(self) -> FloatArray:
        return pair_sums(self.columns, self.summed, self.weights)

    @cached_property
    def _products(self) -> tuple[float, float, float]:
        """Mean squares of both sums, and their mean product."""
        return pair_products(self._sums)

    @cached_property
    def value(self) -> float:
        """The correlation."""
        square, other, product = self._products
        return product / math.sqrt(square) / math.sqrt(other)

    @property
    def influence(self) -> FloatArray:
        """Influence of each run on the correlation, shape (run,)."""
        runs = self.columns.shape[1]
        influence, targets = np.empty(runs), np.empty((runs, 2))
        stds = np.sqrt(self._products[:2])
        pair_influence(self._sums, stds, self.value, targets, influence)
        if self.orderings:
            # A run moves the ranks of all others too.
            weights = (self.weights / stds[:, np.newaxis]).T.tolist()
            for k in self.summed.tolist():
                own = self.orderings[k]
                is_above = _NONE_EQUAL if own.is_above is None else own.is_above
                factors = weights[k][0] / own.rank_std, weights[k][1] / own.rank_std
                add_sums_above(own.order, is_above, targets, factors, influence)
        return influence
