"""Files of finished runs in the folders of a checkpoint: parts of a block, and whole blocks."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import zipfile
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.lazy_variables import FailureRecord, GrowingRuns
from uqpen.core.arrays import Arrays, IntArray, raw_bytes
from uqpen.core.errors import ArchiveError
from uqpen.core.labels import DERIVED_FROM, FAILED_RUN, FAILURE_REASON, ROLE, RUN, STATUS
from uqpen.core.model import Results
from uqpen.core.status import Status
from uqpen.execution.batch import BatchResult, join_results

# Record of what the runs in a folder were made with.
MADE_OF = "made_of.json"

# Suffix of the names of unfinished files.
_TEMPORARY = ".tmp"

_NUMBER = "[0-9]" * 6

_INPUT, _OUTPUT, _FAILED, _FILES, _DIGEST = "input_", "output_", "lost", "files", "sha256"

# Errors of a part with damaged bytes: NumPy, the zip format and the decoding of names raise them.
# A flag may call it encrypted (RuntimeError), and a header may ask for any memory.
_DAMAGE = (
    OSError,
    ValueError,
    KeyError,
    EOFError,
    MemoryError,
    RuntimeError,
    SyntaxError,
    zipfile.BadZipFile,
    zlib.error,
)

# A part grows and is written again each time, up to this number of times, of runs or of bytes.
_MOST_WRITTEN, _MOST_RUNS, _MOST_BYTES = 64, 8192, 2**24


class DamagedRunsError(Exception):
    """File that is no part of a checkpoint, or is damaged."""


@dataclass(frozen=True)
class FinishedRuns:
    """Finished runs in ascending order of their numbers, with inputs in SI units and results."""

    runs: IntArray
    inputs: Arrays
    results: Results

    @classmethod
    def from_batch_results(
        cls, batch_results: Sequence[tuple[Arrays, BatchResult]]
    ) -> FinishedRuns:
        """Combine one or more batch results, each with the inputs of its runs."""
        ordered = sorted(batch_results, key=lambda each: each[1].start)
        return cls.joined(
            [
                cls(np.arange(each.start, each.start + len(each)), inputs, each.results)
                for inputs, each in ordered
            ]
        )

    @classmethod
    def joined(cls, parts: Sequence[FinishedRuns]) -> FinishedRuns:
        """Join one or more parts with the same inputs and outputs, in this order."""
        if len(parts) == 1:
            return parts[0]
        return cls(
            np.concatenate([part.runs for part in parts]),
            {
                name: np.concatenate([part.inputs[name] for part in parts])
                for name in parts[0].inputs
            },
            join_results([part.results for part in parts]),
        )

    def match_inputs(self, columns: Arrays, start: int = 0) -> bool:
        """Check that its runs were made at exactly these points, bit for bit.

        They are consecutive; the first has the number `start`.
        """
        if self.inputs.keys() != columns.keys():
            return False
        stop = start + len(next(iter(columns.values())))
        return int(self.runs[-1]) < stop and all(
            np.array_equal(values.view(np.int64), columns[name][self.runs - start].view(np.int64))
            for name, values in self.inputs.items()
        )

    def between(self, start: int, stop: int) -> FinishedRuns | None:
        """Return its runs from one number to another, the last excluded; None for none."""
        return self._select(np.flatnonzero((self.runs >= start) & (self.runs < stop)))

    def without_statuses(self, statuses: Collection[Status]) -> FinishedRuns | None:
        """Return its runs without those of some statuses; None if no other is left."""
        return self._select(np.flatnonzero(~np.isin(self.results.status, list(statuses))))

    def _select(self, at: IntArray) -> FinishedRuns | None:
        if len(at) == len(self.runs):
            return self
        return self.select(at) if at.size else None

    def select(self, at: IntArray) -> FinishedRuns:
        """Return the runs at some positions, in this order."""
        inputs = {name: values[at] for name, values in self.inputs.items()}
        return FinishedRuns(self.runs[at], inputs, select_results(self.results, at))

    def batch_results(self) -> Iterator[BatchResult]:
        """Yield its runs as batch results; the runs of each are consecutive."""
        for at in self._consecutive_runs():
            yield BatchResult(int(self.runs[at[0]]), select_results(self.results, at))

    def ranges(self) -> list[tuple[int, int]]:
        """Return the first run of each sequence of consecutive ones, and the run after its last."""
        return [
            (int(self.runs[at[0]]), int(self.runs[at[-1]]) + 1) for at in self._consecutive_runs()
        ]

    def _consecutive_runs(self) -> list[IntArray]:
        """Return the positions of each sequence of consecutive runs."""
        ends = np.flatnonzero(np.diff(self.runs) > 1) + 1
        return np.split(np.arange(len(self.runs)), ends)


def select_results(results: Results, at: IntArray) -> Results:
    """Select the results of some runs, by their positions."""
    reasons = results.reasons
    return Results(
        {name: values[at] for name, values in results.outputs.items()},
        results.status[at],
        {new: reasons[run] for new, run in enumerate(at.tolist()) if run in reasons},
        results.files,
    )


def covered_count(ranges: Sequence[tuple[int, int]]) -> int:
    """Return how many numbers lie in ranges, which may overlap.

    >>> covered_count([(4, 6), (0, 3), (2, 5)])
    6
    """
    covered = end = 0
    for start, stop in sorted(ranges):
        covered += max(stop - max(start, end), 0)
        end = max(end, stop)
    return covered


def write_runs(path: Path, result: FinishedRuns) -> None:
    """Write a part to the disk atomically.

    Raises
    ------
    OSError
        If that cannot be done.
    """
    results = result.results
    failed = sorted(results.reasons)
    arrays: dict[str, npt.NDArray[Any]] = {
        RUN: result.runs,
        STATUS: results.status,
        **{_INPUT + name: values for name, values in result.inputs.items()},
        **{_OUTPUT + name: values for name, values in results.outputs.items()},
        _FAILED: np.array(failed, dtype=np.int64),
        FAILURE_REASON: np.array([results.reasons[run] for run in failed], dtype=np.str_),
        _FILES: np.array(sorted(results.files), dtype=np.str_),
    }
    arrays[_DIGEST] = np.array(_digest(arrays))
    content = io.BytesIO()
    # NumPy before 2.1 would take `allow_pickle` for the name of an array.
    np.savez(content, **arrays)  # type: ignore[arg-type]
    write_file(path, content.getvalue())


def write_file(path: Path, content: bytes) -> None:
    """Write a file atomically: it has either its new or its old content.

    Raises
    ------
    OSError
        If that cannot be done; nothing is left behind.
    """
    temporary = path.with_name(path.name + _TEMPORARY)
    try:
        with temporary.open("wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise


def read_runs(path: Path) -> FinishedRuns:
    """Read the runs of a part.

    Raises
    ------
    DamagedRunsError
        If they are not as they were written.
    """
    try:
        with path.open("rb") as stream:
            _check_sizes(stream, path.stat().st_size)
            with np.load(stream, allow_pickle=False) as content:
                arrays = {name: content[name] for name in content.files}
        written = str(arrays.pop(_DIGEST))
    except _DAMAGE:
        raise DamagedRunsError(path.name) from None
    if written != _digest(arrays):
        raise DamagedRunsError(path.name)
    results = Results(
        _arrays_with_prefix(arrays, _OUTPUT),
        arrays[STATUS],
        dict(zip(arrays[_FAILED].tolist(), arrays[FAILURE_REASON].tolist(), strict=True)),
        frozenset(arrays[_FILES].tolist()),
    )
    return FinishedRuns(arrays[RUN], _arrays_with_prefix(arrays, _INPUT), results)


def _check_sizes(stream: IO[bytes], size: int) -> None:
    """Check that the arrays of a part take no more memory than the part: none is compressed.

    Raises
    ------
    ValueError
        If they would.
    """
    with zipfile.ZipFile(stream) as archive:
        if sum(entry.file_size for entry in archive.infolist()) > size:
            raise ValueError("compressed")
    stream.seek(0)


def _arrays_with_prefix(
    arrays: Mapping[str, npt.NDArray[Any]], prefix: str
) -> dict[str, npt.NDArray[Any]]:
    return {
        name.removeprefix(prefix): values
        for name, values in arrays.items()
        if name.startswith(prefix)
    }


def _digest(arrays: Mapping[str, npt.NDArray[Any]]) -> str:
    """Return a hash of the content of a part."""
    digest = hashlib.sha256()
    for name, values in sorted(arrays.items()):
        digest.update(f"{name} {values.dtype.str} {values.shape} ".encode())
        digest.update(raw_bytes(values))
    return digest.hexdigest()


def part_path(folder: Path, round_number: int, number: int) -> Path:
    """Return the path of a file of runs: the number of the round, and its own."""
    return folder / f"{round_number}_{number:06d}.npz"


def part_number(file: Path) -> int:
    """Return the number of a file of runs in its round."""
    return int(file.stem.partition("_")[2])


def remove_temporary(root: Path) -> None:
    """Remove unfinished files below a folder."""
    for name in (f"[0-9]*_{_NUMBER}.npz", "[0-9]*_blocks.nc", MADE_OF):
        for file in root.rglob(f"{name}{_TEMPORARY}"):
            remove(file)


def part_files(folder: Path, number: str = "[0-9]*") -> list[Path]:
    """List the files of runs in a folder: of one round, or of all."""
    return [file for file in sorted(folder.glob(f"{number}_{_NUMBER}.npz")) if file.is_file()]


def block_files(folder: Path, number: int | str = "[0-9]*") -> tuple[Path, Path]:
    """Return the paths of the file of whole blocks of a round, and of the record of them."""
    return folder / f"{number}_blocks.nc", folder / f"{number}_blocks.jsonl"


def has_runs(folder: Path) -> bool:
    """Return True if a folder has finished runs, in parts or in whole blocks."""
    return bool(part_files(folder) or whole_blocks(folder))


def whole_blocks(folder: Path) -> list[Path]:
    """List the files of whole blocks in a folder."""
    return [file for each in block_files(folder) for file in sorted(folder.glob(each.name))]


def remove_checkpoint(root: Path) -> None:
    """Remove the files of checkpoints below a folder, and folders that are then empty.

    Other files may stand beside them, above all where the folder is a link.

    Raises
    ------
    ArchiveError
        If that cannot be done.
    """
    for folder in [root, *root.rglob("*/")]:
        for file in [*part_files(folder), *whole_blocks(folder), folder / MADE_OF]:
            remove(file)
    remove_empty(root)


def remove(file: Path) -> None:
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


def remove_empty(root: Path) -> None:
    """Remove a folder and its subfolders, as far as they are empty."""
    for folder in sorted([root, *root.rglob("*/")], reverse=True):
        with contextlib.suppress(OSError):  # it is not empty, or not there
            folder.rmdir()


class GrowingPart:
    """Runs of a block that are in one file, or are to be written to it."""

    def __init__(self) -> None:
        self.number: int | None = None
        self._batch_results: list[tuple[Arrays, BatchResult]] = []
        self._runs = self._bytes = self._written = 0
        self.unwritten = 0  # runs

    def add(self, inputs: Arrays, batch_result: BatchResult) -> None:
        """Add the result of a batch with its inputs."""
        self._batch_results.append((inputs, batch_result))
        self._runs += len(batch_result)
        self._bytes += sum(values.nbytes for values in batch_result.results.outputs.values())
        self.unwritten += len(batch_result)

    def write(self, path: Path) -> None:
        """Write all its runs, where some are not written yet."""
        if self.unwritten:
            write_runs(path, FinishedRuns.from_batch_results(self._batch_results))
            self._written += 1
            self.unwritten = 0

    @property
    def is_full(self) -> bool:
        """True if further runs of its block go to another file."""
        return self.is_large or self._written == _MOST_WRITTEN or self._runs >= _MOST_RUNS

    @property
    def is_large(self) -> bool:
        """True if it is to be written now for its size, as runs with fields often are."""
        return self._bytes >= _MOST_BYTES


_BLOCK_DAMAGE = (OSError, RuntimeError, ValueError, KeyError, IndexError, TypeError)


# Offset of the entry of a block in the record, and the number of its runs.
_Entry = tuple[int, int]


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
        self._entries = {start: entry for start, entry in found.items() if entry[1]}
        if not self._entries:
            self.close()
            path.unlink(missing_ok=True)
            self._record.unlink(missing_ok=True)

    @property
    def ranges(self) -> list[tuple[int, int]]:
        """The first run of each block in the file, and the run after its last."""
        return [(start, start + runs) for start, (_, runs) in self._entries.items()]

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
        # The value of an input that is the same in all runs, or None; whether an output of the
        # model itself is categorical.
        inputs: dict[str, float | None] = {}
        outputs: dict[str, bool] = {}
        for name in map(str, block.data_vars):
            variable = block.variables[name]
            if variable.attrs.get(ROLE) != "output" and name not in (STATUS, FAILURE_REASON):
                inputs[name] = None if variable.dims else float(variable.values)
            elif variable.attrs.get(ROLE) == "output" and DERIVED_FROM not in variable.attrs:
                outputs[name] = "flag_values" in variable.attrs
        failed = zip(block[FAILED_RUN].values.tolist(), block[FAILURE_REASON].values, strict=True)
        entry = {
            "start": start,
            "runs": runs,
            "crc32": _checksum(self._runs.read(start, start + runs)),
            "inputs": inputs,
            "outputs": outputs,
            "files": sorted(files),
            "reasons": dict(failed),
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
        except _BLOCK_DAMAGE:
            del self._entries[start]
            raise DamagedRunsError(self._runs.path.name) from None

    def dataset(self) -> xr.Dataset:
        """Return the runs of all blocks, once all of them have been taken."""
        assert self._like is not None
        return self._runs.dataset(self._like, self._failures)

    def _write_line(self, entry: dict[str, Any], *, safely: bool) -> None:
        with self._record.open("ab") as stream:
            self._entries[entry["start"]] = stream.tell(), entry["runs"]
            stream.write(json.dumps(entry).encode() + b"\n")
            if safely:
                stream.flush()
                os.fsync(stream.fileno())

    def close(self) -> None:
        """Close the file; it is opened again where that is needed."""
        self._runs.close()

    def _read(self, start: int) -> FinishedRuns:
        offset, runs = self._entries[start]
        with self._record.open("rb") as stream:
            stream.seek(offset)
            said = json.loads(stream.readline())
        values = self._runs.read(start, start + runs)
        if said["crc32"] != _checksum(values):
            raise ValueError
        outputs = {name: values[name] for name in said["outputs"]}
        for name in filter(said["outputs"].get, outputs):
            # A run without a category has NaN.
            outputs[name] = np.where(outputs[name] < 0, np.nan, outputs[name].astype(np.float64))
        reasons = {int(run) - start: str(text) for run, text in said["reasons"].items()}
        inputs = {
            name: values[name] if given is None else np.full(runs, given)
            for name, given in said["inputs"].items()
        }
        results = Results(outputs, values[STATUS], reasons, frozenset(said["files"]))
        return FinishedRuns(start + np.arange(runs), inputs, results)


def _entries(record: Path) -> Iterator[tuple[int, _Entry]]:
    """Yield the first run and the place of each block in a record; the last line may be cut off."""
    offset = 0
    try:
        with record.open("rb") as stream:
            for line in stream:
                said = json.loads(line)
                yield int(said["start"]), (offset, int(said["runs"]))
                offset += len(line)
    except _BLOCK_DAMAGE:
        if record.exists():
            os.truncate(record, offset)  # what a program that was killed has left of a line


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
