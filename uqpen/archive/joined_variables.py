"""Variables that are made of others when they are indexed: one after the other, or computed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from xarray.core import indexing

from uqpen.archive.file_variables import LazyValues

__all__ = ["computed_variable", "joined_variable"]

_Values = npt.NDArray[Any]


def joined_variable(parts: Sequence[xr.Variable]) -> xr.Variable:
    """Return variables one after the other along their first dimension.

    Parameters
    ----------
    parts : sequence of Variable
        At least one, in memory or in files. All have the dimensions of the first, whose attributes
        are those of the whole.
    """
    first = parts[0]
    return xr.Variable(first.dims, indexing.LazilyIndexedArray(_JoinedValues(parts)), first.attrs)


def computed_variable(
    like: xr.Variable, size: int, values_at: Callable[[_Values], _Values]
) -> xr.Variable:
    """Return a variable along one dimension whose values follow from their positions.

    Parameters
    ----------
    like : Variable
        Has the dimension, the type and the attributes.
    size : int
        Number of values.
    values_at : callable
        Returns the values at positions, whole numbers from 0.
    """
    values = _ComputedValues(like.dtype, size, values_at)
    return xr.Variable(like.dims, indexing.LazilyIndexedArray(values), like.attrs)


class _JoinedValues(LazyValues):
    def __init__(self, parts: Sequence[xr.Variable]) -> None:
        self._parts = parts
        self._starts = np.cumsum([0, *(len(part) for part in parts)])
        self.shape = (int(self._starts[-1]), *parts[0].shape[1:])
        self.dtype = np.result_type(*(part.dtype for part in parts))

    def __deepcopy__(self, memo: object) -> _JoinedValues:
        return self  # nothing can write to it

    def _values(self, key: tuple[Any, ...]) -> _Values:
        first, *others = key
        if not isinstance(first, slice | np.ndarray):
            return np.asarray(self._values((np.array([first]), *others))[0])
        if isinstance(first, slice) and first.step in (None, 1):
            start, stop, _ = first.indices(self.shape[0])
            overlapping = [
                (number, slice(max(start - begin, 0), min(stop, end) - begin))
                for number, (begin, end) in enumerate(pairwise(self._starts.tolist()))
                if start < end and begin < stop
            ]
            return self._joined(overlapping, others)
        positions = _positions(first, self.shape[0])
        numbers = np.searchsorted(self._starts, positions, side="right") - 1
        parts = [
            (number, positions[numbers == number] - self._starts[number])
            for number in np.unique(numbers).tolist()
        ]
        joined = self._joined(parts, others)
        values = np.empty_like(joined)
        values[np.argsort(numbers, kind="stable")] = joined
        return values

    def _joined(self, parts: Iterable[tuple[int, Any]], others: Sequence[Any]) -> _Values:
        """Return values of some parts, given by number, at their own positions."""
        found = [self._parts[number][(at, *others)].values for number, at in parts]
        return np.concatenate(found or [self._parts[0][(slice(0), *others)].values])


class _ComputedValues(LazyValues):
    def __init__(
        self, dtype: np.dtype[Any], size: int, values_at: Callable[[_Values], _Values]
    ) -> None:
        self._values_at = values_at
        self.shape, self.dtype = (size,), dtype

    def __deepcopy__(self, memo: object) -> _ComputedValues:
        return self  # nothing can write to it

    def _values(self, key: tuple[Any, ...]) -> _Values:
        found = self._values_at(_positions(key[0], self.shape[0]))
        return np.asarray(found, dtype=self.dtype)


def _positions(index: Any, size: int) -> _Values:
    """Return the positions of an index along a dimension of some size."""
    return np.arange(*index.indices(size)) if isinstance(index, slice) else np.asarray(index)
