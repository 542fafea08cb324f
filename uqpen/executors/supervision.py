"""Runs that a process does not make itself, but a child of its own, which it can end."""

from __future__ import annotations

import atexit
import os
import threading
from typing import TYPE_CHECKING

from uqpen.executors.work import Batch, Piece, Work, joined

if TYPE_CHECKING:
    from uqpen.executors.processes import Pool

__all__ = ["in_child", "is_supervised", "set_supervised"]

_is_supervised = False
_children: dict[int, Pool] = {}
# A cluster's worker may have several threads, and they share the child.
_one_at_a_time = threading.Lock()


def is_supervised() -> bool:
    """Whether this process is one that another can end, should a run hang."""
    return _is_supervised


def set_supervised() -> None:
    """Say that this process is one that another can end."""
    global _is_supervised
    _is_supervised = True


def in_child(work: Work, batch: Batch, pickled: bytes = b"") -> Piece:
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
        pieces = list(_child()(work, batches, pickled))
    pieces.sort(key=lambda piece: piece.start)
    warnings = dict.fromkeys(text for piece in pieces for text in piece.warnings)
    return Piece(batch.start, joined([piece.results for piece in pieces]), tuple(warnings))


def _child() -> Pool:
    from uqpen.executors.processes import Pool

    process = os.getpid()
    if process not in _children:
        _children[process] = Pool(1)
        atexit.register(_children[process].kill)
    return _children[process]
