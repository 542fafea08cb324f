"""Variables whose values are made when they are indexed.

They stay in a file until they are needed, and then come by parts; or they lie in other variables,
one after the other; or they are computed.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing

from uqpen.core.blocks import block_ranges
from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, RUN
from uqpen.core.netcdf.opening import open_own
from uqpen.core.streams import BLOCK

if TYPE_CHECKING:
    import netCDF4

_Key = tuple[Any, ...]
_Values = npt.NDArray[Any]


class _LazyValues(BackendArray):
    """Values that xarray asks for by whole numbers, slices and arrays of numbers."""

    def __init__(self, shape: tuple[int, ...], dtype: Any, read: Callable[[_Key], _Values]) -> None:
        self.shape, self.dtype, self._read = shape, np.dtype(dtype), read

    def __deepcopy__(self, memo: object) -> Self:
        return self  # nothing can write to it

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        support = indexing.IndexingSupport.OUTER
        return indexing.explicit_indexing_adapter(key, self.shape, support, self._read)

    def variable(self, dims: tuple[Hashable, ...], attributes: Any) -> xr.Variable:
        """Return them as a variable."""
        return xr.Variable(dims, indexing.LazilyIndexedArray(self), attributes)


class OpenFile:
    """NetCDF file that is open for reading as long as a variable in it is in use."""

    def __init__(self, path: Path) -> None:
        self._root = open_own(path)
        self._root.set_auto_maskandscale(False)

    def variable(self, group: str, name: str) -> Any:
        """Return a variable of a group; its values are read when it is indexed."""
        stored = (self._root if group == "/" else self._root[group]).variables[name]
        dtype = object if stored.dtype is str else stored.dtype
        # The function holds this object, or the file would be closed.
        values = _LazyValues(stored.shape, dtype, lambda key: self._read(stored, key))
        own = {key: stored.getncattr(key) for key in stored.ncattrs()}
        return values.variable(stored.dimensions, own)

    def _read(self, stored: Any, key: _Key) -> _Values:
        first, *others = key
        if not isinstance(first, np.ndarray) or not first.size:
            return np.asarray(stored[key])
        # The library would read each of the numbers by itself.
        block = first // BLOCK
        parts = []
        for number in np.unique(block):
            at = first[block == number]
            low = int(at.min())
            parts.append(stored[(slice(low, int(at.max()) + 1), *others)][at - low])
        return _in_order(np.concatenate(parts), block)


def coded_texts(
    codes: _Values, texts: list[str], dims: tuple[Hashable, ...], attributes: Any
) -> xr.Variable:
    """Return texts, many of them alike, as a variable that keeps the position of each in a list."""
    table = np.array(texts, dtype=object)
    return _LazyValues(codes.shape, object, lambda key: table[codes[key]]).variable(
        dims, attributes
    )


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
    """Return variables one after the other along their first dimension, at least one.

    They are in memory or in files. All have the dimensions of the first, whose attributes are those
    of the whole.
    """
    first = parts[0]
    starts = np.cumsum([0, *(len(part) for part in parts)])
    shape = (int(starts[-1]), *first.shape[1:])
    dtype = np.result_type(*(part.dtype for part in parts))
    values = _LazyValues(shape, dtype, lambda key: _joined_values(parts, starts, key))
    return values.variable(first.dims, first.attrs)


def _joined_values(parts: Sequence[xr.Variable], starts: _Values, key: _Key) -> _Values:
    """Return values of variables that lie one after the other, each from its start on."""
    first, *others = key
    if not isinstance(first, slice | np.ndarray):
        return np.asarray(_joined_values(parts, starts, (np.array([first]), *others))[0])
    if isinstance(first, slice) and first.step in (None, 1):
        start, stop, _ = first.indices(int(starts[-1]))
        found = [
            part[(slice(max(start - begin, 0), min(stop, end) - begin), *others)].values
            for part, (begin, end) in zip(parts, pairwise(starts.tolist()), strict=True)
            if start < end and begin < stop
        ]
        return np.concatenate(found or [parts[0][(slice(0), *others)].values])
    positions = _positions(first, int(starts[-1]))
    numbers = np.searchsorted(starts, positions, side="right") - 1
    found = [
        parts[number][(positions[numbers == number] - starts[number], *others)].values
        for number in np.unique(numbers).tolist()
    ]
    joined = np.concatenate(found or [parts[0][(slice(0), *others)].values])
    return _in_order(joined, numbers)


def _in_order(values: _Values, parts: _Values) -> _Values:
    """Return values that come part by part in the order in which the parts are asked for."""
    ordered = np.empty_like(values)
    ordered[np.argsort(parts, kind="stable")] = values
    return ordered


def computed_variable(
    like: xr.Variable, size: int, values_at: Callable[[_Values], _Values]
) -> xr.Variable:
    """Return a variable along one dimension whose values follow from their positions.

    It has the dimension, the type and the attributes of another.
    """
    values = _LazyValues(
        (size,),
        like.dtype,
        lambda key: np.asarray(values_at(_positions(key[0], size)), dtype=like.dtype),
    )
    return values.variable(like.dims, like.attrs)


def _positions(index: Any, size: int) -> _Values:
    """Return the positions of an index along a dimension of some size."""
    return np.arange(*index.indices(size)) if isinstance(index, slice) else np.asarray(index)


class GrowingRuns:
    """File with room for a number of runs.

    The values of a variable are in one piece, whose place does not change once there is a block.
    So a program that is killed damages no block but the one that it writes.

    Parameters
    ----------
    path : Path
        The file, which need not be there yet.
    size : int
        Number of all runs.
    """

    def __init__(self, path: Path, size: int) -> None:
        self.path, self._size = path, size
        self._root: netCDF4.Dataset | None = None
        self._is_writable = False

    def write(self, start: int, block: xr.Dataset) -> None:
        """Write the runs of a block, given the number of its first one; OSError for a full disk."""
        try:
            if not self.path.exists():
                self._define(block)
            root = self._opened(to_write=True)
            for name, values in _along_run(block).items():
                root.variables[name][start : start + block.sizes[RUN]] = values
            root.sync()  # the library keeps the last values of a variable for a while
        except RuntimeError as error:  # the library's word for a full disk
            raise OSError(None, f"{error} (is the disk full?)") from error

    def is_readable(self) -> bool:
        """Return True if the file is there, and the library can open it."""
        try:
            return self.path.exists() and bool(self._opened().variables)
        except (OSError, RuntimeError):
            return False

    def read(self, start: int, stop: int) -> Mapping[str, Any]:
        """Return the values of the runs from one number to another, by variable.

        OSError or RuntimeError if the library cannot read them.
        """
        return {
            name: np.asarray(each[start:stop]) for name, each in self._opened().variables.items()
        }

    def bring_to_disk(self) -> None:
        """Wait until all that was written is on the disk."""
        with self.path.open("rb") as stream:
            os.fsync(stream.fileno())

    def close(self) -> None:
        """Close the file."""
        if self._root is not None:
            root, self._root, self._is_writable = self._root, None, False
            with contextlib.suppress(RuntimeError):
                root.close()

    def dataset(self, like: xr.Dataset, failures: FailureRecord) -> xr.Dataset:
        """Return all runs, like one of the blocks; values stay in the file until needed."""
        self.close()
        file = OpenFile(self.path)
        found: dict[str, xr.Variable] = failures.variables(like)
        for name, variable in like.variables.items():
            if RUN in variable.dims:
                found[str(name)] = file.variable("/", str(name))
                found[str(name)].attrs = variable.attrs
            elif FAILED_RUN not in variable.dims:
                found[str(name)] = variable
        coordinates = {name: found.pop(name) for name in map(str, like.coords) if name in found}
        names = [name for name in map(str, like.variables) if name in {*found, *coordinates}]
        return lazy_dataset(found, coordinates, like.attrs)[names]

    def _define(self, block: xr.Dataset) -> None:
        temporary = self.path.with_name(f"{self.path.name}.tmp")
        try:
            with open_own(temporary, "w") as root:
                sizes = {**block.sizes, RUN: self._size}
                for name, values in _along_run(block).items():
                    dims = tuple(map(str, block.variables[name].dims))
                    for dim in dims:
                        if dim not in root.dimensions:
                            root.createDimension(dim, sizes[dim])
                    root.createVariable(name, values.dtype, dims, fill_value=False)
            temporary.replace(self.path)
        finally:
            temporary.unlink(missing_ok=True)

    def _opened(self, *, to_write: bool = False) -> netCDF4.Dataset:
        """Return the open file, to read it only as long as nothing is written.

        The library would not open a file for writing that is still read, as it is after an
        interruption in a notebook.
        """
        if to_write and not self._is_writable:
            self.close()
        if self._root is None:
            self._root = open_own(self.path, "a" if to_write else "r")
            self._root.set_auto_maskandscale(False)
            self._is_writable = to_write
        return self._root


class FailureRecord:
    """Failed runs and their reasons, many of them alike, collected block by block."""

    def __init__(self) -> None:
        self._runs: list[Any] = []
        self._codes: list[Any] = []
        self._texts: dict[str, int] = {}

    def add(self, block: xr.Dataset) -> None:
        """Add the failed runs of the next block."""
        self._runs.append(block.variables[FAILED_RUN].values)
        reasons = map(str, block.variables[FAILURE_REASON].values)
        codes = [self._texts.setdefault(each, len(self._texts)) for each in reasons]
        self._codes.append(np.array(codes, dtype=np.int32))

    def variables(self, like: xr.Dataset) -> dict[str, xr.Variable]:
        """Return their numbers and reasons as variables like those of a block; none for no run."""
        runs = np.concatenate(self._runs)
        if not runs.size:
            return {}
        numbers, reasons = (like.variables[name].attrs for name in (FAILED_RUN, FAILURE_REASON))
        codes = np.concatenate(self._codes)
        return {
            FAILED_RUN: xr.Variable((FAILED_RUN,), runs, numbers),
            FAILURE_REASON: coded_texts(codes, [*self._texts], (FAILED_RUN,), reasons),
        }


def _along_run(block: xr.Dataset) -> dict[str, Any]:
    """Return the values of a block that differ between runs, by variable."""
    return {str(n): each.values for n, each in block.variables.items() if RUN in each.dims}
