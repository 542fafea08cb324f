"""Arguments and results of executors: batches of runs, and the result of each batch."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from uqpen.core.arrays import Arrays
from uqpen.core.limits import Limits
from uqpen.core.model import Results
from uqpen.core.status import Status


@dataclass(frozen=True)
class Batch:
    """Consecutive runs that are made together."""

    start: int  # the number of the first
    inputs: Arrays  # (run,): in SI units
    is_observed: bool = False  # true if what the first run depends on is to be reported

    def __len__(self) -> int:
        return len(next(iter(self.inputs.values())))

    def halves(self) -> tuple[Batch, Batch]:
        """Split the batch into two; it must have two runs at least."""
        middle = len(self) // 2
        return self.between(0, middle), self.between(middle, len(self))

    def singles(self) -> Iterator[Batch]:
        """Split the batch into batches of one run."""
        return (self.between(run, run + 1) for run in range(len(self)))

    def between(self, begin: int, end: int) -> Batch:
        """Return the part of it from one position to another, the last excluded."""
        some = {name: values[begin:end] for name, values in self.inputs.items()}
        return Batch(self.start + begin, some, self.is_observed and not begin)


@dataclass(frozen=True)
class BatchResult:
    """Result of a batch, or of a part of one, which begins at the run `start`.

    Warnings are those that Python issued meanwhile; they change no result.
    """

    start: int
    results: Results
    warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.results.status)

    def between(self, start: int, stop: int) -> BatchResult:
        """Return the part of it from one run to another, the last excluded."""
        begin, end = max(start - self.start, 0), min(stop - self.start, len(self))
        if (begin, end) == (0, len(self)):
            return self
        results = Results(
            {name: values[begin:end] for name, values in self.results.outputs.items()},
            self.results.status[begin:end],
            {run - begin: text for run, text in self.results.reasons.items() if begin <= run < end},
            self.results.files,
        )
        return BatchResult(self.start + begin, results, self.warnings)


def join_results(results: Sequence[Results]) -> Results:
    """Join the results of one or more consecutive batches."""
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
    """Work on a batch: a callable that makes its runs."""

    @property
    def limits(self) -> Limits:
        """Resource limits of one run."""

    @property
    def is_untrusted(self) -> bool:
        """True if it calls code that can hang or kill the process it is called in."""

    @property
    def is_object(self) -> bool:
        """True if it exists in this process only, and only processes that it starts may get it."""

    @property
    def retries(self) -> int:
        """Number of further attempts at a missing run."""

    def __call__(self, batch: Batch, /) -> BatchResult:
        """Return the result of a batch."""

    def failed_result(self, batch: Batch, status: Status, reason: str) -> BatchResult:
        """Return the result of a batch whose runs all failed for one reason."""


# Like the built-in `map`, which is one; but results may come in any order, several for a batch.
Map = Callable[[Work, Iterable[Batch]], Iterable[BatchResult]]


@runtime_checkable
class PacedMap(Protocol):
    """Map that declares the intended duration of a batch in seconds, as sending one takes time."""

    worth_sending: float

    def __call__(self, work: Work, batches: Iterable[Batch], /) -> Iterable[BatchResult]:
        """Yield the results of batches, in any order."""
