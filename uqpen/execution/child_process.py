"""Execution of runs in a child of this process, which can be killed."""

from __future__ import annotations

import atexit
import os
import threading

from uqpen.execution.batch import Batch, BatchResult, Work, join_results
from uqpen.execution.processes import ProcessPool

__all__ = ["run_in_child"]

_children: dict[int, ProcessPool] = {}
# A cluster's worker may have several threads, and they share the child.
_one_at_a_time = threading.Lock()


def run_in_child(work: Work, batch: Batch, pickled: bytes = b"") -> BatchResult:
    """Run a batch in a child of this process; the first call starts it, later ones use it again.

    The limits of the work are enforced. A run that kills the child fails as *crashed*, and no
    other. `pickled` is the work as it is sent to the child, if it has been pickled before.
    """
    # Limits are those of one run.
    batches = batch.singles() if work.limits else [batch]
    with _one_at_a_time:
        batch_results = list(_child_pool()(work, batches, pickled))
    batch_results.sort(key=lambda part: part.start)
    warnings = dict.fromkeys(text for part in batch_results for text in part.warnings)
    results = join_results([part.results for part in batch_results])
    return BatchResult(batch.start, results, tuple(warnings))


def _child_pool() -> ProcessPool:
    process = os.getpid()
    if process not in _children:
        _children[process] = ProcessPool(1)
        atexit.register(_children[process].kill_workers)
    return _children[process]
