"""Division of runs into batches."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator

from uqpen.core.arrays import BoolArray
from uqpen.core.streams import BLOCK
from uqpen.execution.batch import Batch
from uqpen.execution.open_blocks import OpenBlocks

# Size of the batches of a vectorised function. It never changes with the number of runs.
BATCH_SIZE = 1024

# Number of batches of a model whose runs are the same in any batch, and their smallest size. Larger
# batches take a third less time: a million runs of compiled rods 3.1 s in place of 4.7 s.
_BATCHES, _SMALLEST = 16, 1024

# Intended duration of the runs of one batch, in seconds: a crash must not cost too many runs, and a
# worker must not wait long for the next batch beside what its runs take. It waits for some ms.
WORTH_SENDING = 0.05
_MOST_AT_ONCE = 1024

# Number of answers over which the pace is measured.
_WINDOW = 32


def vectorized_batches(blocks: OpenBlocks, *, is_batch_independent: bool) -> Iterator[Batch]:
    """Yield batches for a model that takes many runs at a time, except those that are wholly done.

    A user's function may give other last bits in another batch. Its batches all have one size, so
    the first runs of a design keep every bit where the design gets more. If such a batch is done in
    part, it is made again as a whole. Batches begin where they would without blocks, so one of them
    may have runs of two.

    Parameters
    ----------
    blocks : OpenBlocks
        The runs from its position on. Batches end early behind a block that is complete without
        any of them: it has to be taken before others are drawn.
    is_batch_independent : bool
        Whether a run is the same in any batch; batches are then as large as workers can share.
    """
    size = BATCH_SIZE
    if is_batch_independent:
        size = min(max(-(-blocks.size // _BATCHES), _SMALLEST), BLOCK)
    while blocks.position < blocks.size:
        stop = min(blocks.position + size, blocks.size)
        done = blocks.done(blocks.position, stop)
        if is_batch_independent:
            stop = blocks.position + _stretch(done)
        if not done[: stop - blocks.position].all():
            yield blocks.start_batch(stop)
        elif blocks.skip(stop):
            return


def scalar_batches(blocks: OpenBlocks, pace: Pace) -> Iterator[Batch]:
    """Yield batches for a model that takes a run at a time; their size depends on its pace.

    `blocks` are those of `vectorized_batches`; each batch has runs of one block.
    """
    while blocks.position < blocks.size:
        block = blocks.block(blocks.position)
        done = block.done[blocks.position - block.start :]
        length = _stretch(done)
        if not done[0]:
            yield blocks.start_batch(blocks.position + min(pace.size, length))
        elif blocks.skip(blocks.position + length):
            return


def _stretch(done: BoolArray) -> int:
    """Return the number of the first runs that are alike: done before, or to be made."""
    return int((done != done[0]).argmax()) or len(done)


class Pace:
    """Rate at which runs complete; no result depends on it.

    `worth_sending` is the intended duration of the runs that are sent at once, in seconds. A run
    with limits is sent alone, and so is one that may end the study.
    """

    def __init__(self, worth_sending: float, *, is_alone: bool = False) -> None:
        self._worth_sending = worth_sending
        self.is_alone = is_alone
        self._answers: deque[tuple[float, int]] = deque(maxlen=_WINDOW)

    def record(self, runs: int) -> None:
        """Record a number of runs that have just completed."""
        self._answers.append((time.monotonic(), runs))

    @property
    def size(self) -> int:
        """Number of runs worth sending at once."""
        if self.is_alone or len(self._answers) < 2:
            return 1
        took = self._answers[-1][0] - self._answers[0][0]
        runs = sum(runs for _, runs in self._answers) - self._answers[0][1]
        if took * _MOST_AT_ONCE <= runs * self._worth_sending:
            return _MOST_AT_ONCE
        return max(1, int(runs * self._worth_sending / took))
