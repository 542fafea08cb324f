"""Runs that are kept beside an archive until it is there."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from textwrap import shorten
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from uqpen.errors import ArchiveError, KeptRunsError
from uqpen.evaluation import Progress
from uqpen.evaluation.keeper import Keeper
from uqpen.executors.work import Piece
from uqpen.labels import MODELS, RUNS, Status
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

_RECORD = "made_of.json"

# So many times as long as keeping took is waited before the next time, that it takes a sixth of
# all at most. It takes about a millisecond: so a run of more than 5 ms is kept at once.
_PATIENCE = 5

# A part grows, written anew each time, until it has been written so often or holds so many runs.
_MOST_WRITTEN, _MOST_RUNS = 64, 8192

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
            if not (folder / _RECORD).is_file():
                continue
            before = _read(folder / _RECORD)
            if before is None:
                # Without it nobody can tell what its runs are of.
                told = f"{folder / _RECORD}: is damaged; the runs of {design} are made again"
                self._progress.warned(told)
                shutil.rmtree(folder)
                continue
            changes = [change for change in _changes(before, made_of) if not _is_limit(change.key)]
            if changes:
                raise KeptRunsError(self._refusal(design, [change.text for change in changes]))
            if before != made_of:
                self._forget_late(folder, made_of)

    def clean(self) -> None:
        """Remove what an earlier start was about to write when it was ended."""
        for file in self.folder.rglob(f"*{TEMPORARY}"):
            file.unlink(missing_ok=True)

    def remove(self) -> None:
        """Remove all of it: it is in the archive now, or wanted no more."""
        self._open.clear()
        try:
            if self.folder.exists():
                shutil.rmtree(self.folder)
        except OSError as error:
            raise ArchiveError(f"{self.folder}: cannot be removed: {error.strerror}") from None

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
            file.unlink()
            return None
        if not part.are_of(columns):
            changes = ["its points: has a file changed that the study names?"]
            raise KeptRunsError(self._refusal(file.parent.name, changes))
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
            raise ArchiveError(
                f"{self.folder}: runs that are done cannot be kept: {error.strerror}\n"
                "  those kept before stay there, and the same command goes on from them"
            ) from None
        self._last = time.monotonic()
        self._cost = self._last - began

    def _forget_late(self, folder: Path, made_of: Mapping[str, str]) -> None:
        """Keep the runs of a design under a new limit, but for those that were ended for time."""
        for file in sorted(folder.glob("*.npz")):
            try:
                part = read_part(file).without(Status.TIMED_OUT)
            except DamagedPartError:
                continue  # it will be told when it is looked into
            if part is None:
                file.unlink()
            else:
                write_part(file, part)
        put_file(folder / _RECORD, _as_record(made_of))

    def _folder_of(self, model: str, design: str) -> Path:
        root = self.folder / MODELS / model if model else self.folder
        return root / RUNS / design

    def _refusal(self, design: str, changes: list[str]) -> str:
        more = len(changes) - _MOST_TOLD
        lines = [*changes[:_MOST_TOLD], *([f"and {more} more"] if more > 0 else [])]
        listing = "\n".join(f"  {line}" for line in lines)
        return (
            f"{self.folder}: holds runs of {design} that this study would not make; "
            f"what has changed:\n{listing}\n"
            "change it back to go on from them, or start over with --fresh"
        )


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
        for file in sorted(self._folder.glob(f"{self.round}_*.npz")):
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
        record = self._folder / _RECORD
        if not record.exists():
            put_file(record, _as_record(self._made_of))
        part = Part.of(self._columns, self._pieces)
        write_part(self._folder / f"{self.round}_{self._number:06d}.npz", part)
        self._written += 1
        if self._written == _MOST_WRITTEN or len(part.runs) >= _MOST_RUNS:
            self._pieces, self._written = [], 0
            self._number += 1
        written, self._unwritten = self._unwritten, 0
        return written


def _read(record: Path) -> dict[str, str] | None:
    """What decided the runs beside a record; None of one that is damaged."""
    try:
        content: Any = json.loads(record.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


def _as_record(made_of: Mapping[str, str]) -> bytes:
    return json.dumps(made_of, indent=1).encode()


class _Change(NamedTuple):
    """Something that decides runs and is not what it was: its key, and what a person reads."""

    key: str
    text: str


def _changes(before: Mapping[str, str], now: Mapping[str, str]) -> Iterator[_Change]:
    for key in {**before, **now}:
        if before.get(key) != now.get(key):
            was, is_now = (shorten(str(each.get(key, "not there")), 60) for each in (before, now))
            yield _Change(key, f"{key} was {was}, is {is_now}")


def _is_limit(key: str) -> bool:
    return key.startswith("model") and key.endswith(".time_limit")
