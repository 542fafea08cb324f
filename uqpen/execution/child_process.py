"""Runs that a process does not make itself, but a child of its own, which it can end."""

from __future__ import annotations

import atexit
import os
import threading
from typing import TYPE_CHECKING

from uqpen.execution.batch import Batch, BatchResult, Work, join_results

if TYPE_CHECKING:
    from uqpen.execution.processes import ProcessPool

__all__ = ["is_child_process", "mark_as_child_process", "run_in_child"]

_is_child_process = False
_children: dict[int, ProcessPool] = {}
# A cluster's worker may have several threads, and they share the child.
_one_at_a_time = threading.Lock()


def is_child_process() -> bool:
    """Whether this process is one that another can end, should a run hang."""
    return _is_child_process


def mark_as_child_process() -> None:
    """Say that this process is one that another can end."""
    global _is_child_process
    _is_child_process = True


def run_in_child(work: Work, batch: Batch, pickled: bytes = b"") -> BatchResult:
    """What came of a batch in a child of this process, which is there from the first one on.

    Parameters
    ----------
    work : Work
        Whose limits are kept.
    batch : Batch
        If a run of it kills the child, that one is lost as *crashed*, and no other.
    pickled : bytes
        The work as it is sent to the child; empty where it has not been pickled yet.
    """
    # A limit is one run's.
    batches = batch.singles() if work.limits else [batch]
    with _one_at_a_time:
        batch_results = list(_child_pool()(work, batches, pickled))
    batch_results.sort(key=lambda batch_result: batch_result.start)
    warnings = dict.fromkeys(
        text for batch_result in batch_results for text in batch_result.warnings
    )
    return BatchResult(
        batch.start,
        join_results([batch_result.results for batch_result in batch_results]),
        tuple(warnings),
    )


def _child_pool() -> ProcessPool:
    from uqpen.execution.processes import ProcessPool

    process = os.getpid()
    if process not in _children:
        _children[process] = ProcessPool(1)
        atexit.register(_children[process].kill_workers)
    return _children[process]
