"""Interface of a checkpoint, which stores finished runs in case the program is interrupted."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.core.arrays import Arrays
from uqpen.execution.batch import BatchResult

__all__ = ["Checkpoint"]


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
