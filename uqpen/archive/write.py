"""Writing an archive: whole, under its own name, or not at all."""

from __future__ import annotations

import filecmp
import glob
import hashlib
import os
import shutil
from pathlib import Path

import xarray as xr

from uqpen.archive.hashes import append_checksum, hash_record
from uqpen.archive.netcdf import write_tree
from uqpen.archive.read import is_archive
from uqpen.core.errors import ArchiveError

# Digits of a hash in the name of an archive that is kept.
_DIGITS = 8


def prepare_destination(path: Path) -> None:
    """Make sure, before any model runs, that an archive can be written.

    ArchiveError if `path` is a folder or a file of another kind, or its folder cannot be written
    to.
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


def write(tree: xr.DataTree, path: Path, *, keeps_earlier: bool = False) -> Path | None:
    """Write a study's tree as one NetCDF file, with the hashes of its groups.

    The file is written under a temporary name next to `path`, flushed to the disk and then renamed
    in one step. Until then an existing file remains.

    Parameters
    ----------
    tree : DataTree
        The archive.
    path : Path
        Its file.
    keeps_earlier : bool
        Whether another archive at `path` is kept beside it, under a name with a part of its hash.

    Returns
    -------
    Path or None
        The archive that is kept; None where there was none, or one of the same bytes.

    Raises
    ------
    ArchiveError
        If it cannot be written, for example to a full disk. No temporary file remains, and an
        earlier archive is where it was.
    """
    temporary = _temporary_path(path)
    kept = None
    try:
        write_tree(tree, temporary, hash_record(tree))
        append_checksum(temporary)
        if keeps_earlier and path.exists() and not filecmp.cmp(temporary, path, shallow=False):
            kept = _keep(path)
        temporary.replace(os.path.realpath(path))
    except ArchiveError:
        raise
    except (OSError, RuntimeError) as error:
        # The NetCDF library reports a full disk as a RuntimeError about HDF.
        if isinstance(error, RuntimeError) and not str(error).startswith("NetCDF:"):
            raise
        reason = getattr(error, "strerror", None) or f"{error} (is the disk full?)"
        raise ArchiveError(f"{path}: cannot be written: {reason}") from error
    finally:
        temporary.unlink(missing_ok=True)
    return kept


def _keep(path: Path) -> Path:
    """Give an archive a second name, which its content determines; return it."""
    with path.open("rb") as stream:
        digits = hashlib.file_digest(stream, "sha256").hexdigest()[:_DIGITS]
    kept = path.with_name(f"{path.stem}.{digits}{path.suffix}")
    if kept.exists() and not kept.is_file():
        found = "is no file, and the earlier archive would be kept under this name"
        raise ArchiveError(f"{kept}: {found}")
    if not kept.exists():
        try:
            kept.hardlink_to(os.path.realpath(path))
        except OSError:  # some file systems have no links
            copy = _temporary_path(kept)
            try:
                shutil.copyfile(path, copy)
                copy.replace(kept)
            finally:
                copy.unlink(missing_ok=True)
    return kept


def _temporary_path(path: Path) -> Path:
    """Return the temporary path of an archive, next to the file that it replaces."""
    place = Path(os.path.realpath(path))
    return place.with_name(f".{place.name}.{os.getpid()}.part")


def _remove_leftovers(path: Path) -> None:
    """Remove the parts that processes have left that were killed while they wrote."""
    place = Path(os.path.realpath(path))
    for part in place.parent.glob(f".{glob.escape(place.name)}.*.part"):
        process = part.suffixes[-2].removeprefix(".")
        if process.isdecimal():
            try:
                os.kill(int(process), 0)
            except ProcessLookupError:
                part.unlink(missing_ok=True)
            except OSError:  # it runs, and is somebody else's
                continue
