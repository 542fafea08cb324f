"""Runs in a file that has room for all of them, and is filled block by block."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqpen.archive.lazy_variables import OpenFile, coded_texts, lazy_dataset
from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, RUN
from uqpen.core.netcdf.opening import open_own

if TYPE_CHECKING:
    import netCDF4

__all__ = ["FailureRecord", "GrowingRuns"]


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
        """Write the runs of a block, given the number of its first one.

        Raises
        ------
        OSError
            If they cannot be written, for example to a full disk.
        """
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

        Raises
        ------
        OSError, RuntimeError
            If the library cannot read them.
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
        """Return all runs; their values stay in the file until they are needed.

        Parameters
        ----------
        like : Dataset
            One of the blocks.
        failures : FailureRecord
            The failed runs.
        """
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
