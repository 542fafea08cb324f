"""Study of an archive together with its original files, which are temporary."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from uqpen.archive.files import FILES, ArchivedFile, archived_files, extract_files, files_by_name
from uqpen.archive.read import read_group
from uqpen.core.errors import ArchiveError, StudyError, UqpenError
from uqpen.study.document import Objects
from uqpen.study.study import ValidatedStudy
from uqpen.verification.archived_study import archived_study

__all__ = ["RestoredStudy", "restored_study", "with_kept_folders"]


class RestoredStudy(NamedTuple):
    """A study of an archive that can be repeated.

    Either its files are the archived ones (`has_kept_files`), or each that differs has a line.
    """

    study: ValidatedStudy
    has_kept_files: bool
    different_files: list[str]


@contextlib.contextmanager
def restored_study(
    tree: xr.DataTree, folder: Path | None, *, trust: bool, objects: Objects | None = None
) -> Iterator[RestoredStudy]:
    """Provide an archive's study such that it can be repeated.

    Parameters
    ----------
    tree : DataTree
        An archive without faults.
    folder : Path or None
        Folder with the files that the study names; None for the archived files. Files that the
        archive has only as hashes are then taken from the current folder.
    trust, objects
        As for `archived_study`.

    Raises
    ------
    ArchiveError
        If its files do not match their hashes, or cannot be in a folder.
    StudyError
        If the study cannot be read, for example because a file that it names is missing.
    """
    here = Path.cwd()
    files = archived_files(read_group(tree, FILES))
    if folder is not None or not files:
        folder = folder or here
        study = archived_study(tree, folder, trust=trust, objects=objects)
        differing = _different_files(study, files, folder.absolute())
        _refuse_substitutes(files, differing)
        yield RestoredStudy(study, has_kept_files=False, different_files=list(differing.values()))
        return
    with extract_files(files, here) as (place, missing):
        try:
            study = archived_study(tree, place, trust=trust, objects=objects)
        except UqpenError as error:
            raise _without_temporary_folder(error, place, missing) from None
        differing = _different_files(study, files, None)
        if differing:
            advice = "named by an absolute path, and changed since then (use it anyway: --folder)"
            raise ArchiveError("\n".join([*differing.values(), advice]))
        yield RestoredStudy(study, has_kept_files=True, different_files=[])


def with_kept_folders(study: ValidatedStudy, folder: Path) -> ValidatedStudy:
    """Return a study whose programs keep the folders of their runs in another folder.

    Programs of several models get a folder each in that folder, when the first one is kept.
    """
    models = {
        name: variant.with_model(variant.model.with_folder(folder / name))
        for name, variant in study.models.items()
    }
    return replace(study, models=models)


def _different_files(
    study: ValidatedStudy, files: Sequence[ArchivedFile], folder: Path | None
) -> dict[str, str]:
    """Return the difference of each file from the archived one, including files in a folder."""
    kept = {file.name: file.sha256 for file in files}
    read = {name: file.sha256 for name, file in files_by_name(study.files(), study.folder).items()}
    beside = {name: _sha256(folder / name) for name in kept.keys() - read.keys() if folder}
    differing = {name: f"{name}: is not there" for name, found in beside.items() if not found}
    for name, found in sorted({**read, **beside}.items()):
        # An absolute path can have been another on the machine that made the archive.
        if found and found != kept.get(name) and found not in kept.values():
            expected = kept.get(name, "none, as the archive has no such file")
            differing[name] = f"{name}: found the SHA-256 {found}, expected {expected}"
    return differing


def _refuse_substitutes(files: Sequence[ArchivedFile], differing: dict[str, str]) -> None:
    """Refuse others in place of files that the archive knows by their hashes alone."""
    known = {file.name for file in files if not file.is_whole}
    refused = [reason for name, reason in differing.items() if name in known]
    if refused:
        raise ArchiveError("\n".join(refused))


def _sha256(path: Path) -> str:
    """Return the hash of a file; empty where there is none."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
    except (OSError, ValueError):
        return ""


def _without_temporary_folder(error: UqpenError, place: Path, missing: Sequence[str]) -> UqpenError:
    """Return an error whose message does not name the temporary folder."""
    message = str(error).partition("\n\nthe files that it names")[0]
    message = message.replace(f"{place}{os.sep}", "")
    advice = "the files that it names are the archived ones (others: --folder)"
    problems = error.problems if isinstance(error, StudyError) else ()
    return StudyError("\n".join([message, "", *missing, advice]), problems)
