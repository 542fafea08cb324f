"""Checkpoint that has very many runs in a file until they are analysed."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path

import xarray as xr

from uqpen.archive.lazy_variables import FailureRecord, GrowingRuns
from uqpen.core.blocks import join_blocks
from uqpen.core.errors import ArchiveError
from uqpen.core.labels import RUN
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.execution.checkpoint import Checkpoint


@contextlib.contextmanager
def runs_in_file(path: Path, runs_in_memory: int = RUNS_IN_MEMORY) -> Iterator[Checkpoint]:
    """Return a checkpoint for rounds whose runs are needed until the next round alone.

    Within this context, the runs of the last round are in a file if they are more than
    `runs_in_memory`. No run is stored for another start.

    Parameters
    ----------
    path : Path
        The file, which is removed at the end. One that a killed program has left is overwritten.
    runs_in_memory : int

    Raises
    ------
    ArchiveError
        If the runs cannot be written, for example to a full disk.
    """
    try:
        yield _RunsInFile(path, runs_in_memory)
    finally:
        path.unlink(missing_ok=True)


class _RunsInFile(Checkpoint):
    def __init__(self, path: Path, runs_in_memory: int) -> None:
        self._path, self._runs_in_memory = path, runs_in_memory

    def collect(self, blocks: Iterable[xr.Dataset], runs: int) -> xr.Dataset:
        if runs <= self._runs_in_memory:
            return join_blocks(blocks, runs)
        self._path.unlink(missing_ok=True)
        file, failures = GrowingRuns(self._path, runs), FailureRecord()
        for block in blocks:
            try:
                file.write(int(block[RUN].values[0]), block)
            except OSError as error:
                reason = error.strerror
                raise ArchiveError(f"{self._path}: runs cannot be kept: {reason}") from None
            failures.add(block)
        return file.dataset(block, failures)
