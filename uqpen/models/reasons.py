"""Why a run was lost, as an archive can hold it: one line, not too long."""

from __future__ import annotations

__all__ = ["one_line"]

_LONGEST = 200


def one_line(text: str) -> str:
    """A text as a reason can hold it: one line, not too long, and no half characters."""
    line = " ".join(text.encode("utf-8", "replace").decode("utf-8").split())
    return line if len(line) <= _LONGEST else line[: _LONGEST - 1] + "…"
