"""Interface of a checkpoint, which stores finished runs: in case of an interruption, or of many."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import xarray as xr

from uqpen.core.arrays import Arrays
from uqpen.core.blocks import join_blocks
from uqpen.execution.batch import BatchResult


class Checkpoint:
    """Store of finished runs of a model in a round of a design; this base class stores none."""

    def prepare(self, runs: int) -> int:
        """Find the stored runs of a round with a number of runs; return how many there are."""
        return 0

    def restore(self, start: int, inputs: Arrays) -> Iterator[BatchResult]:
        """Yield the stored runs of a block.

        Parameters
        ----------
        start : int
            Number of the first run of the block in its round.
        inputs : mapping of str to ndarray, shape (run,)
            The points of the block in SI units.
        """
        yield from ()

    def save(self, inputs: Arrays, batch_result: BatchResult) -> None:
        """Store a batch result, given the points of its runs."""

    def collect(self, blocks: Iterable[xr.Dataset], runs: int) -> xr.Dataset:
        """Return the runs of a round, given its blocks in order and the number of runs.

        Here they are joined in memory. A store may keep them in a file until they are needed.
        """
        return join_blocks(blocks, runs)
