"""Checkpoint of finished runs beside an archive until it is complete."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from uqpen.checkpoints.block_store import block_stores
from uqpen.checkpoints.earlier_runs import RunSource
from uqpen.checkpoints.identity import (
    Change,
    encode_fingerprint,
    fingerprint_changes,
    list_changes,
    read_fingerprint,
    was_record_of,
)
from uqpen.checkpoints.parts import (
    MADE_OF,
    DamagedRunsError,
    FinishedRuns,
    has_runs,
    part_files,
    read_runs,
    remove,
    remove_checkpoint,
    remove_empty,
    remove_temporary,
    whole_blocks,
    write_file,
    write_runs,
)
from uqpen.checkpoints.round_checkpoint import RoundCheckpoint, ScratchCheckpoint
from uqpen.checkpoints.saving_pace import SavingPace
from uqpen.checkpoints.set_aside import (
    SET_ASIDE,
    set_aside,
    set_aside_design,
    set_aside_sources,
)
from uqpen.core.errors import ArchiveError, CheckpointError
from uqpen.core.labels import MODELS, RUNS
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.status import Status
from uqpen.execution import Progress
from uqpen.execution.checkpoint import Checkpoint

__all__ = ["FAILED", "CheckpointFolder"]


# Run fingerprint of each design, by model and design.
Fingerprints = Mapping[tuple[str, str], Mapping[str, str]]

# Reading a million finished runs for a comparison takes more than a tenth of a second.
_MANY = 2**16

FAILED = tuple(status for status in Status if status > Status.INADMISSIBLE)


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
    runs_in_memory : int
        A round that would make more runs of a design in memory goes by blocks.
    """

    def __init__(
        self,
        folder: Path,
        fingerprints: Fingerprints,
        progress: Progress,
        runs_in_memory: int = RUNS_IN_MEMORY,
    ) -> None:
        self.folder = folder
        self.runs_in_memory = runs_in_memory
        self.runs = 0
        self.joined = Counter[Path]()
        self._fingerprints = fingerprints
        self._progress = progress
        self._open: list[RoundCheckpoint] = []
        self._pace = SavingPace()

    def check_compatibility(self) -> None:
        """Check that the study would still make the stored runs of its designs.

        Runs that were ended for their time are made again where the limit has changed. Runs of a
        design whose own settings have changed are set aside: they are found by their inputs.

        Raises
        ------
        CheckpointError
            Saying what has changed.
        """
        for model, design in self._fingerprints:
            folder = self._runs_folder(model, design)
            if not has_runs(folder):
                # Unfinished files of an earlier start, perhaps of another study.
                remove_checkpoint(folder)
                continue
            record = folder / MADE_OF
            before, now = read_fingerprint(record), self._fingerprints[model, design]
            if before is None and was_record_of(record, now):
                self._progress.warn(f"{record}: is damaged; it was of this study, so its runs stay")
                with self.writing():
                    write_file(record, encode_fingerprint(now))
                continue
            if before is None:
                # Without it nobody knows the study and settings of its runs.
                self._progress.warn(f"{record}: is damaged; the runs of {design} are made again")
                remove_checkpoint(folder)
                continue
            self._check_runs(model, design, before)

    def _check_runs(self, model: str, design: str, before: Mapping[str, str]) -> None:
        """Check that the stored runs of a design, made with a fingerprint, would be made now."""
        folder, now = self._runs_folder(model, design), self._fingerprints[model, design]
        changes = [each for each in fingerprint_changes(before, now) if not each.is_limit]
        is_of_design = all(each.key.startswith(f"designs.{design}.") for each in changes)
        if changes and is_of_design and not whole_blocks(folder):
            with self.writing():
                set_aside(folder, self._model_folder(model))
        elif changes:
            raise CheckpointError(_incompatibility_text(self.folder, design, changes))
        elif before != now:
            self._discard(folder, [Status.TIMED_OUT])
            with self.writing():
                write_file(folder / MADE_OF, encode_fingerprint(now))

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
        for folder in (RUNS, MODELS, SET_ASIDE):
            remove_checkpoint(self.folder / folder)

    def set_aside_sources(self, model: str, fingerprint: Mapping[str, str]) -> list[RunSource]:
        """Return the runs that were set aside and that a model would make again."""
        sources = [*set_aside_sources(self._model_folder(model), fingerprint, self.read_runs)]
        self.runs += sum(len(source.runs.runs) for source in sources)
        return sources

    def remove_archived(self, used: Collection[Path]) -> None:
        """Remove the runs that are now in the archive; keep those of other studies.

        `used` are the folders of runs that were set aside, and are in the archive as well.
        """
        self._open.clear()
        for model, design in self._fingerprints:
            remove_checkpoint(self._runs_folder(model, design))
        for folder in used:
            remove_checkpoint(folder)
        for file in sorted(self.folder.rglob(MADE_OF)):
            whose = " of ".join(file.parent.relative_to(self.folder).parts[::-2])
            if file.parent.parent.name == SET_ASIDE:
                whose = set_aside_design(file.parent)
                if not whose:
                    remove_checkpoint(file.parent)
                    continue
            self._progress.warn(
                f"{self.folder}: still holds runs of {whose}, which this study does not have; "
                "remove them if they are not needed any more"
            )
        remove_empty(self.folder)

    def checkpoint(self, design: str, model: str, number: int) -> Checkpoint:
        """Return the checkpoint of the runs of a model in a round of a design."""
        folder, fingerprint = self._runs_folder(model, design), self._fingerprints[model, design]
        kept = RoundCheckpoint(self, folder, fingerprint, number)
        self._open.append(kept)
        return kept

    def scratch(self, design: str, model: str, number: int) -> Checkpoint:
        """Return a checkpoint that keeps many runs in a file, and no run for another start."""
        if not number:
            remove_checkpoint(self._runs_folder(model, design))
        return ScratchCheckpoint(self, self._runs_folder(model, design), {}, number)

    def read_runs(self, file: Path) -> FinishedRuns | None:
        """Read the runs of a part; None for a damaged part."""
        try:
            return read_runs(file)
        except DamagedRunsError:
            self.warn_of_damage(file)
            remove(file)
            return None

    def warn_of_damage(self, file: Path) -> None:
        """Say that some runs of a file are made again."""
        self._progress.warn(f"{file}: is damaged; its runs are made again")

    def points_error(self, design: str) -> CheckpointError:
        """Return the error for runs that were made at other points."""
        change = Change("points", "its points: has a file changed that the study names?")
        return CheckpointError(_incompatibility_text(self.folder, design, [change]))

    def save_if_due(self, unwritten: int) -> None:
        """Write the finished runs if enough time has passed, or a round has many unwritten ones."""
        if self._pace.is_due(unwritten):
            self.save()

    def save(self) -> None:
        """Write all finished runs.

        Raises
        ------
        ArchiveError
            If that cannot be done.
        """
        with self.writing(), self._pace.measured():
            for kept in self._open:
                self.runs += kept.write()

    def part_sources(self, model: str) -> list[RunSource]:
        """Return stored runs of a model's designs, of each about the first 65 536."""
        found = []
        for design in (design for name, design in self._fingerprints if name == model):
            count = 0
            for runs in self._stored(model, design):
                found.append(RunSource(self.folder.name, runs, is_complete=False, design=design))
                count += len(runs.runs)
                if count >= _MANY:
                    break
        return found

    def finished_runs(self) -> Iterator[tuple[str, FinishedRuns]]:
        """Yield the stored runs of each part, with the name of the model."""
        for model, design in self._fingerprints:
            yield from ((model, runs) for runs in self._stored(model, design))

    def _stored(self, model: str, design: str) -> Iterator[FinishedRuns]:
        """Yield the stored runs of a design, part by part."""
        folder = self._runs_folder(model, design)
        yield from filter(None, map(self.read_runs, part_files(folder)))
        for store in block_stores(folder):
            yield from store.finished_runs()

    def discard_failed(self) -> None:
        """Discard the missing runs, so that they are made again; keep the inadmissible ones."""
        for model, design in self._fingerprints:
            self._discard(self._runs_folder(model, design), FAILED)

    def _discard(self, folder: Path, statuses: Collection[Status]) -> None:
        """Discard the runs of a design with some statuses."""
        with self.writing():
            for store in block_stores(folder):
                store.discard(statuses)
            for file in part_files(folder):
                with contextlib.suppress(DamagedRunsError):  # reported when it is read
                    result = read_runs(file).without_statuses(statuses)
                    if result is None:
                        file.unlink()
                    else:
                        write_runs(file, result)

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Return an error of the disk as one that states its consequences for the runs."""
        try:
            yield
        except OSError as error:
            raise ArchiveError(
                f"{self.folder}: finished runs cannot be kept: {error.strerror}\n"
                "  those kept before stay there, and the same command goes on from them"
            ) from None

    def _runs_folder(self, model: str, design: str) -> Path:
        return self._model_folder(model) / RUNS / design

    def _model_folder(self, model: str) -> Path:
        return self.folder / MODELS / model if model else self.folder


def _incompatibility_text(folder: Path, design: str, changes: list[Change]) -> str:
    only_readings = all(change.is_reading for change in changes)
    to_read = "read their kept folders with --read-again,\n" if only_readings else ""
    return (
        f"{folder}: contains runs of {design} that were made with other settings:\n"
        f"{list_changes([change.text for change in changes])}\n"
        f"change the settings back to continue from these runs, {to_read}or start over with --fresh"
    )
