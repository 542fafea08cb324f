"""What executors are given and give back: batches of runs, and what came of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from uqpen.core.labels import Status
from uqpen.core.limits import Limits
from uqpen.core.model import Results

__all__ = ["Batch", "BatchResult", "Map", "Work", "join_results"]


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
        yield from (self._slice(0, middle), self._slice(middle, len(self)))

    def singles(self) -> Iterator[Batch]:
        """The same runs, each as a batch."""
        return (self._slice(run, run + 1) for run in range(len(self)))

    def _slice(self, begin: int, end: int) -> Batch:
        some = {name: values[begin:end] for name, values in self.inputs.items()}
        return Batch(self.start + begin, some)


@dataclass(frozen=True)
class BatchResult:
    """What came of a batch, or of a part of one.

    Parameters
    ----------
    start : int
        The number of its first run.
    results : Results
        Of it and of those that follow.
    warnings : tuple of str
        What Python has warned of meanwhile, which changes no result.
    """

    start: int
    results: Results
    warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.results.status)


def join_results(results: Sequence[Results]) -> Results:
    """Results of batches that follow each other as those of one, of which there is at least one."""
    if len(results) == 1:
        return results[0]
    starts = np.cumsum([0, *(len(each.status) for each in results)])
    return Results(
        {
            name: np.concatenate([each.outputs[name] for each in results])
            for name in results[0].outputs
        },
        np.concatenate([each.status for each in results]),
        {
            int(start) + run: reason
            for start, each in zip(starts, results, strict=False)
            for run, reason in each.reasons.items()
        },
        frozenset[str]().union(*(each.files for each in results)),
    )


class Work(Protocol):
    """What is done with a batch."""

    @property
    def limits(self) -> Limits:
        """What one run may use."""
        ...

    @property
    def is_untrusted(self) -> bool:
        """Whether it calls code that can hang or kill the process it is called in."""
        ...

    @property
    def retries(self) -> int:
        """How often a run that was lost is made again."""
        ...

    def __call__(self, batch: Batch, /) -> BatchResult:
        """What came of a batch."""
        ...

    def failed_result(self, batch: Batch, status: Status, reason: str) -> BatchResult:
        """What comes of a batch whose runs were all lost to the same."""
        ...


# As the built-in `map`, which is one; but pieces may come in any order, and a batch in several.
Map = Callable[[Work, Iterable[Batch]], Iterable[BatchResult]]
