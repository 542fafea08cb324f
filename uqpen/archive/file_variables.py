"""Variables whose values stay in a file until they are needed, and then come by parts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing

from uqpen.core.blocks import block_ranges
from uqpen.core.netcdf.opening import open_own
from uqpen.core.streams import BLOCK

__all__ = ["CodedTexts", "LazyValues", "OpenFile", "is_in_memory", "lazy_dataset", "value_blocks"]

_Key = tuple[Any, ...]


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


class LazyValues(BackendArray):
    """Values that xarray asks for by whole numbers, slices and arrays of numbers."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.OUTER, self._values
        )

    def _values(self, key: _Key) -> npt.NDArray[Any]:
        raise NotImplementedError


class _FileValues(LazyValues):
    def __init__(self, file: OpenFile, stored: Any) -> None:
        self._file = file  # or it would be closed
        self._stored = stored
        self.shape = stored.shape
        self.dtype = np.dtype(object if stored.dtype is str else stored.dtype)

    def __deepcopy__(self, memo: object) -> _FileValues:
        return self  # nothing can write to it

    def _values(self, key: _Key) -> npt.NDArray[Any]:
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


class CodedTexts(LazyValues):
    """Texts, many of them alike, kept as numbers.

    Parameters
    ----------
    codes : ndarray of int, shape (text,)
        The position of each in `texts`.
    texts : sequence of str
        Those that occur.
    """

    def __init__(self, codes: npt.NDArray[Any], texts: list[str]) -> None:
        self._codes = codes
        self._texts = np.array(texts, dtype=object)
        self.shape, self.dtype = codes.shape, np.dtype(object)

    def _values(self, key: _Key) -> npt.NDArray[Any]:
        values: npt.NDArray[Any] = self._texts[self._codes[key]]
        return values

    def variable(self, dimension: str, attributes: dict[Any, Any]) -> xr.Variable:
        """Return them as a variable along a dimension."""
        return xr.Variable((dimension,), indexing.LazilyIndexedArray(self), attributes)


def is_in_memory(variable: xr.Variable) -> bool:
    """Return True if the values of a variable need not be read from a file."""
    return not isinstance(variable._data, indexing.LazilyIndexedArray)


def value_blocks(variable: Any) -> Iterator[tuple[Any, npt.NDArray[Any]]]:
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
