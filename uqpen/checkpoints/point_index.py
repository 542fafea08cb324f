"""Index of points by the bits of their inputs: single points, or whole batches of them."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import Arrays, IntArray

__all__ = ["BatchIndex", "Index", "PointIndex"]

_Hashes = npt.NDArray[np.uint64]

# Odd, with its bits spread: a multiplication moves each bit of an input into the higher ones.
_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)
_SHIFT = np.uint64(29)


class Index(ABC):
    """Index of known points by the bits of their inputs."""

    @abstractmethod
    def find(self, inputs: Arrays, start: int, size: int) -> IntArray:
        """Return the position of each point among the known ones, shape (run,); -1 for none.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            Consecutive points of a round.
        start, size : int
            Number of the first of them in its round, and of all points of the round.
        """


class PointIndex(Index):
    """Index of single points; of equal ones it finds the first.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (run,)
        The known points.
    """

    def __init__(self, inputs: Arrays) -> None:
        self._names = list(inputs)
        self._columns = _bits(inputs, self._names)
        hashes = _hashes(self._columns)
        self._order = np.argsort(hashes, kind="stable")
        self._hashes = hashes[self._order]

    def find(self, inputs: Arrays, start: int, size: int) -> IntArray:
        columns = _bits(inputs, self._names)
        hashes = _hashes(columns)
        found = np.full(len(hashes), -1)
        # In ascending order a search takes a tenth of the time.
        left = np.argsort(hashes)
        place = np.empty(len(hashes), dtype=np.int64)
        place[left] = np.searchsorted(self._hashes, hashes[left])
        # Points of one hash stand side by side. They are nearly always equal.
        while left.size:
            left = left[place[left] < len(self._hashes)]
            left = left[self._hashes[place[left]] == hashes[left]]
            known = self._order[place[left]]
            is_equal = np.ones(len(left), dtype=np.bool_)
            for own, other in zip(self._columns, columns, strict=True):
                is_equal &= own[known] == other[left]
            found[left[is_equal]] = known[is_equal]
            left = left[~is_equal]
            place[left] += 1
        return found


class BatchIndex(Index):
    """Index of whole batches, for a model whose results may depend on the batch.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (run,)
        The known points.
    batches : sequence of ndarray
        The positions of the points of each batch, in their order.
    size : int
        Number of points of a batch; the last one of a round may have fewer.
    """

    def __init__(self, inputs: Arrays, batches: Sequence[IntArray], size: int) -> None:
        self._names = list(inputs)
        self._size = size
        columns = _bits(inputs, self._names)
        self._batches: dict[bytes, IntArray] = {}
        for batch in batches:
            self._batches.setdefault(_digest([column[batch] for column in columns]), batch)

    def find(self, inputs: Arrays, start: int, size: int) -> IntArray:
        columns = _bits(inputs, self._names)
        stop = start + len(columns[0])
        found = np.full(stop - start, -1)
        # A batch may begin in an earlier block, and end in a later one; such a one is not found.
        for first in range(start + -start % self._size, stop, self._size):
            end = min(first + self._size, size)
            if end > stop:
                break
            part = slice(first - start, end - start)
            batch = self._batches.get(_digest([column[part] for column in columns]))
            if batch is not None:
                found[part] = batch
        return found


def _bits(inputs: Arrays, names: Sequence[str]) -> list[_Hashes]:
    """Return the bits of each input as whole numbers: -0 is not 0."""
    return [np.ascontiguousarray(inputs[name], dtype=np.float64).view(np.uint64) for name in names]


def _hashes(columns: Sequence[_Hashes]) -> _Hashes:
    hashes = np.zeros_like(columns[0])
    for column in columns:
        hashes ^= column
        hashes *= _MULTIPLIER
        hashes ^= hashes >> _SHIFT
    return hashes


def _digest(columns: Sequence[_Hashes]) -> bytes:
    digest = hashlib.blake2b(digest_size=16)
    for column in columns:
        digest.update(column.tobytes())
    return digest.digest()
