"""Reason of a failed run, in words that are the same for the same cause."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from uqpen.models.reasons import one_line

__all__ = ["last_line", "remove_variable_parts"]

# Bytes at the end of a file in which its last line is searched.
_TAIL = 8192

# Parts of printed texts that differ between runs, and their replacements.
_UNSTEADY = (
    (re.compile(r"\b0[xX][0-9a-fA-F]+\b"), "0x…"),  # addresses
    (re.compile(r"\b[0-9]{4}-[0-9]{2}-[0-9]{2}\b"), "…"),  # dates
    (re.compile(r"\b[0-9]{1,2}:[0-9]{2}(:[0-9]{2}([.,][0-9]+)?)?\b"), "…"),  # times of day
    (re.compile(r"(?i)\b((?:pid|process|thread)\W{0,3})[0-9]+\b"), r"\1…"),
    (re.compile(r"\[[0-9]+\]|==[0-9]+=="), "…"),  # process numbers before a message
    (re.compile(r"(?<![\w./])(?:/[^\s/:;,'\"()<>]+)+/"), ""),  # folders before the name of a file
)


def last_line(path: Path) -> str:
    """Return the last non-blank line of a file; empty if there is none."""
    try:
        with path.open("rb") as stream:
            stream.seek(0, 2)
            stream.seek(max(0, stream.tell() - _TAIL))
            lines = stream.read().decode("utf-8", "replace").splitlines()
    except OSError:
        return ""
    return next((line for line in reversed(lines) if line.strip()), "")


def remove_variable_parts(text: str, folders: Iterable[Path]) -> str:
    """Remove the parts of a line that differ between runs or machines.

    The folders are those that may occur in it; names of files in them are kept.

    >>> line = "[812] /usr/lib/solver.so: overflow at 0x7f3a at 12:31:07"
    >>> remove_variable_parts(line, [])
    '… solver.so: overflow at 0x… at …'
    """
    for folder in folders:
        if folder.name:  # not the root of all
            text = text.replace(f"{folder}/", "").replace(str(folder), ".")
    for pattern, instead in _UNSTEADY:
        text = pattern.sub(instead, text)
    return one_line("".join(each if each.isprintable() else " " for each in text))
