"""A column of runs reduced to what the error of its mean follows from."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Tally:
    """Sums of a column over its replicates, in place of its values.

    Independent draws are one replicate. The methods that arrays have too return the same.
    """

    sizes: IntArray  # (replicate,): number of runs
    sums: FloatArray  # (replicate,): of the column
    squares: float  # sum of the squared deviations from the mean
    smallest: float  # with largest: the ends of the column
    largest: float

    @classmethod
    def of_events(cls, sizes: IntArray, counts: IntArray) -> Tally:
        """Return the tally of an indicator, from the runs and the events of each replicate."""
        runs, events = int(sizes.sum()), int(counts.sum())
        squares = events * (runs - events) / runs if runs else 0.0
        return cls(
            sizes, counts.astype(np.float64), squares, float(events == runs), float(events > 0)
        )

    @property
    def size(self) -> int:
        """Number of runs."""
        return int(self.sizes.sum())

    @property
    def shape(self) -> tuple[int]:
        """Shape of the column."""
        return (self.size,)

    @property
    def ndim(self) -> int:
        """Number of dimensions of the column."""
        return 1

    def sum(self, axis: int = -1) -> FloatArray:
        """Sum over the runs."""
        return np.asarray(self.sums.sum())

    def mean(self, axis: int = -1) -> FloatArray:
        """Mean over the runs."""
        return np.asarray(self.sums.sum() / self.size)

    def std(self, axis: int = -1, ddof: int = 0) -> FloatArray:
        """Standard deviation over the runs."""
        return np.asarray(math.sqrt(self.squares / (self.size - ddof)))

    def all(self, axis: int = -1) -> bool:
        """True for an indicator that is 1 in every run."""
        return self.smallest == 1

    def astype(self, kind: Any) -> Tally:
        """Return itself, as an array of another type has the same sums."""
        return self

    @property
    def deviations(self) -> FloatArray:
        """Sums of the deviations from the mean, shape (replicate,)."""
        return self.sums - self.sizes * self.mean()

    def __sub__(self, other: Tally) -> Tally:
        """Return the indicator of the runs with this event but not with one that implies it."""
        counts = np.rint(self.sums - other.sums).astype(np.int64)
        return Tally.of_events(self.sizes, counts)

    def __and__(self, other: Tally) -> Tally:
        """Return the indicator of two events, one a value's side and one another value's."""
        counts = np.rint(self.sums + other.sums).astype(np.int64) - self.sizes
        return Tally.of_events(self.sizes, np.maximum(counts, 0))

    def with_missing(self, missing: IntArray, *, happened: bool) -> Tally:
        """Return an indicator with further runs of each replicate, all with one outcome."""
        counts = np.rint(self.sums).astype(np.int64)
        return Tally.of_events(self.sizes + missing, counts + missing * happened)

    def pooled(self) -> Tally:
        """Return the tally with all runs as one replicate."""
        return replace(self, sizes=self.sizes.sum(keepdims=True), sums=self.sums.sum(keepdims=True))

    def scaled(self, factor: float) -> Tally:
        """Return the tally of the column times a factor above 0."""
        return replace(
            self,
            sums=self.sums * factor,
            squares=self.squares * factor**2,
            smallest=self.smallest * factor,
            largest=self.largest * factor,
        )
