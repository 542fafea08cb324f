"""Exit codes of commands."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["ExitCode"]


class ExitCode(IntEnum):
    """Exit codes; 1, a fault of uqpen's own, is Python's after a traceback."""

    DONE = 0
    MISTAKE = 2
    TOO_MANY_FAILED = 3
    DIFFERENT = 4
    INTERRUPTED = 130
