"""Pace at which finished runs are written while others are made."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator

from uqpen.core.streams import BLOCK

__all__ = ["SavingPace"]

# Spend at most 1/6 of the time on checkpoints: wait five times as long as the last one took. It
# takes about a millisecond, so a run of more than 5 ms is saved at once.
_PATIENCE = 5

# Runs of a round in memory that are not written yet: a few blocks, however cheap a run is.
_MOST_UNWRITTEN = 4 * BLOCK


class SavingPace:
    """Pace of checkpoints, by the time that the last one took."""

    def __init__(self) -> None:
        self._last = time.monotonic()
        self._cost = 0.0

    def is_due(self, unwritten: int) -> bool:
        """Check whether a round with a number of unwritten runs is to be written now."""
        is_over = time.monotonic() - self._last >= _PATIENCE * self._cost
        return is_over or unwritten >= _MOST_UNWRITTEN

    @contextlib.contextmanager
    def measured(self) -> Iterator[None]:
        """Measure the writing within this context."""
        began = time.monotonic()
        yield
        self._last = time.monotonic()
        self._cost = self._last - began
