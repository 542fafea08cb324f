"""Folder of finished runs beside an archive until it is complete: a checkpoint of each round."""

from __future__ import annotations

import contextlib
import time
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain, count, groupby
from pathlib import Path

import numpy as np
import xarray as xr

from uqpen.checkpoints.identity import (
    Change,
    encode_fingerprint,
    fingerprint_changes,
    list_changes,
    read_fingerprint,
    was_record_of,
)
from uqpen.checkpoints.sources import SET_ASIDE, PointIndex, RunSource, first_points
from uqpen.checkpoints.stored_runs import (
    MADE_OF,
    BlockStore,
    DamagedRunsError,
    FinishedRuns,
    GrowingPart,
    block_stores,
    covered_count,
    has_runs,
    part_files,
    part_number,
    part_path,
    read_runs,
    remove,
    remove_checkpoint,
    remove_empty,
    remove_temporary,
    whole_blocks,
    write_file,
    write_runs,
)
from uqpen.core.arrays import Arrays
from uqpen.core.blocks import join_blocks
from uqpen.core.errors import ArchiveError, CheckpointError
from uqpen.core.labels import MODELS, RUN, RUNS
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.model import Results
from uqpen.core.status import Status
from uqpen.core.streams import BLOCK
from uqpen.execution import Progress
from uqpen.execution.batch import BatchResult
from uqpen.execution.checkpoint import Checkpoint
from uqpen.study.identity import model_identity
from uqpen.study.study import ONLY_MODEL, ValidatedStudy

# Run fingerprint of each design, by model and design.
Fingerprints = Mapping[tuple[str, str], Mapping[str, str]]

# Reading a million finished runs for a comparison takes more than a tenth of a second.
_MANY = 2**16

# Spend at most 1/6 of the time on checkpoints: wait five times as long as the last one took. It
# takes about a millisecond, so a run of more than 5 ms is saved at once.
_PATIENCE = 5

# Runs of a round in memory that are not written yet: a few blocks, however cheap a run is.
_MOST_UNWRITTEN = 4 * BLOCK

FAILED = tuple(status for status in Status if status > Status.INADMISSIBLE)

# Seconds of work that a kill may cost where whole blocks are kept anyway.
_WORTH_A_PART = 10.0


