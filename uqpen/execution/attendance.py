"""Workers of a cluster: reports on a study that has none."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import timedelta

__all__ = ["Attendance"]

# Seconds without a worker before the first report; each later one waits twice as long.
_FIRST_REPORT = 10.0


class Attendance:
    """Presence of workers, with reports on how long there has been none.

    Parameters
    ----------
    report : callable
        Receives the text of a report.
    clock : callable
        Returns the time in seconds.
    """

    def __init__(
        self, report: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._report = report
        self._clock = clock
        self._absent_since: float | None = None
        self._next_report = _FIRST_REPORT

    def record(self, workers: int) -> None:
        """Record the number of workers, and report where there have been none for a while."""
        now = self._clock()
        if self._absent_since is None:
            self._absent_since = None if workers else now
            return
        absent = now - self._absent_since
        duration = timedelta(seconds=round(absent))
        if workers:
            if self._next_report > _FIRST_REPORT:
                self._report(f"the cluster has workers again, after {duration} without")
            self._absent_since, self._next_report = None, _FIRST_REPORT
        elif absent >= self._next_report:
            self._report(f"the cluster has had no worker for {duration}; the study waits for one")
            self._next_report = 2 * absent
