"""Division of runs into batches."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator

import numpy as np

from uqpen.core.arrays import Arrays, BoolArray
from uqpen.core.streams import BLOCK
from uqpen.execution.batch import Batch

__all__ = ["WORTH_SENDING", "Pace", "scalar_batches", "vectorized_batches"]


# Size of the batches of a vectorised function. It never changes with the number of runs.
_FIXED_SIZE = 1024

# Number of batches of a model whose runs are the same in any batch, and their smallest size. Larger
# batches take a third less time: a million runs of compiled rods 3.1 s in place of 4.7 s.
_BATCHES, _SMALLEST = 16, 1024

# Intended duration of the runs of one batch, in seconds: a crash must not
# cost too many runs, and sending a batch must not take longer than making its runs.
WORTH_SENDING = 0.01
_MOST_AT_ONCE = 1024

# Number of answers over which the pace is measured.
_WINDOW = 32


def vectorized_batches(
    columns: Arrays, done: BoolArray, *, is_batch_independent: bool
) -> Iterator[Batch]:
    """Yield batches for a model that takes many runs at a time, except those that are wholly done.

    A user's function may give other last bits in another batch. Its batches all have one size, so
    the first runs of a design keep every bit where the design gets more. A batch that is done in
    part is made again as a whole.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (run,)
        The inputs.
    done : ndarray of bool, shape (run,)
        Mask of the runs made before.
    is_batch_independent : bool
        Whether a run is the same in any batch; batches are then as large as workers can share.
    """
    runs = len(done)
    size = min(max(-(-runs // _BATCHES), _SMALLEST), BLOCK) if is_batch_independent else _FIXED_SIZE
    for start in range(0, runs, size):
        if not done[start : start + size].all():
            yield _batch(columns, start, start + size)


def scalar_batches(columns: Arrays, done: BoolArray, pace: Pace) -> Iterator[Batch]:
    """Yield batches for a model that takes a run at a time; their size depends on its pace.

    `columns` and `done` are those of `vectorized_batches`.
    """
    # Start and end of each stretch of runs to make.
    edges = np.flatnonzero(np.diff(~done, prepend=False, append=False))
    for start, end in edges.reshape(-1, 2).tolist():
        while start < end:
            size = min(pace.size, end - start)
            yield _batch(columns, start, start + size)
            start += size


class Pace:
    """Rate at which runs complete; no result depends on it.

    `worth_sending` is the intended duration of the runs that are sent at once, in seconds. A run
    with limits is sent alone.
    """

    def __init__(self, worth_sending: float, *, is_alone: bool = False) -> None:
        self._worth_sending = worth_sending
        self._is_alone = is_alone
        self._answers: deque[tuple[float, int]] = deque(maxlen=_WINDOW)

    def record(self, runs: int) -> None:
        """Record a number of runs that have just completed."""
        self._answers.append((time.monotonic(), runs))

    @property
    def size(self) -> int:
        """Number of runs worth sending at once."""
        if self._is_alone or len(self._answers) < 2:
            return 1
        took = self._answers[-1][0] - self._answers[0][0]
        runs = sum(runs for _, runs in self._answers) - self._answers[0][1]
        if took * _MOST_AT_ONCE <= runs * self._worth_sending:
            return _MOST_AT_ONCE
        return max(1, int(runs * self._worth_sending / took))


def _batch(columns: Arrays, start: int, end: int) -> Batch:
    return Batch(start, {name: column[start:end] for name, column in columns.items()})
