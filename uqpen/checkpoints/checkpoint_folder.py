"""Checkpoint of finished runs beside an archive until it is complete."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from uqpen.checkpoints.fingerprint_file import (
    FILE_NAME,
    encode_fingerprint,
    fingerprint_changes,
    read_fingerprint,
)
from uqpen.checkpoints.runs_file import (
    TEMPORARY,
    DamagedRunsError,
    FinishedRuns,
    read_runs,
    write_file,
    write_runs,
)
from uqpen.core.arrays import Arrays
from uqpen.core.errors import ArchiveError, CheckpointError
from uqpen.core.labels import MODELS, RUNS
from uqpen.core.status import Status
from uqpen.execution import Progress
from uqpen.execution.batch import BatchResult
from uqpen.execution.checkpoint import Checkpoint

__all__ = ["CheckpointFolder"]


# Run fingerprint of each design, by model and design.
Fingerprints = Mapping[tuple[str, str], Mapping[str, str]]

_NUMBER = "[0-9]" * 6

# Spend at most 1/6 of the time on checkpoints: wait five times as long as the last one took. It
# takes about a millisecond, so a run of more than 5 ms is saved at once.
_PATIENCE = 5

# A part grows and is written again each time, up to this number of times or of runs.
_MOST_WRITTEN, _MOST_RUNS = 64, 8192

_FAILED = tuple(status for status in Status if status > Status.INADMISSIBLE)

_MOST_LISTED = 6


class CheckpointFolder:
    """Folder of the finished runs while an archive is made.

    Parameters
    ----------
    folder : Path
        Beside the archive.
    fingerprints : mapping
        The run fingerprint of each design of the study, by model and design.
    progress : Progress
        Receives reports of damaged parts.
    """

    def __init__(self, folder: Path, fingerprints: Fingerprints, progress: Progress) -> None:
        self.folder = folder
        self.runs = 0
        self._fingerprints = fingerprints
        self._progress = progress
        self._open: list[_RoundCheckpoint] = []
        self._last = time.monotonic()
        self._cost = 0.0

    def check_compatibility(self) -> None:
        """Check that the study would still make the stored runs of its designs.

        Runs that were ended for their time are made again where the limit has changed.

        Raises
        ------
        CheckpointError
            Saying what has changed.
        """
        for (model, design), fingerprint in self._fingerprints.items():
            folder = self._runs_folder(model, design)
            if not _part_files(folder):
                # Unfinished files of an earlier start, perhaps of another study.
                _remove_checkpoint(folder)
                continue
            record = folder / FILE_NAME
            before = read_fingerprint(record)
            if before is None:
                # Without it nobody knows the study and settings of its runs.
                self._progress.warn(f"{record}: is damaged; the runs of {design} are made again")
                _remove_checkpoint(folder)
                continue
            texts = [
                each.text for each in fingerprint_changes(before, fingerprint) if not each.is_limit
            ]
            if texts:
                raise CheckpointError(_incompatibility_text(self.folder, design, texts))
            if before != fingerprint:
                self._discard(folder, [Status.TIMED_OUT])
                with self._writing():
                    write_file(record, encode_fingerprint(fingerprint))

    def remove_temporary_files(self) -> None:
        """Remove unfinished files of an earlier start.

        Raises
        ------
        ArchiveError
            If something else stands where runs are kept.
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise ArchiveError(f"{self.folder}: is no folder: runs are kept in one of this name")
        for name in (f"[0-9]*_{_NUMBER}.npz", FILE_NAME):
            for file in self.folder.rglob(f"{name}{TEMPORARY}"):
                _remove(file)

    def remove_all(self) -> None:
        """Remove all runs."""
        for folder in (RUNS, MODELS):
            _remove_checkpoint(self.folder / folder)

    def remove_archived(self) -> None:
        """Remove the runs that are now in the archive; keep those of other studies."""
        self._open.clear()
        for model, design in self._fingerprints:
            _remove_checkpoint(self._runs_folder(model, design))
        for file in sorted(self.folder.rglob(FILE_NAME)):
            whose = " of ".join(file.parent.relative_to(self.folder).parts[::-2])
            self._progress.warn(
                f"{self.folder}: still holds runs of {whose}, which this study does not have; "
                "remove them if they are not needed any more"
            )
        _remove_empty(self.folder)

    def checkpoint(self, design: str, model: str, number: int) -> Checkpoint:
        """Return the checkpoint of the runs of a model in a round of a design."""
        folder, fingerprint = self._runs_folder(model, design), self._fingerprints[model, design]
        kept = _RoundCheckpoint(self, folder, fingerprint, number)
        self._open.append(kept)
        return kept

    def read_runs(self, file: Path, columns: Arrays) -> FinishedRuns | None:
        """Read the runs of a part; None for a damaged part.

        Raises
        ------
        CheckpointError
            If they were made at other points.
        """
        try:
            result = read_runs(file)
        except DamagedRunsError:
            self._progress.warn(f"{file}: is damaged; its runs are made again")
            _remove(file)
            return None
        if not result.match_inputs(columns):
            change = "its points: has a file changed that the study names?"
            raise CheckpointError(_incompatibility_text(self.folder, file.parent.name, [change]))
        self.runs += len(result.runs)
        return result

    def save_if_due(self) -> None:
        """Write the finished runs if enough time has passed since the last time."""
        if time.monotonic() - self._last >= _PATIENCE * self._cost:
            self.save()

    def save(self) -> None:
        """Write all finished runs.

        Raises
        ------
        ArchiveError
            If that cannot be done.
        """
        began = time.monotonic()
        with self._writing():
            for kept in self._open:
                self.runs += kept.write()
        self._last = time.monotonic()
        self._cost = self._last - began

    def discard_failed(self) -> None:
        """Discard the missing runs, so that they are made again; keep the inadmissible ones."""
        for model, design in self._fingerprints:
            self._discard(self._runs_folder(model, design), _FAILED)

    def _discard(self, folder: Path, statuses: Collection[Status]) -> None:
        """Discard the runs of a design with some statuses."""
        with self._writing():
            for file in _part_files(folder):
                with contextlib.suppress(DamagedRunsError):  # reported when it is read
                    result = read_runs(file).without_statuses(statuses)
                    if result is None:
                        file.unlink()
                    else:
                        write_runs(file, result)

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """Return an error that states its consequences for the runs."""
        try:
            yield
        except OSError as error:
            raise ArchiveError(
                f"{self.folder}: finished runs cannot be kept: {error.strerror}\n"
                "  those kept before stay there, and the same command goes on from them"
            ) from None

    def _runs_folder(self, model: str, design: str) -> Path:
        root = self.folder / MODELS / model if model else self.folder
        return root / RUNS / design


