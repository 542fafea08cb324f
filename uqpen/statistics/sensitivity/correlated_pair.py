"""Correlation of two weighted sums of columns, and each run's influence on it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.statistics.ordering import Ordering

__all__ = ["CorrelatedPair", "PairOfArrays", "standardized"]


@dataclass(frozen=True, eq=False)
class CorrelatedPair(ABC):
    """Two weighted sums of columns.

    Parameters
    ----------
    weights : ndarray, shape (2, column)
        Of the columns in both sums.
    """

    weights: FloatArray

    @property
    @abstractmethod
    def value(self) -> float:
        """The correlation."""

    @property
    @abstractmethod
    def influence(self) -> FloatArray:
        """Influence of each run on the correlation, shape (run,)."""


@dataclass(frozen=True, eq=False)
class PairOfArrays(CorrelatedPair):
    """Two weighted sums of columns, each an array.

    Parameters
    ----------
    columns : ndarray, shape (column, run)
        Of mean 0 and variance 1.
    orderings : sequence of Ordering
        Of each column if it has ranks, which other runs move; else none.
    """

    columns: FloatArray
    orderings: Sequence[Ordering]

    @cached_property
    def _sums(self) -> list[FloatArray]:
        """Both sums, added one column after the other."""
        sums = np.zeros((2, self.columns.shape[1]))
        for total, weights in zip(sums, self.weights, strict=True):
            for k in np.flatnonzero(weights):
                total += weights[k] * self.columns[k]
        return list(sums)

    @cached_property
    def _standardized(self) -> list[FloatArray]:
        return [standardized(each) for each in self._sums]

    @cached_property
    def value(self) -> float:
        """The correlation."""
        one, other = self._standardized
        return float((one * other).mean())

    @property
    def influence(self) -> FloatArray:
        """Influence of each run on the correlation, shape (run,)."""
        (one, other), value = self._standardized, self.value
        influence: FloatArray = one * other - value / 2 * (one**2 + other**2)
        if self.orderings:
            # A run moves the ranks of all others too.
            targets = other - value * one, one - value * other
            for target, weights, total in zip(targets, self.weights, self._sums, strict=True):
                for k in np.flatnonzero(weights):
                    moved = self.orderings[k].sums_above(target) / self.orderings[k].rank_std
                    influence += weights[k] / float(total.std()) * moved
        return influence


def standardized(values: FloatArray, out: FloatArray | None = None) -> FloatArray:
    """Return values of mean 0 and variance 1, in an array if one is given; 0 for a constant."""
    centred: FloatArray = np.subtract(values, values.mean(), out=out)
    highest, lowest = centred.max(initial=-math.inf), centred.min(initial=math.inf)
    if not highest > lowest:
        centred[:] = 0.0
        return centred
    centred /= max(highest, -lowest)
    centred /= float(np.sqrt((centred**2).mean()))
    return centred
