"""Whole blocks of runs in one file, and a record of those that are in it."""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.growing_runs import FailureRecord, GrowingRuns
from uqpen.checkpoints.parts import (
    DamagedRunsError,
    FinishedRuns,
    block_files,
    part_files,
    part_number,
    part_path,
    write_runs,
)
from uqpen.core.arrays import raw_bytes
from uqpen.core.labels import DERIVED_FROM, FAILED_RUN, FAILURE_REASON, ROLE, RUN, STATUS
from uqpen.core.model import Results
from uqpen.core.status import Status

__all__ = ["BlockStore", "block_stores"]

_DAMAGE = (OSError, RuntimeError, ValueError, KeyError, IndexError, TypeError)


class _Entry(NamedTuple):
    """Offset of the entry of a block in the record, and the number of its runs."""

    offset: int
    runs: int


class BlockStore:
    """Blocks of the runs of a round, each in the file as soon as all its runs are done.

    The record has a line for each block. It is written after the block, and has its checksum. So a
    program that is killed loses the block that it writes, and damage is found.

    Parameters
    ----------
    folder : Path
        The folder of the checkpoint.
    number : int
        The number of the round.
    size : int
        The number of its runs.
    """

    def __init__(self, folder: Path, number: int, size: int) -> None:
        self._folder, self._number = folder, number
        path, self._record = block_files(folder, number)
        self._runs = GrowingRuns(path, size)
        self._failures = FailureRecord()
        self._like: xr.Dataset | None = None
        found = dict(_entries(self._record)) if self._runs.is_readable() else {}
        self._entries = {start: entry for start, entry in found.items() if entry.runs}
        if not self._entries:
            self.close()
            path.unlink(missing_ok=True)
            self._record.unlink(missing_ok=True)

    @property
    def ranges(self) -> list[tuple[int, int]]:
        """The first run of each block in the file, and the run after its last."""
        return [(start, start + entry.runs) for start, entry in self._entries.items()]

    def add(self, block: xr.Dataset, files: frozenset[str], *, safely: bool) -> None:
        """Take the next block of all, and write it if it is not in the file.

        Parameters
        ----------
        block : Dataset
            As `evaluate_blocks` yields it.
        files : frozenset of str
            The files that its runs were made with.
        safely : bool
            Whether it is brought to the disk at once.
        """
        self._failures.add(block)
        self._like = block
        start, runs = int(block[RUN].values[0]), block.sizes[RUN]
        if start in self._entries:
            return
        self._runs.write(start, block)
        if safely:
            self._runs.bring_to_disk()
        reasons = dict(
            zip(block[FAILED_RUN].values.tolist(), block[FAILURE_REASON].values, strict=True)
        )
        entry = {
            "start": start,
            "runs": runs,
            "crc32": _checksum(self._runs.read(start, start + runs)),
            "inputs": _inputs(block),
            "outputs": _outputs(block),
            "files": sorted(files),
            "reasons": reasons,
        }
        self._write_line(entry, safely=safely)

    def discard(self, statuses: Collection[Status]) -> None:
        """Replace each block that has runs with some statuses by a part without these."""
        for found in self.finished_runs():
            if np.isin(found.results.status, list(statuses)).any():
                numbers = [part_number(file) for file in part_files(self._folder)]
                if rest := found.without_statuses(statuses):
                    number = max(numbers, default=-1) + 1
                    write_runs(part_path(self._folder, self._number, number), rest)
                self._write_line({"start": int(found.runs[0]), "runs": 0}, safely=True)

    def finished_runs(self) -> Iterator[FinishedRuns]:
        """Yield the runs of each block in the file, damaged ones left out."""
        for start in [*self._entries]:
            try:
                found = self.read(start)
            except DamagedRunsError:
                continue
            if found is not None:
                yield found

    def read(self, start: int) -> FinishedRuns | None:
        """Return the runs of the block that begins with a run; None if it is not in the file.

        Raises
        ------
        DamagedRunsError
            If they are not as they were written. The block then counts as not in the file.
        """
        if start not in self._entries:
            return None
        try:
            return self._read(start)
        except _DAMAGE:
            del self._entries[start]
            raise DamagedRunsError(self._runs.path.name) from None

    def dataset(self) -> xr.Dataset:
        """Return the runs of all blocks, once all of them have been taken."""
        assert self._like is not None
        return self._runs.dataset(self._like, self._failures)

    def _write_line(self, entry: dict[str, Any], *, safely: bool) -> None:
        with self._record.open("ab") as stream:
            self._entries[entry["start"]] = _Entry(stream.tell(), entry["runs"])
            stream.write(json.dumps(entry).encode() + b"\n")
            if safely:
                stream.flush()
                os.fsync(stream.fileno())

    def close(self) -> None:
        """Close the file; it is opened again where that is needed."""
        self._runs.close()

    def _read(self, start: int) -> FinishedRuns:
        entry = self._entries[start]
        with self._record.open("rb") as stream:
            stream.seek(entry.offset)
            said = json.loads(stream.readline())
        values = self._runs.read(start, start + entry.runs)
        if said["crc32"] != _checksum(values):
            raise ValueError
        outputs = {
            name: _as_returned(values[name], is_categorical=is_categorical)
            for name, is_categorical in said["outputs"].items()
        }
        reasons = {int(run) - start: str(text) for run, text in said["reasons"].items()}
        inputs = {
            name: values[name] if given is None else np.full(entry.runs, given)
            for name, given in said["inputs"].items()
        }
        results = Results(outputs, values[STATUS], reasons, frozenset(said["files"]))
        return FinishedRuns(start + np.arange(entry.runs), inputs, results)


def _entries(record: Path) -> Iterator[tuple[int, _Entry]]:
    """Yield the first run and the place of each block in a record; the last line may be cut off."""
    offset = 0
    try:
        with record.open("rb") as stream:
            for line in stream:
                said = json.loads(line)
                yield int(said["start"]), _Entry(offset, int(said["runs"]))
                offset += len(line)
    except _DAMAGE:
        _cut(record, offset)


def _cut(record: Path, size: int) -> None:
    """Remove what a program that was killed has left of a line."""
    if record.exists():
        os.truncate(record, size)


def _inputs(block: xr.Dataset) -> dict[str, float | None]:
    """Return the inputs of runs: the value of one that is the same in all, or None."""
    return {
        str(name): None if each.dims else float(each.values)
        for name in block.data_vars
        if (each := block.variables[name]).attrs.get(ROLE) != "output"
        and name not in (STATUS, FAILURE_REASON)
    }


def _outputs(block: xr.Dataset) -> dict[str, bool]:
    """Return the outputs of the model itself, and whether each is categorical."""
    return {
        str(name): "flag_values" in each.attrs
        for name in block.data_vars
        if (each := block.variables[name]).attrs.get(ROLE) == "output"
        and DERIVED_FROM not in each.attrs
    }


def _as_returned(values: Any, *, is_categorical: bool) -> Any:
    """Return the values of an output as a model returns them: without a category, NaN."""
    if not is_categorical:
        return values
    found = values.astype(np.float64)
    found[found < 0] = np.nan
    return found


def _checksum(values: Mapping[str, Any]) -> int:
    found = 0
    for name in sorted(values):
        found = zlib.crc32(raw_bytes(values[name]), found)
    return found


def block_stores(folder: Path) -> Iterator[BlockStore]:
    """Yield the files of whole blocks in a folder."""
    for record in sorted(folder.glob(block_files(folder)[1].name)):
        number, size = int(record.name.partition("_")[0]), 0
        store = BlockStore(folder, number, size)
        try:
            yield store
        finally:
            store.close()
