"""Part of a checkpoint that grows: runs of one block, which one file keeps."""

from __future__ import annotations

from pathlib import Path

from uqpen.checkpoints.runs_file import FinishedRuns, write_runs
from uqpen.core.arrays import Arrays
from uqpen.execution.batch import BatchResult

__all__ = ["GrowingPart"]

# A part grows and is written again each time, up to this number of times, of runs or of bytes.
_MOST_WRITTEN, _MOST_RUNS, _MOST_BYTES = 64, 8192, 2**24


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
