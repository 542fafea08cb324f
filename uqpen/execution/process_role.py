"""The role of this process: whether another process can end it."""

from __future__ import annotations

__all__ = ["is_child_process", "mark_as_child_process"]

_is_child_process = False


def is_child_process() -> bool:
    """Check that another process can end this one, should a run hang."""
    return _is_child_process


def mark_as_child_process() -> None:
    """Record that another process can end this one."""
    global _is_child_process
    _is_child_process = True
