"""Interface of a checkpoint, which stores finished runs in case the program is interrupted."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.core.arrays import Arrays
from uqpen.execution.batch import BatchResult

__all__ = ["Checkpoint"]


class Checkpoint:
    """Store of finished runs of a model over points; this base class stores none."""

    def restore(self, inputs: Arrays) -> Iterator[BatchResult]:
        """Yield the stored runs at these points, all points of a round in SI units."""
        yield from ()

    def save(self, inputs: Arrays, batch_result: BatchResult) -> None:
        """Store a batch result of the runs at these points."""