class _RoundCheckpoint(Checkpoint):
    """Checkpoint of the runs of one model in one round of a design."""

    def __init__(
        self, kept: CheckpointFolder, folder: Path, fingerprint: Mapping[str, str], number: int
    ) -> None:
        self._checkpoint_folder = kept
        self._folder = folder
        self._fingerprint = fingerprint
        self._round = number
        self._columns: Arrays = {}
        self._batch_results: list[BatchResult] = []
        self._unwritten = 0
        self._written = 0
        self._number = 0

    def restore(self, inputs: Arrays) -> Iterator[BatchResult]:
        for file in _part_files(self._folder, str(self._round)):
            result = self._checkpoint_folder.read_runs(file, inputs)
            if result is not None:
                yield from result.batch_results()
            self._number = int(file.stem.partition("_")[2]) + 1

    def save(self, inputs: Arrays, batch_result: BatchResult) -> None:
        self._columns = inputs
        self._batch_results.append(batch_result)
        self._unwritten += len(batch_result)
        self._checkpoint_folder.save_if_due()

    def write(self) -> int:
        """Write the runs that are not written yet; return their number."""
        if not self._unwritten:
            return 0
        self._folder.mkdir(parents=True, exist_ok=True)
        record = self._folder / FILE_NAME
        if not record.exists():
            write_file(record, encode_fingerprint(self._fingerprint))
        result = FinishedRuns.from_batch_results(self._columns, self._batch_results)
        write_runs(self._folder / f"{self._round}_{self._number:06d}.npz", result)
        self._written += 1
        if self._written == _MOST_WRITTEN or len(result.runs) >= _MOST_RUNS:
            self._batch_results, self._written = [], 0
            self._number += 1
        written, self._unwritten = self._unwritten, 0
        return written


def _incompatibility_text(folder: Path, design: str, changed: list[str]) -> str:
    more = len(changed) - _MOST_LISTED
    lines = [*changed[:_MOST_LISTED], *([f"and {more} more"] if more > 0 else [])]
    listing = "\n".join(f"  {line}" for line in lines)
    return (
        f"{folder}: contains runs of {design} that were made with other settings:\n{listing}\n"
        "change the settings back to continue from these runs, or start over with --fresh"
    )


def _part_files(folder: Path, number: str = "[0-9]*") -> list[Path]:
    """List the files of runs in a folder: of one round, or of all."""
    return [file for file in sorted(folder.glob(f"{number}_{_NUMBER}.npz")) if file.is_file()]


def _remove_checkpoint(root: Path) -> None:
    """Remove the files of checkpoints below a folder, and folders that are then empty.

    Other files may stand beside them, above all where the folder is a link.

    Raises
    ------
    ArchiveError
        If that cannot be done.
    """
    for folder in [root, *root.rglob("*/")]:
        for file in [*_part_files(folder), folder / FILE_NAME]:
            _remove(file)
    _remove_empty(root)


def _remove(file: Path) -> None:
    """Remove a file if it exists.

    Raises
    ------
    ArchiveError
        If that cannot be done.
    """
    try:
        file.unlink(missing_ok=True)
    except OSError as error:
        raise ArchiveError(f"{file}: cannot be removed: {error.strerror}") from None


def _remove_empty(root: Path) -> None:
    """Remove a folder and its subfolders, as far as they are empty."""
    for folder in sorted([root, *root.rglob("*/")], reverse=True):
        with contextlib.suppress(OSError):  # it is not empty, or not there
            folder.rmdir()
