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
from uqpen.checkpoints.growing_part import GrowingPart
from uqpen.checkpoints.part_files import (
    part_files,
    part_number,
    part_path,
    remove,
    remove_checkpoint,
    remove_empty,
    remove_temporary,
)
from uqpen.checkpoints.runs_file import (
    DamagedRunsError,
    FinishedRuns,
    covered_count,
    read_runs,
    write_file,
    write_runs,
)
from uqpen.core.arrays import Arrays
from uqpen.core.errors import ArchiveError, CheckpointError
from uqpen.core.labels import MODELS, RUNS
from uqpen.core.status import Status
from uqpen.core.streams import BLOCK
from uqpen.execution import Progress
from uqpen.execution.batch import BatchResult
from uqpen.execution.checkpoint import Checkpoint

__all__ = ["CheckpointFolder"]


# Run fingerprint of each design, by model and design.
Fingerprints = Mapping[tuple[str, str], Mapping[str, str]]

# Spend at most 1/6 of the time on checkpoints: wait five times as long as the last one took. It
# takes about a millisecond, so a run of more than 5 ms is saved at once.
_PATIENCE = 5

# Runs of a round in memory that are not written yet: a few blocks, however cheap a run is.
_MOST_UNWRITTEN = 4 * BLOCK

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
            if not part_files(folder):
                # Unfinished files of an earlier start, perhaps of another study.
                remove_checkpoint(folder)
                continue
            record = folder / FILE_NAME
            before = read_fingerprint(record)
            if before is None:
                # Without it nobody knows the study and settings of its runs.
                self._progress.warn(f"{record}: is damaged; the runs of {design} are made again")
                remove_checkpoint(folder)
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
        remove_temporary(self.folder)

    def remove_all(self) -> None:
        """Remove all runs."""
        for folder in (RUNS, MODELS):
            remove_checkpoint(self.folder / folder)

    def remove_archived(self) -> None:
        """Remove the runs that are now in the archive; keep those of other studies."""
        self._open.clear()
        for model, design in self._fingerprints:
            remove_checkpoint(self._runs_folder(model, design))
        for file in sorted(self.folder.rglob(FILE_NAME)):
            whose = " of ".join(file.parent.relative_to(self.folder).parts[::-2])
            self._progress.warn(
                f"{self.folder}: still holds runs of {whose}, which this study does not have; "
                "remove them if they are not needed any more"
            )
        remove_empty(self.folder)

    def checkpoint(self, design: str, model: str, number: int) -> Checkpoint:
        """Return the checkpoint of the runs of a model in a round of a design."""
        folder, fingerprint = self._runs_folder(model, design), self._fingerprints[model, design]
        kept = _RoundCheckpoint(self, folder, fingerprint, number)
        self._open.append(kept)
        return kept

    def read_runs(self, file: Path) -> FinishedRuns | None:
        """Read the runs of a part; None for a damaged part."""
        try:
            return read_runs(file)
        except DamagedRunsError:
            self._progress.warn(f"{file}: is damaged; its runs are made again")
            remove(file)
            return None

    def points_error(self, design: str) -> CheckpointError:
        """Return the error for runs that were made at other points."""
        change = "its points: has a file changed that the study names?"
        return CheckpointError(_incompatibility_text(self.folder, design, [change]))

    def save_if_due(self, unwritten: int) -> None:
        """Write the finished runs if enough time has passed, or a round has many unwritten ones."""
        if unwritten >= _MOST_UNWRITTEN or time.monotonic() - self._last >= _PATIENCE * self._cost:
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

    def finished_runs(self) -> Iterator[tuple[str, FinishedRuns]]:
        """Yield the stored runs of each part, with the name of the model."""
        for model, design in self._fingerprints:
            for file in part_files(self._runs_folder(model, design)):
                if (result := self.read_runs(file)) is not None:
                    yield model, result

    def discard_failed(self) -> None:
        """Discard the missing runs, so that they are made again; keep the inadmissible ones."""
        for model, design in self._fingerprints:
            self._discard(self._runs_folder(model, design), _FAILED)

    def _discard(self, folder: Path, statuses: Collection[Status]) -> None:
        """Discard the runs of a design with some statuses."""
        with self._writing():
            for file in part_files(folder):
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
    """Checkpoint of the runs of one model in one round of a design, a part of a block in a file."""

    def __init__(
        self, kept: CheckpointFolder, folder: Path, fingerprint: Mapping[str, str], number: int
    ) -> None:
        self._checkpoint_folder = kept
        self._folder = folder
        self._fingerprint = fingerprint
        self._round = number
        self._stored: list[tuple[Path, int, int]] = []
        self._parts: dict[int, GrowingPart] = {}
        self._unwritten = 0
        self._number = 0

    def prepare(self, runs: int) -> int:
        ranges: list[tuple[int, int]] = []
        for file in part_files(self._folder, str(self._round)):
            result = self._checkpoint_folder.read_runs(file)
            self._number = part_number(file) + 1
            if result is None:
                continue
            found = result.ranges()
            if found[-1][1] > runs:
                raise self._checkpoint_folder.points_error(self._folder.name)
            self._stored.append((file, found[0][0], found[-1][1]))
            self._checkpoint_folder.runs += len(result.runs)
            ranges += found
        return covered_count(ranges)

    def restore(self, start: int, inputs: Arrays) -> Iterator[BatchResult]:
        stop = start + len(next(iter(inputs.values())))
        for file, first, end in self._stored:
            if first >= stop or end <= start:
                continue
            result = self._checkpoint_folder.read_runs(file)
            part = result.between(start, stop) if result else None
            if part and not part.match_inputs(inputs, start):
                raise self._checkpoint_folder.points_error(self._folder.name)
            if part:
                yield from part.batch_results()

    def save(self, inputs: Arrays, batch_result: BatchResult) -> None:
        first, stop = batch_result.start, batch_result.start + len(batch_result)
        for block in range(first // BLOCK, (stop - 1) // BLOCK + 1):
            result = batch_result.between(block * BLOCK, (block + 1) * BLOCK)
            places = slice(result.start - first, result.start - first + len(result))
            own = {name: values[places] for name, values in inputs.items()}
            self._parts.setdefault(block, GrowingPart()).add(own, result)
        self._unwritten += len(batch_result)
        self._checkpoint_folder.save_if_due(self._unwritten)

    def write(self) -> int:
        """Write the runs that are not written yet; return their number."""
        if not self._unwritten:
            return 0
        self._folder.mkdir(parents=True, exist_ok=True)
        record = self._folder / FILE_NAME
        if not record.exists():
            write_file(record, encode_fingerprint(self._fingerprint))
        for part in self._parts.values():
            if part.number is None:
                part.number, self._number = self._number, self._number + 1
            part.write(part_path(self._folder, self._round, part.number))
        # A part of an earlier block is not going to grow much.
        last = max(self._parts)
        self._parts = {last: self._parts[last]} if not self._parts[last].is_full else {}
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
