"""Checkpoint of one round of a design: its runs in files, a part of a block in each."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from itertools import chain
from pathlib import Path
from typing import Protocol

import xarray as xr

from uqpen.checkpoints.block_store import BlockStore
from uqpen.checkpoints.identity import encode_fingerprint
from uqpen.checkpoints.parts import (
    MADE_OF,
    DamagedRunsError,
    FinishedRuns,
    GrowingPart,
    covered_count,
    part_files,
    part_number,
    part_path,
    remove,
    write_file,
)
from uqpen.core.arrays import Arrays
from uqpen.core.blocks import join_blocks
from uqpen.core.errors import CheckpointError
from uqpen.core.labels import RUN
from uqpen.core.streams import BLOCK
from uqpen.execution.batch import BatchResult
from uqpen.execution.checkpoint import Checkpoint

__all__ = ["RoundCheckpoint", "ScratchCheckpoint"]


# Seconds of work that a kill may cost where whole blocks are kept anyway.
_WORTH_A_PART = 10.0


class RoundStore(Protocol):
    """Store that a checkpoint of a round belongs to.

    `runs` is the number of kept runs in it. `joined` is the number of runs in memory so far, by the
    folder of a design. A round that would make it more than `runs_in_memory` goes by blocks.
    """

    runs: int
    runs_in_memory: int
    joined: Counter[Path]

    def writing(self) -> AbstractContextManager[None]:
        """Return an error of the disk as one that states its consequences for the runs."""

    def warn_of_damage(self, file: Path) -> None:
        """Say that some runs of a file are made again."""

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
        self._written: dict[int, set[Path]] = {}
        self._unwritten = 0
        self._number = 0
        self._blocks: BlockStore | None = None
        self._files: frozenset[str] = frozenset()
        self._since = time.monotonic()

    def prepare(self, runs: int) -> int:
        ranges: list[tuple[int, int]] = []
        if self._are_too_many(runs):
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
        if self._blocks and self._unwritten < 4 * BLOCK and self._waited < _WORTH_A_PART:
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

    def _are_too_many(self, runs: int) -> bool:
        """Return True if runs would be too many beside those of earlier rounds in memory.

        A round of one block or less costs more as a file than it takes in memory.
        """
        return runs > BLOCK and self._store.joined[self._folder] + runs > self._store.runs_in_memory

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

    @property
    def _waited(self) -> float:
        """Seconds since runs were written."""
        return time.monotonic() - self._since


class ScratchCheckpoint(RoundCheckpoint):
    """Checkpoint for one start: many runs are in a file until the archive has them."""

    def save(self, inputs: Arrays, batch_result: BatchResult) -> None:
        pass

    def _write_fingerprint(self) -> None:
        # Another start removes runs without one.
        self._folder.mkdir(parents=True, exist_ok=True)
