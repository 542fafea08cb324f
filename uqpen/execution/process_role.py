"""The role of this process: whether another process can end it."""

from __future__ import annotations

__all__ = ["is_child_process", "mark_as_child_process"]

_is_child_process = False


def is_child_process() -> bool:
    """Return whether this process is one that another can end, should a run hang."""
    return _is_child_process


def mark_as_child_process() -> None:
    """Note that this process is one that another can end."""
    global _is_child_process
    _is_child_process = True
