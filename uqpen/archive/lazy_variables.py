"""Variables whose values are made when they are indexed.

They stay in a file until they are needed, and then come by parts; or they lie in other variables,
one after the other; or they are computed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing

from uqpen.core.blocks import block_ranges
from uqpen.core.netcdf.opening import open_own
from uqpen.core.streams import BLOCK

__all__ = [
    "CodedTexts",
    "OpenFile",
    "computed_variable",
    "is_in_memory",
    "joined_variable",
    "lazy_dataset",
    "value_blocks",
]

_Key = tuple[Any, ...]
_Values = npt.NDArray[Any]


class OpenFile:
    """NetCDF file that is open for reading as long as a variable in it is in use."""

    def __init__(self, path: Path) -> None:
        self._root = open_own(path)
        self._root.set_auto_maskandscale(False)

    def variable(self, group: str, name: str) -> Any:
        """Return a variable of a group; its values are read when it is indexed."""
        stored = (self._root if group == "/" else self._root[group]).variables[name]
        values = _FileValues(self, stored)
        own = {key: stored.getncattr(key) for key in stored.ncattrs()}
        return xr.Variable(stored.dimensions, indexing.LazilyIndexedArray(values), own)


class _LazyValues(BackendArray):
    """Values that xarray asks for by whole numbers, slices and arrays of numbers."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def __deepcopy__(self, memo: object) -> Self:
        return self  # nothing can write to it

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.OUTER, self._values
        )

    def _values(self, key: _Key) -> _Values:
        raise NotImplementedError


class _FileValues(_LazyValues):
    def __init__(self, file: OpenFile, stored: Any) -> None:
        self._file = file  # or it would be closed
        self._stored = stored
        self.shape = stored.shape
        self.dtype = np.dtype(object if stored.dtype is str else stored.dtype)

    def _values(self, key: _Key) -> _Values:
        first, *others = key
        if not isinstance(first, np.ndarray) or not first.size:
            return np.asarray(self._stored[key])
        # The library would read each of the numbers by itself.
        block = first // BLOCK
        parts = []
        for number in np.unique(block):
            at = first[block == number]
            low = int(at.min())
            parts.append(self._stored[(slice(low, int(at.max()) + 1), *others)][at - low])
        values = np.empty((first.size, *parts[0].shape[1:]), self.dtype)
        values[np.argsort(block, kind="stable")] = np.concatenate(parts)
        return values


class CodedTexts(_LazyValues):
    """Texts, many of them alike, kept as numbers.

    Parameters
    ----------
    codes : ndarray of int, shape (text,)
        The position of each in `texts`.
    texts : sequence of str
        Those that occur.
    """

    def __init__(self, codes: _Values, texts: list[str]) -> None:
        self._codes = codes
        self._texts = np.array(texts, dtype=object)
        self.shape, self.dtype = codes.shape, np.dtype(object)

    def _values(self, key: _Key) -> _Values:
        values: _Values = self._texts[self._codes[key]]
        return values

    def variable(self, dimension: str, attributes: dict[Any, Any]) -> xr.Variable:
        """Return them as a variable along a dimension."""
        return xr.Variable((dimension,), indexing.LazilyIndexedArray(self), attributes)


def is_in_memory(variable: xr.Variable) -> bool:
    """Return True if the values of a variable need not be read from a file."""
    return not isinstance(variable._data, indexing.LazilyIndexedArray)


def value_blocks(variable: Any) -> Iterator[tuple[Any, _Values]]:
    """Yield the values of a variable or an array by blocks along its first dimension.

    Each comes with its place. Values in memory are not indexed through xarray, which takes longer
    than to write or hash a few of them.
    """
    if isinstance(variable, xr.Variable) and is_in_memory(variable):
        variable = variable.values
    if not variable.shape:
        yield ..., np.asarray(variable)
        return
    for start, stop in block_ranges(variable.shape[0]):
        yield slice(start, stop), np.asarray(variable[start:stop])


def lazy_dataset(
    variables: dict[str, xr.Variable], coordinates: dict[str, xr.Variable], attributes: Any
) -> xr.Dataset:
    """Return a dataset without indexes of its coordinates, which would be whole in memory."""
    return xr.Dataset(variables, xr.Coordinates(coordinates, indexes={}), attributes)


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


class _JoinedValues(_LazyValues):
    def __init__(self, parts: Sequence[xr.Variable]) -> None:
        self._parts = parts
        self._starts = np.cumsum([0, *(len(part) for part in parts)])
        self.shape = (int(self._starts[-1]), *parts[0].shape[1:])
        self.dtype = np.result_type(*(part.dtype for part in parts))

    def _values(self, key: _Key) -> _Values:
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


class _ComputedValues(_LazyValues):
    def __init__(
        self, dtype: np.dtype[Any], size: int, values_at: Callable[[_Values], _Values]
    ) -> None:
        self._values_at = values_at
        self.shape, self.dtype = (size,), dtype

    def _values(self, key: _Key) -> _Values:
        found = self._values_at(_positions(key[0], self.shape[0]))
        return np.asarray(found, dtype=self.dtype)


def _positions(index: Any, size: int) -> _Values:
    """Return the positions of an index along a dimension of some size."""
    return np.arange(*index.indices(size)) if isinstance(index, slice) else np.asarray(index)