class CheckpointFolder:
    """Folder of the finished runs while an archive is made.

    Unfinished files of an earlier start are removed from it.

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

    Raises
    ------
    ArchiveError
        If something else stands where runs are kept.
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
        self.runs = 0  # finished ones in it
        self.joined = Counter[Path]()  # runs in memory so far, by the folder of their design
        self._fingerprints = fingerprints
        self._progress = progress
        self._open: list[_RoundCheckpoint] = []
        self._saved, self._cost = time.monotonic(), 0.0
        if folder.exists() and not folder.is_dir():
            raise ArchiveError(f"{folder}: is no folder: runs are kept in one of this name")
        remove_temporary(folder)

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
            # Into a folder of their own; a kill in between loses none.
            with self.writing():
                target = _new_set_aside(self._model_folder(model))
                write_file(target / MADE_OF, (folder / MADE_OF).read_bytes())
                for file in part_files(folder):
                    file.rename(target / file.name)
                (folder / MADE_OF).unlink()
        elif changes:
            raise CheckpointError(_incompatibility_text(self.folder, design, changes))
        elif before != now:
            self._discard(folder, [Status.TIMED_OUT])
            with self.writing():
                write_file(folder / MADE_OF, encode_fingerprint(now))

    def remove_all(self) -> None:
        """Remove all runs."""
        for folder in (RUNS, MODELS, SET_ASIDE):
            remove_checkpoint(self.folder / folder)

    def set_aside_sources(self, model: str, fingerprint: Mapping[str, str]) -> list[RunSource]:
        """Return the runs that were set aside and that a model would make again."""
        found = []
        folders = (self._model_folder(model) / SET_ASIDE).glob("[0-9]*")
        for folder in sorted(folder for folder in folders if folder.is_dir()):
            before = read_fingerprint(folder / MADE_OF) or {}
            of_model = ("model", "constraints.")
            known = [key for key in before if key in fingerprint or key.startswith(of_model)]
            own = {key: before[key] for key in known}
            changes = list(fingerprint_changes(own, fingerprint))
            if not before or not all(change.is_limit for change in changes):
                continue
            design = _set_aside_design(folder)
            for _, files in groupby(part_files(folder), lambda file: file.stem.partition("_")[0]):
                latest_first = sorted(files, key=part_number, reverse=True)
                if not (parts := [*filter(None, map(self.read_runs, latest_first))]):
                    continue
                runs = FinishedRuns.joined(parts)
                # Each run once, in ascending order; of one that several parts have, the latest.
                _, first = np.unique(runs.runs, return_index=True)
                source = RunSource(
                    "those kept before",
                    runs.select(first),
                    is_complete=False,
                    folder=folder,
                    changed_design=design,
                    design=design,
                )
                found.append(source.without_statuses([Status.TIMED_OUT] if changes else []))
        sources = [*filter(None, found)]
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
                whose = _set_aside_design(file.parent)
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
        self._open.append(_RoundCheckpoint(self, folder, fingerprint, number))
        return self._open[-1]

    def scratch(self, design: str, model: str, number: int) -> Checkpoint:
        """Return a checkpoint that keeps many runs in a file, and no run for another start."""
        if not number:
            remove_checkpoint(self._runs_folder(model, design))
        return _ScratchCheckpoint(self, self._runs_folder(model, design), {}, number)

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
        is_over = time.monotonic() - self._saved >= _PATIENCE * self._cost
        if is_over or unwritten >= _MOST_UNWRITTEN:
            self.save()

    def save(self) -> None:
        """Write all finished runs.

        Raises
        ------
        ArchiveError
            If that cannot be done.
        """
        began = time.monotonic()
        with self.writing():
            for each in self._open:
                self.runs += each.write()
        self._saved = time.monotonic()
        self._cost = self._saved - began

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


def _set_aside_design(folder: Path) -> str:
    """Return the design that runs were made for; empty for runs that only tried a model."""
    fingerprint = read_fingerprint(folder / MADE_OF) or {}
    names = (key.split(".")[1] for key in fingerprint if key.startswith("designs."))
    return next(names, "")


def _incompatibility_text(folder: Path, design: str, changes: list[Change]) -> str:
    only_readings = all(change.is_reading for change in changes)
    to_read = "read their kept folders with --read-again,\n" if only_readings else ""
    return (
        f"{folder}: contains runs of {design} that were made with other settings:\n"
        f"{list_changes([change.text for change in changes])}\n"
        f"change the settings back to continue from these runs, {to_read}or start over with --fresh"
    )


class _RoundCheckpoint(Checkpoint):
    """Checkpoint of the runs of one model in one round of a design, a part of a block in a file."""

    def __init__(
        self, store: CheckpointFolder, folder: Path, fingerprint: Mapping[str, str], number: int
    ) -> None:
        self._store = store
        self._folder = folder
        self._fingerprint = fingerprint
        self._round = number
        self._stored: list[tuple[Path, int, int]] = []
        self._parts: dict[int, GrowingPart] = {}
        self._written: dict[int, set[Path]] = {}
        self._unwritten = 0
        self._number = 0
        self._blocks: BlockStore | None = None
        self._files: frozenset[str] = frozenset()
        self._since = time.monotonic()

    def prepare(self, runs: int) -> int:
        ranges: list[tuple[int, int]] = []
        if runs > BLOCK and self._store.joined[self._folder] + runs > self._store.runs_in_memory:
            self._blocks = BlockStore(self._folder, self._round, runs)
            ranges += self._blocks.ranges
            self._store.runs += covered_count(ranges)
        else:
            self._store.joined[self._folder] += runs
        for file in part_files(self._folder, str(self._round)):
            result = self._store.read_runs(file)
            self._number = part_number(file) + 1
            if result is None:
                continue
            found = result.ranges()
            if found[-1][1] > runs:
                raise self._store.points_error(self._folder.name)
            self._stored.append((file, found[0][0], found[-1][1]))
            self._store.runs += len(result.runs)
            ranges += found
        return covered_count(ranges)

    def restore(self, start: int, inputs: Arrays) -> Iterator[BatchResult]:
        stop = start + len(next(iter(inputs.values())))
        if whole := self._read_block(start):
            if not whole.match_inputs(inputs, start):
                raise self._store.points_error(self._folder.name)
            yield from whole.batch_results()
            return
        for file, first, end in self._stored:
            if first >= stop or end <= start:
                continue
            result = self._store.read_runs(file)
            part = result.between(start, stop) if result else None
            if part and not part.match_inputs(inputs, start):
                raise self._store.points_error(self._folder.name)
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
        self._files |= batch_result.results.files
        if (
            self._blocks
            and self._unwritten < 4 * BLOCK
            and time.monotonic() - self._since < _WORTH_A_PART
        ):
            return
        if any(part.is_large for part in self._parts.values()):
            self._store.save()
        else:
            self._store.save_if_due(self._unwritten)

    def write(self) -> int:
        """Write the runs that are not written yet; return their number."""
        if not self._unwritten:
            return 0
        self._write_fingerprint()
        for block, part in self._parts.items():
            if part.number is None:
                part.number, self._number = self._number, self._number + 1
            path = part_path(self._folder, self._round, part.number)
            part.write(path)
            self._written.setdefault(block, set()).add(path)
        # A part of an earlier block is not going to grow much.
        last = max(self._parts)
        self._parts = {last: self._parts[last]} if not self._parts[last].is_full else {}
        written, self._unwritten = self._unwritten, 0
        self._since = time.monotonic()
        return written

    def collect(self, blocks: Iterable[xr.Dataset], runs: int) -> xr.Dataset:
        coming = iter(blocks)
        first = next(coming)  # before it, nothing is prepared
        if self._blocks is None:
            joined = join_blocks(chain([first], coming), runs)
            # Many runs are safe before they are analysed, and not in memory a second time.
            if self._unwritten >= BLOCK:
                self._store.save()
            return joined
        for block in chain([first], coming):
            self._keep(self._blocks, block)
        return self._blocks.dataset()

    def _keep(self, store: BlockStore, block: xr.Dataset) -> None:
        """Move a whole block to the file of blocks, and remove its parts."""
        start, stop = int(block[RUN].values[0]), int(block[RUN].values[-1]) + 1
        parts = {file for file, first, end in self._stored if start <= first and end <= stop}
        parts |= self._written.pop(start // BLOCK, set())
        with self._store.writing():
            self._write_fingerprint()
            store.add(block, self._files, safely=bool(parts))
        unwritten = self._parts.pop(start // BLOCK, GrowingPart()).unwritten
        self._unwritten -= unwritten
        self._store.runs += unwritten
        for file in parts:
            remove(file)
        self._stored = [each for each in self._stored if each[0] not in parts]
        self._since = time.monotonic()

    def _read_block(self, start: int) -> FinishedRuns | None:
        """Return the whole block that begins with a run; None if it is not kept as a whole."""
        if self._blocks is None:
            return None
        try:
            return self._blocks.read(start)
        except DamagedRunsError as error:
            self._store.warn_of_damage(self._folder / str(error))
            return None

    def _write_fingerprint(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        record = self._folder / MADE_OF
        if not record.exists():
            write_file(record, encode_fingerprint(self._fingerprint))


class _ScratchCheckpoint(_RoundCheckpoint):
    """Checkpoint for one start: many runs are in a file until the archive has them."""

    def save(self, inputs: Arrays, batch_result: BatchResult) -> None:
        pass

    def _write_fingerprint(self) -> None:
        # Another start removes runs without one.
        self._folder.mkdir(parents=True, exist_ok=True)


def keep_runs(
    study: ValidatedStudy,
    path: str | Path,
    inputs: Arrays,
    results: Results,
    model: str = ONLY_MODEL,
) -> bool:
    """Keep finished runs beside an archive, where `make_archive` finds them by their inputs.

    Of a model whose versions cannot be distinguished, nothing is kept; nor are runs that are at no
    point with which a design of the study begins.

    Parameters
    ----------
    study : ValidatedStudy
        The study.
    path : str or Path
        Its archive, which need not be there yet.
    inputs : mapping of str to ndarray, shape (run,)
        The points in SI units.
    results : Results
        Of the study's `Evaluator` at these points.
    model : str
        The name of the model in a study with several.

    Returns
    -------
    bool
        Whether they are kept.

    Raises
    ------
    ArchiveError
        If they cannot be written, or another process is making the archive.
    """
    size = len(results.status)
    if study.models[model].model.unknown_dependency or not any(
        (PointIndex(first_points(study, design, model)).find(inputs, 0, size) >= 0).any()
        for design in study.designs
    ):
        return False
    path = Path(path).absolute()
    folder = path.with_name(f"{path.name}.parts")
    root = folder / MODELS / model if model else folder
    runs = FinishedRuns(np.arange(size), dict(inputs), results)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with lock_archive(path):
            target = _new_set_aside(root)
            record = encode_fingerprint(model_identity(study, model).fingerprint)
            write_file(target / MADE_OF, record)
            write_runs(part_path(target, 0, 0), runs)
    except ArchiveError:
        raise
    except OSError as error:
        raise ArchiveError(f"{folder}: runs cannot be kept: {error.strerror}") from None
    return True


def _new_set_aside(root: Path) -> Path:
    """Make a folder for runs that are set aside, with a number that no other has."""
    for number in count(1):
        folder = root / SET_ASIDE / f"{number:06d}"
        if not folder.exists():
            folder.mkdir(parents=True)
            return folder
    raise AssertionError


@contextmanager
def lock_archive(path: Path) -> Iterator[None]:
    """Lock the archive at `path` against other processes within this context.

    The operating system holds the lock, and releases it when this process ends in any way;
    the file that it is on may stay behind, and means nothing.

    Raises
    ------
    ArchiveError
        If another process is at it.
    """
    from filelock import FileLock, Timeout

    # Through a link it is the same archive.
    real = path.resolve()
    file = real.with_name(f".{real.name}.lock")
    lock = FileLock(file, blocking=False)
    try:
        lock.acquire()
    except Timeout:
        raise ArchiveError(f"{path}: another process is making it right now") from None
    except OSError as error:
        raise ArchiveError(f"{file}: cannot be locked: {error.strerror}") from None
    try:
        yield
    finally:
        # Before it is let go, so that nobody who waits for it gets a file that is no longer there.
        with contextlib.suppress(OSError):
            file.unlink()
        lock.release()
