"""Order of the values of a column: it is sorted once, and ranks follow from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.statistics.intervals import group_sums

# Of 32 bits where that is enough: half of the memory.
Numbers = npt.NDArray[np.signedinteger[Any]]


@dataclass(frozen=True, eq=False)
class Ordering:
    """Values in ascending order."""

    # (run,): numbers of the values, ascending; those of equal values ascend themselves.
    order: Numbers
    # (run,): for each value in that order, True if it is above the one before, or the first of all.
    # None where no two values are equal.
    is_above: BoolArray | None = None

    @classmethod
    def of(cls, values: FloatArray) -> Ordering:
        """Return the order of values, which are not NaN."""
        # Without equal values there is one order, and any sort finds it; a stable one takes longer.
        found = cls._in_order(values, np.argsort(values))
        if found.is_above is None:
            return found
        return cls._in_order(values, np.argsort(values, kind="stable"))

    @classmethod
    def _in_order(cls, values: FloatArray, order: Numbers) -> Ordering:
        order = order.astype(np.int32 if len(order) < 2**31 else np.int64, copy=False)
        ascending = values[order]
        is_above = np.ones(len(order), dtype=np.bool_)
        np.greater(ascending[1:], ascending[:-1], out=is_above[1:])
        return cls(order, None if is_above.all() else is_above)

    def among(self, used: IntArray, values: FloatArray) -> Ordering:
        """Return the order of some of the values.

        Parameters
        ----------
        used : ndarray of int, shape (run,)
            Their numbers.
        values : ndarray, shape (point,)
            All values.
        """
        number = np.full(len(self.order), -1, dtype=self.order.dtype)
        number[used] = np.arange(len(used))
        among = number[self.order]
        kept = among[among >= 0]
        return Ordering(kept) if self.is_above is None else self._in_order(values[used], kept)

    @cached_property
    def level(self) -> Numbers:
        """Number of each value among the ascending distinct ones."""
        level = np.empty(len(self.order), dtype=self.order.dtype)
        if self.is_above is None:
            level[self.order] = np.arange(len(self.order))
        else:
            level[self.order] = np.cumsum(self.is_above) - 1
        return level

    @property
    def mean_ranks(self) -> FloatArray:
        """Ranks from 1; equal values share the mean of theirs."""
        if self.is_above is None:
            return np.add(self.level, 1.0, dtype=np.float64)
        count = np.bincount(self.level)
        ranks: FloatArray = (np.cumsum(count) - (count - 1) / 2)[self.level]
        return ranks

    @cached_property
    def rank_std(self) -> float:
        """The standard deviation of `mean_ranks`."""
        return float(self.mean_ranks.std())

    def sums_above(self, values: FloatArray) -> FloatArray:
        """Return for each run the sum of other values over the runs above; an equal one is half.

        Values are of shape (..., run).
        """
        if self.is_above is None:
            at = np.take(values, self.order, axis=-1)
        else:
            at = group_sums(values, self.level, int(self.is_above.sum()))
        sums = np.cumsum(at[..., ::-1], axis=-1)[..., ::-1]
        sums -= at / 2
        return np.take(sums, self.level, axis=-1)
