"""Reading an archive; a file that is none gets an error that says so."""

from __future__ import annotations

import contextlib
import operator
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr

from uqpen.archive.groups import group_names, is_benchmark, model_trees, read_group
from uqpen.archive.hashes import is_broken
from uqpen.archive.netcdf import read_groups
from uqpen.archive.provenance import SCHEMA, SCHEMA_ATTRIBUTE
from uqpen.archive.structure import find_faults
from uqpen.core.errors import ArchiveError
from uqpen.core.files import NotAFileError
from uqpen.core.netcdf.opening import RefusedContentError, open_archive_file, open_own

if TYPE_CHECKING:
    import netCDF4

__all__ = [
    "SCHEMA_ATTRIBUTE",
    "group_names",
    "is_archive",
    "is_benchmark",
    "model_trees",
    "open_archive",
    "read_group",
    "read_tree",
    "read_unchecked",
]

# What the library raises for a file that it cannot read.
_LIBRARY_ERRORS = (OSError, RuntimeError, ValueError, TypeError, AttributeError)


def open_archive(path: str | Path) -> xr.DataTree:
    """Read an archive into memory as a tree of datasets.

    Parameters
    ----------
    path : str or Path
        A file that `uqpen study` has written.

    Raises
    ------
    ArchiveError
        If it cannot be read, is no archive, or has another schema.
    """
    whole = read_tree(Path(path))
    if fault := next(find_faults(whole), None):
        raise ArchiveError(f"{path}: is damaged: {fault}")
    return whole


def read_tree(path: Path) -> xr.DataTree:
    """Read an archive as `open_archive` does, but without the check of its structure."""
    with _opened(path) as root:
        schema = _schema(root, path)
        if schema != SCHEMA:
            raise ArchiveError(
                f"{path}: has schema {schema}, and this uqpen reads schema {SCHEMA}; "
                "take the version that wrote it"
            )
        try:
            return read_groups(root)
        except (*_LIBRARY_ERRORS, LookupError, MemoryError) as error:
            raise ArchiveError(f"{path}: is damaged: {error}") from error


def read_unchecked(path: Path, runs_in_memory: int) -> xr.DataTree:
    """Read an archive that this program has just written, without a check of its bytes."""
    with open_own(path) as root:
        return read_groups(root, runs_in_memory)


def is_archive(path: Path) -> bool:
    """Return True if a file is a uqpen archive, of any schema."""
    try:
        with _opened(path) as root:
            _schema(root, path)
    except ArchiveError:
        return False
    return True


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[netCDF4.Dataset]:
    """Open a file whose bytes are those that were written."""
    with contextlib.ExitStack() as stack:
        try:
            if is_broken(path):
                raise ArchiveError(f"{path}: is damaged: its bytes are not those that were written")
            # With a right checksum as well: anyone can write one behind bytes of theirs.
            root = stack.enter_context(open_archive_file(path))
        except FileNotFoundError:
            raise ArchiveError(f"{path}: there is no such file") from None
        except ArchiveError:
            raise
        except (RefusedContentError, NotAFileError) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            raise ArchiveError(f"{_no_archive(path)}: {reason}") from None
        except OSError:
            raise _no_archive(path) from None
        yield root


def _schema(root: netCDF4.Dataset, path: Path) -> int:
    try:
        if SCHEMA_ATTRIBUTE in root.ncattrs():
            return operator.index(root.getncattr(SCHEMA_ATTRIBUTE))
    except _LIBRARY_ERRORS:
        raise _no_archive(path) from None
    raise ArchiveError(f"{path}: is a NetCDF file, but not an archive of uqpen's")


def _no_archive(path: Path) -> ArchiveError:
    return ArchiveError(f"{path}: is not an archive of uqpen's")
