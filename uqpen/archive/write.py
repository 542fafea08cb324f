"""Writing an archive: whole, under its own name, or not at all."""

from __future__ import annotations

import glob
import os
from pathlib import Path

import xarray as xr

from uqpen.archive.checksum import append_checksum
from uqpen.archive.content import hash_record
from uqpen.archive.netcdf import write_tree
from uqpen.archive.read import is_archive
from uqpen.core.errors import ArchiveError

__all__ = ["prepare_destination", "write"]


def prepare_destination(path: Path) -> None:
    """Make sure, before any model runs, that an archive can be written.

    Raises
    ------
    ArchiveError
        If `path` is a folder or a file of another kind, or its folder cannot be written to.
    """
    try:
        if path.is_dir():
            raise ArchiveError(f"{path}: is a folder; name a file, such as {path / 'study.nc'}")
        if path.exists() and not (path.is_file() and is_archive(path)):
            raise ArchiveError(f"{path}: is not an archive of uqpen's, so it is not overwritten")
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove_leftovers(path)
        trial = _temporary_path(path)
        trial.touch()
        trial.unlink()
    except ArchiveError:
        raise
    except FileExistsError:
        raise ArchiveError(f"{path}: cannot be written: {path.parent} is not a folder") from None
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be written: {error.strerror}") from None


def write(tree: xr.DataTree, path: Path) -> None:
    """Write a study's tree as one NetCDF file, with the hashes of its groups.

    The file is written under a temporary name next to `path`, flushed to the disk and then renamed
    in one step. Until then an existing file remains.

    Raises
    ------
    ArchiveError
        If it cannot be written, for example to a full disk. No temporary file remains.
    """
    temporary = _temporary_path(path)
    try:
        write_tree(tree, temporary, hash_record(tree))
        append_checksum(temporary)
        temporary.replace(os.path.realpath(path))
    except (OSError, RuntimeError) as error:
        # The NetCDF library reports a full disk as a RuntimeError about HDF.
        if isinstance(error, RuntimeError) and not str(error).startswith("NetCDF:"):
            raise
        reason = getattr(error, "strerror", None) or f"{error} (is the disk full?)"
        raise ArchiveError(f"{path}: cannot be written: {reason}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _temporary_path(path: Path) -> Path:
    """Return the temporary path of an archive, next to the file that it replaces."""
    place = Path(os.path.realpath(path))
    return place.with_name(f".{place.name}.{os.getpid()}.part")


def _remove_leftovers(path: Path) -> None:
    """Remove the parts that processes have left that were killed while they wrote."""
    place = Path(os.path.realpath(path))
    for part in place.parent.glob(f".{glob.escape(place.name)}.*.part"):
        process = part.suffixes[-2].removeprefix(".")
        if process.isdecimal() and not _is_running(int(process)):
            part.unlink(missing_ok=True)


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it runs, and is somebody else's
        return True
    return True
