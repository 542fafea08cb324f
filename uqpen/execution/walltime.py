"""Time that a batch system leaves to a worker, so that no run is begun that cannot end."""

from __future__ import annotations

import math
import os
import time

__all__ = ["ENDS_AT", "leave_if_late"]

# Environment variable of a worker: the end of its job, in seconds since 1970; empty if unknown.
ENDS_AT = "UQPEN_ENDS_AT"

# Seconds for the result of the run before to be fetched. It goes with this worker, and where no
# other is there to keep it, its run is made again.
_UNTIL_FETCHED = 2.0

# A run may take a fifth longer than the longest before.
_MARGIN = 1.2


def leave_if_late(seconds: float) -> None:
    """Give a task back to the scheduler and end this Dask worker, if its job ends too soon.

    Parameters
    ----------
    seconds : float
        The expected duration of the task; 0 for a worker that does not know it, and tries.

    Raises
    ------
    Reschedule
        If it is too late; Dask then gives the task to another worker.
    """
    if seconds and _MARGIN * seconds > _seconds_left():
        from distributed import Reschedule, get_worker

        time.sleep(_UNTIL_FETCHED)
        worker = get_worker()
        worker.loop.add_callback(worker.close_gracefully)
        raise Reschedule


def _seconds_left() -> float:
    try:
        return float(os.environ[ENDS_AT]) - time.time()
    except (KeyError, ValueError):
        return math.inf
