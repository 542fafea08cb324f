"""Order of the values of a column: it is sorted once, and ranks follow from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.statistics.intervals import group_sums

__all__ = ["Numbers", "Ordering", "ascending_order"]

# Small enough that the numbers of the values of a sort take half of a word at most.
_MOST_PACKED = 2**32
# Where more values than this share have a neighbour of like leading digits, many are equal.
_MOST_ALIKE = 0.125
_SIGN = np.uint64(2**63)

# Of 32 bits where that is enough: half of the memory.
Numbers = npt.NDArray[np.signedinteger[Any]]


@dataclass(frozen=True, eq=False)
class Ordering:
    """Values in ascending order.

    Parameters
    ----------
    order : ndarray of int, shape (run,)
        Numbers of the values, ascending; those of equal values ascend themselves.
    is_above : ndarray of bool, shape (run,), optional
        For each value in that order, True if it is above the one before, or the first of all. None
        where no two values are equal.
    """

    order: Numbers
    is_above: BoolArray | None = None

    @classmethod
    def of(cls, values: FloatArray) -> Ordering:
        """Return the order of values, which are not NaN."""
        return cls._in_order(values, ascending_order(values))

    @classmethod
    def _in_order(cls, values: FloatArray, order: Numbers) -> Ordering:
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


def ascending_order(values: FloatArray) -> Numbers:
    """Return the numbers of values in ascending order, as a stable sort does.

    Each value is packed with its number into one word, as words are sorted ten times as fast as
    numbers by their values. What the leading bits of a value leave open is sorted afterwards.
    """
    runs = len(values)
    bits = np.uint64(max(runs - 1, 1).bit_length())
    if runs >= _MOST_PACKED or values.dtype != np.float64:
        return np.argsort(values, kind="stable")
    words = (values + 0.0).view(np.uint64)  # of the two zeros only the positive one
    words ^= np.where(words & _SIGN, ~np.uint64(0), _SIGN)  # words ascend as the numbers do
    words >>= bits
    words <<= bits
    words |= np.arange(runs, dtype=np.uint64)
    words.sort()
    order: Numbers = (words & ((np.uint64(1) << bits) - np.uint64(1))).astype(_index_type(runs))
    return _with_alike_sorted(values, order, words >> bits)


def _with_alike_sorted(
    values: FloatArray, order: Numbers, leading: npt.NDArray[np.uint64]
) -> Numbers:
    """Sort those values of an order that have the same leading bits as a neighbour."""
    is_like_next = leading[1:] == leading[:-1]
    if not is_like_next.any():
        return order
    is_alike = np.zeros(len(order), dtype=np.bool_)
    is_alike[1:] = is_like_next
    is_alike[:-1] |= is_like_next
    places = np.flatnonzero(is_alike)
    if len(places) > _MOST_ALIKE * len(order):
        return np.argsort(values, kind="stable").astype(order.dtype)
    # Those of a group have neighbouring places, and groups ascend: a stable sort keeps them apart.
    alike = np.sort(order[places])
    order[places] = alike[np.argsort(values[alike], kind="stable")]
    return order


def _index_type(runs: int) -> npt.DTypeLike:
    return np.int32 if runs < 2**31 else np.int64
