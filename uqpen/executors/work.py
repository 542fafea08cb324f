"""What executors are given and give back: batches of runs, and what came of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from uqpen.labels import Status
from uqpen.model import Results

__all__ = ["Batch", "Map", "Piece", "Work"]


@dataclass(frozen=True)
class Batch:
    """Runs that are made together.

    Parameters
    ----------
    start : int
        The number of the first; the others follow it.
    inputs : mapping of str to ndarray, shape (run,)
        SI values.
    """

    start: int
    inputs: Mapping[str, npt.NDArray[np.float64]]

    def __len__(self) -> int:
        return len(next(iter(self.inputs.values())))

    def halves(self) -> Iterator[Batch]:
        """The same runs as two batches; there are two at least."""
        middle = len(self) // 2
        for begin, end in ((0, middle), (middle, len(self))):
            some = {name: values[begin:end] for name, values in self.inputs.items()}
            yield Batch(self.start + begin, some)


@dataclass(frozen=True)
class Piece:
    """What came of a batch, or of a part of one.

    Parameters
    ----------
    start : int
        The number of its first run.
    results : Results
        Of it and of those that follow.
    """

    start: int
    results: Results

    def __len__(self) -> int:
        return len(self.results.status)


class Work(Protocol):
    """What is done with a batch."""

    def __call__(self, batch: Batch, /) -> Piece:
        """What came of a batch."""
        ...

    def lost(self, batch: Batch, status: Status, reason: str) -> Piece:
        """What comes of a batch whose runs were all lost to the same."""
        ...


# As the built-in `map`, which is one; but pieces may come in any order, and a batch in several.
Map = Callable[[Work, Iterable[Batch]], Iterable[Piece]]
