"""Runs that are kept beside an archive until it is there."""

from __future__ import annotations

import contextlib
import shutil
import time
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from uqpen.errors import ArchiveError, KeptRunsError
from uqpen.evaluation import Progress
from uqpen.evaluation.keeper import Keeper
from uqpen.executors.work import Piece
from uqpen.labels import MODELS, RUNS, Status
from uqpen.making.made_of import RECORD, as_record, changes, read_record
from uqpen.making.part import (
    TEMPORARY,
    DamagedPartError,
    Part,
    put_file,
    read_part,
    write_part,
)

__all__ = ["KeptRuns"]

Columns = Mapping[str, npt.NDArray[np.float64]]
# What decides the runs of each design, by model and design.
MadeOf = Mapping[tuple[str, str], Mapping[str, str]]

_NUMBER = "[0-9]" * 6

# So many times as long as keeping took is waited before the next time, that it takes a sixth of
# all at most. It takes about a millisecond: so a run of more than 5 ms is kept at once.
_PATIENCE = 5

# A part grows, written anew each time, until it has been written so often or holds so many runs.
_MOST_WRITTEN, _MOST_RUNS = 64, 8192

_LOST = tuple(status for status in Status if status > Status.INADMISSIBLE)

_MOST_TOLD = 6


class KeptRuns:
    """The folder of the runs that are done, while an archive is made.

    Parameters
    ----------
    folder : Path
        Beside the archive.
    made_of : mapping
        What decides the runs of each design of the study, by model and design.
    progress : Progress
        Told of parts that are damaged.
    """

    def __init__(self, folder: Path, made_of: MadeOf, progress: Progress) -> None:
        self.folder = folder
        self.runs = 0
        self._made_of = made_of
        self._progress = progress
        self._open: list[_KeptDesign] = []
        self._last = time.monotonic()
        self._cost = 0.0

    def refuse_others(self) -> None:
        """Refuse runs of the study's designs that it would not make any more.

        Runs that were ended for their time are made again where the limit has changed.

        Raises
        ------
        KeptRunsError
            Saying what has changed.
        """
        for (model, design), made_of in self._made_of.items():
            folder = self._folder_of(model, design)
            if not any(folder.glob("*.npz")):
                # What an earlier start was about to keep, of another study perhaps.
                _remove(folder)
                continue
            before = read_record(folder / RECORD)
            if before is None:
                # Without it nobody can tell what its runs are of.
                record = folder / RECORD
                self._progress.warned(f"{record}: is damaged; the runs of {design} are made again")
                _remove(folder)
                continue
            told = [each.text for each in changes(before, made_of) if not each.is_of_limit]
            if told:
                raise KeptRunsError(_refusal(self.folder, design, told))
            if before != made_of:
                self._forget(folder, [Status.TIMED_OUT])
                self._note(folder, made_of)

    def clean(self) -> None:
        """Remove what an earlier start was about to write when it was ended.

        Raises
        ------
        ArchiveError
            If something else stands where runs are kept.
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise ArchiveError(f"{self.folder}: is no folder: runs are kept in one of this name")
        for ending in (".npz", RECORD):
            for file in self.folder.rglob(f"*{ending}{TEMPORARY}"):
                _remove(file)

    def remove(self) -> None:
        """Remove all runs: they are wanted no more."""
        for folder in (RUNS, MODELS):
            _remove(self.folder / folder)

    def finish(self) -> None:
        """Remove what is in the archive now; runs that this study does not have stay there."""
        self._open.clear()
        for model, design in self._made_of:
            _remove(self._folder_of(model, design))
        for file in sorted(self.folder.rglob(RECORD)):
            whose = " of ".join(file.parent.relative_to(self.folder).parts[::-2])
            self._progress.warned(
                f"{self.folder}: still holds runs of {whose}, which this study does not have; "
                "remove them if they are wanted no more"
            )
        _remove_empty(self.folder)

    def keeper(self, design: str, model: str, number: int) -> Keeper:
        """Who keeps the runs of a round of a design by a model."""
        kept = _KeptDesign(self, self._folder_of(model, design), self._made_of[model, design])
        kept.round = number
        self._open.append(kept)
        return kept

    def found(self, file: Path, columns: Columns) -> Part | None:
        """The runs of a part; none of one that is damaged.

        Raises
        ------
        KeptRunsError
            If they were made at other points.
        """
        try:
            part = read_part(file)
        except DamagedPartError:
            self._progress.warned(f"{file}: is damaged; its runs are made again")
            _remove(file)
            return None
        if not part.are_of(columns):
            change = "its points: has a file changed that the study names?"
            raise KeptRunsError(_refusal(self.folder, file.parent.name, [change]))
        self.runs += len(part.runs)
        return part

    def keep_if_due(self) -> None:
        """Write what is done, if it was not done too short a time ago."""
        if time.monotonic() - self._last >= _PATIENCE * self._cost:
            self.keep()

    def keep(self) -> None:
        """Write all that is done.

        Raises
        ------
        ArchiveError
            If that cannot be done.
        """
        began = time.monotonic()
        try:
            for kept in self._open:
                self.runs += kept.write()
        except OSError as error:
            raise _unkept(self.folder, error) from None
        self._last = time.monotonic()
        self._cost = self._last - began

    def forget_lost(self) -> None:
        """Have the runs made again that were kept as lost; inadmissible points are no such."""
        for model, design in self._made_of:
            self._forget(self._folder_of(model, design), _LOST)

    def _forget(self, folder: Path, statuses: Collection[Status]) -> None:
        """Keep the runs of a design but for those that ended so."""
        try:
            for file in sorted(folder.glob("*.npz")):
                with contextlib.suppress(DamagedPartError):  # told when it is looked into
                    part = read_part(file).without(statuses)
                    if part is None:
                        file.unlink()
                    else:
                        write_part(file, part)
        except OSError as error:
            raise _unkept(self.folder, error) from None

    def _note(self, folder: Path, made_of: Mapping[str, str]) -> None:
        """Have the record beside runs say what decides them now."""
        try:
            put_file(folder / RECORD, as_record(made_of))
        except OSError as error:
            raise _unkept(self.folder, error) from None

    def _folder_of(self, model: str, design: str) -> Path:
        root = self.folder / MODELS / model if model else self.folder
        return root / RUNS / design


class _KeptDesign(Keeper):
    """The runs that are kept of one model in one round of a design."""

    round = 0

    def __init__(self, kept: KeptRuns, folder: Path, made_of: Mapping[str, str]) -> None:
        self._kept = kept
        self._folder = folder
        self._made_of = made_of
        self._columns: Columns = {}
        self._pieces: list[Piece] = []
        self._unwritten = 0
        self._written = 0
        self._number = 0

    def found(self, inputs: Columns) -> Iterator[Piece]:
        for file in sorted(self._folder.glob(f"{self.round}_{_NUMBER}.npz")):
            part = self._kept.found(file, inputs)
            if part is not None:
                yield from part.pieces()
            self._number = int(file.stem.partition("_")[2]) + 1

    def keep(self, inputs: Columns, piece: Piece) -> None:
        self._columns = inputs
        self._pieces.append(piece)
        self._unwritten += len(piece)
        self._kept.keep_if_due()

    def write(self) -> int:
        """Write what is not written yet; how many runs that is."""
        if not self._unwritten:
            return 0
        self._folder.mkdir(parents=True, exist_ok=True)
        record = self._folder / RECORD
        if not record.exists():
            put_file(record, as_record(self._made_of))
        part = Part.of(self._columns, self._pieces)
        write_part(self._folder / f"{self.round}_{self._number:06d}.npz", part)
        self._written += 1
        if self._written == _MOST_WRITTEN or len(part.runs) >= _MOST_RUNS:
            self._pieces, self._written = [], 0
            self._number += 1
        written, self._unwritten = self._unwritten, 0
        return written


def _refusal(folder: Path, design: str, changed: list[str]) -> str:
    more = len(changed) - _MOST_TOLD
    lines = [*changed[:_MOST_TOLD], *([f"and {more} more"] if more > 0 else [])]
    listing = "\n".join(f"  {line}" for line in lines)
    return (
        f"{folder}: holds runs of {design} that this study would not make; "
        f"what has changed:\n{listing}\n"
        "change it back to go on from them, or start over with --fresh"
    )


def _unkept(folder: Path, error: OSError) -> ArchiveError:
    return ArchiveError(
        f"{folder}: runs that are done cannot be kept: {error.strerror}\n"
        "  those kept before stay there, and the same command goes on from them"
    )


def _remove(path: Path) -> None:
    """Remove a file, or a folder with all that it holds, if it is there.

    Raises
    ------
    ArchiveError
        If that cannot be done.
    """
    try:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be removed: {error.strerror}") from None


def _remove_empty(root: Path) -> None:
    """Remove a folder and those within it, as far as nothing is in them."""
    for folder in sorted([root, *root.rglob("*/")], reverse=True):
        with contextlib.suppress(OSError):  # it is not empty, or not there
            folder.rmdir()
