"""Checkpoint of one round of a design: its runs in files, a part of a block in each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Protocol

from uqpen.checkpoints.fingerprint_file import FILE_NAME, encode_fingerprint
from uqpen.checkpoints.growing_part import GrowingPart
from uqpen.checkpoints.part_files import part_files, part_number, part_path
from uqpen.checkpoints.runs_file import FinishedRuns, covered_count, write_file
from uqpen.core.arrays import Arrays
from uqpen.core.errors import CheckpointError
from uqpen.core.streams import BLOCK
from uqpen.execution.batch import BatchResult
from uqpen.execution.checkpoint import Checkpoint

__all__ = ["RoundCheckpoint"]


class RoundStore(Protocol):
    """Store that a checkpoint of a round belongs to; `runs` is the number of kept runs in it."""

    runs: int

    def read_runs(self, file: Path) -> FinishedRuns | None:
        """Read the runs of a part; None for a damaged part."""

    def points_error(self, design: str) -> CheckpointError:
        """Return the error for runs that were made at other points."""

    def save_if_due(self, unwritten: int) -> None:
        """Write the finished runs of all rounds if it is time."""

    def save(self) -> None:
        """Write the finished runs of all rounds."""


class RoundCheckpoint(Checkpoint):
    """Checkpoint of the runs of one model in one round of a design, a part of a block in a file."""

    def __init__(
        self, kept: RoundStore, folder: Path, fingerprint: Mapping[str, str], number: int
    ) -> None:
        self._store = kept
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
        if any(part.is_large for part in self._parts.values()):
            self._store.save()
        else:
            self._store.save_if_due(self._unwritten)

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
