"""Archives whose runs a study may take: the one that it replaces, and others that are named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from uqpen.archive.provenance import provenance_differences
from uqpen.checkpoints.archived_runs import archived_sources, open_intact, unused_designs
from uqpen.checkpoints.identity import list_changes
from uqpen.checkpoints.journal import Journal
from uqpen.checkpoints.sources import RunSource
from uqpen.core.errors import ArchiveError, CheckpointError
from uqpen.study.study import ValidatedStudy
from uqpen.workflow import root_attributes

__all__ = [
    "EarlierArchive",
    "log_path",
    "open_named",
    "open_replaced",
    "shown_path",
    "sources_of_archives",
]


class EarlierArchive(NamedTuple):
    """Archive of an earlier study.

    Attributes
    ----------
    place : str
        Its path, for display.
    tree : DataTree
        Its content.
    log : Path
        The log beside it.
    is_named : bool
        True if the user has named it, so that it is a mistake if none of its runs can be taken.
    """

    place: str
    tree: xr.DataTree
    log: Path
    is_named: bool


def open_replaced(path: Path, journal: Journal) -> EarlierArchive | None:
    """Read the archive that the new one replaces; None, with a note, where it cannot be used."""
    if not path.exists():
        return None
    place = shown_path(path)
    try:
        return EarlierArchive(place, open_intact(path), log_path(path), is_named=False)
    except ArchiveError as error:
        reason = str(error).removeprefix(f"{path}: ")
        journal.inform(f"{place}: none of its runs is taken: {reason}")
        return None


def open_named(paths: Sequence[str | Path], replaced: Path) -> list[EarlierArchive]:
    """Read the archives that the user has named; `replaced` is left out.

    Raises
    ------
    ArchiveError
        If one cannot be read, or is no archive of a study.
    """
    others = [Path(path) for path in paths]
    return [
        EarlierArchive(shown_path(path), open_intact(path), log_path(path), is_named=True)
        for path in others
        if path.resolve() != replaced.resolve()
    ]


def sources_of_archives(
    study: ValidatedStudy, archives: Sequence[EarlierArchive], journal: Journal
) -> Mapping[str, list[RunSource]]:
    """Return the runs that each model of a study may take from archives, by the model's name.

    Raises
    ------
    CheckpointError
        If an archive that the user has named has no runs of any of the models; it states what has
        changed.
    """
    found: dict[str, list[RunSource]] = {name: [] for name in study.models}
    for archive in archives:
        changes: list[str] = []
        runs = 0
        for name, sources in found.items():
            archived = archived_sources(study, name, archive.tree, archive.place)
            sources += archived.sources
            runs += sum(len(source.runs.runs) for source in archived.sources)
            changes += archived.changes
        if runs:
            journal.write_line(f"{archive.place}: {_made_with(study, archive.tree)}")
        elif not changes:
            if archive.is_named:
                reasons = "; ".join(f"{k}: {v}" for k, v in unused_designs(archive.tree).items())
                raise CheckpointError(
                    f"{archive.place}: none of its runs can be taken: {reasons}\n"
                    "leave it out to make all runs"
                )
        elif archive.is_named:
            raise CheckpointError(
                f"{archive.place}: its runs cannot be taken, as they are of another model:\n"
                f"{list_changes(changes)}\nleave it out to make all runs"
            )
        else:
            journal.inform(
                f"{archive.place}: none of its runs is taken, as they are of another model:\n"
                f"{list_changes(changes)}"
            )
    return found


def _made_with(study: ValidatedStudy, tree: xr.DataTree) -> str:
    """Return the provenance of an archive, for the log."""
    differences = provenance_differences(tree.attrs, root_attributes(study))
    texts = ", ".join(f"{name} {one} (here {other})" for name, one, other in differences)
    origin = f"study {str(tree.attrs['study_sha256'])[:16]}"
    return f"{origin}, made with {texts or 'the same versions and kind of processor as here'}"


def log_path(archive: Path) -> Path:
    """Return the path of the log beside an archive."""
    return archive.absolute().with_name(f"{archive.name}.log")


def shown_path(path: Path) -> str:
    """Return a path as short as it can be written here."""
    path = path.absolute()
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)
