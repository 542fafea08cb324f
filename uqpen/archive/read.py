"""Reading an archive; a file that is none gets an error that says so."""

from __future__ import annotations

import operator
from pathlib import Path

import xarray as xr

from uqpen.archive.checksum import is_broken
from uqpen.archive.migrations import migrate
from uqpen.archive.provenance import SCHEMA, SCHEMA_ATTRIBUTE
from uqpen.archive.structure import find_faults
from uqpen.core.errors import ArchiveError
from uqpen.core.labels import MODELS

__all__ = [
    "SCHEMA_ATTRIBUTE",
    "group_names",
    "is_archive",
    "model_trees",
    "open_archive",
    "read_as_written",
    "read_group",
    "read_tree",
]


def open_archive(path: str | Path) -> xr.DataTree:
    """An archive as a tree of datasets, read into memory.

    Parameters
    ----------
    path : str or Path
        A file that `uqpen study` has written.

    Raises
    ------
    ArchiveError
        If it cannot be read, is no archive, or was written by a later uqpen.
    """
    whole = read_tree(Path(path))
    if fault := next(find_faults(whole), None):
        raise ArchiveError(f"{path}: is damaged: {fault}")
    return whole


def read_tree(path: Path) -> xr.DataTree:
    """What `open_archive` opens, whole or not: for those who ask what is wrong with it.

    One of an earlier schema is as this uqpen would have written it.

    Raises
    ------
    ArchiveError
        If it cannot be read, is no archive, or was written by a later uqpen.
    """
    return migrate(read_as_written(path))


def read_as_written(path: Path) -> xr.DataTree:
    """The very tree that stands in an archive, of which its hashes are.

    Raises
    ------
    ArchiveError
        If it cannot be read, is no archive, or was written by a later uqpen.
    """
    schema = _schema(path)
    if schema > SCHEMA:
        raise ArchiveError(
            f"{path}: has schema {schema}; this uqpen reads up to {SCHEMA}, so take a later one"
        )
    if schema < 1:
        raise ArchiveError(f"{path}: has schema {schema}, which there has never been")
    try:
        # Units such as "s" stay numbers, and flags stay whole numbers.
        with xr.open_datatree(
            path, engine="netcdf4", decode_times=False, decode_timedelta=False, mask_and_scale=False
        ) as tree:
            return tree.load()
    except (OSError, RuntimeError, ValueError, AttributeError) as error:
        # The last is of attributes that xarray takes for texts, and are none.
        raise ArchiveError(f"{path}: is damaged: {error}") from error


def model_trees(tree: xr.DataTree) -> dict[str, xr.DataTree]:
    """What is told of each model, by its name; the archive itself, unnamed, of a single model."""
    if MODELS not in tree.children:
        return {"": tree}
    return {str(name): model for name, model in tree.children[MODELS].children.items()}


def group_names(tree: xr.DataTree, name: str) -> list[str]:
    """The groups inside a group of the root: the designs that have runs, say."""
    return list(tree.children[name].children) if name in tree.children else []


def read_group(tree: xr.DataTree, *path: str) -> xr.Dataset:
    """The dataset of a group; an empty one where the archive has none."""
    for name in path:
        if name not in tree.children:
            return xr.Dataset()
        tree = tree.children[name]
    return tree.to_dataset(inherit=False)


def is_archive(path: Path) -> bool:
    """Whether a file is an archive of uqpen's, of any schema."""
    try:
        _schema(path)
    except ArchiveError:
        return False
    return True


def _schema(path: Path) -> int:
    import netCDF4

    if is_broken(path):
        raise ArchiveError(f"{path}: is damaged: its bytes are not those that were written")
    try:
        with netCDF4.Dataset(path) as dataset:
            if SCHEMA_ATTRIBUTE not in dataset.ncattrs():
                raise ArchiveError(f"{path}: is a NetCDF file, but not an archive of uqpen's")
            return operator.index(dataset.getncattr(SCHEMA_ATTRIBUTE))
    except ArchiveError:
        raise
    except (OSError, RuntimeError, ValueError, TypeError, AttributeError) as error:
        missing = isinstance(error, FileNotFoundError)
        reason = "there is no such file" if missing else "is not an archive of uqpen's"
        raise ArchiveError(f"{path}: {reason}") from None
