"""Reason of a failed run in the form of an archive: one line, not too long."""

from __future__ import annotations

__all__ = ["one_line"]

_LONGEST = 200


def one_line(text: str) -> str:
    """Convert a text to a reason: one line, not too long, and no unpaired surrogates."""
    line = " ".join(text.encode("utf-8", "replace").decode("utf-8").split())
    return line if len(line) <= _LONGEST else line[: _LONGEST - 1] + "…"
