"""Why a run was lost, in words that are the same each time it is lost to the same."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from uqpen.models.reasons import one_line

__all__ = ["last_line", "remove_variable_parts"]

# How much of the end of a file is looked at for its last line.
_TAIL = 8192

# What changes from run to run in what programs print, and what stands for it.
_UNSTEADY = (
    (re.compile(r"\b0[xX][0-9a-fA-F]+\b"), "0x…"),  # addresses
    (re.compile(r"\b[0-9]{4}-[0-9]{2}-[0-9]{2}\b"), "…"),  # dates
    (re.compile(r"\b[0-9]{1,2}:[0-9]{2}(:[0-9]{2}([.,][0-9]+)?)?\b"), "…"),  # times of day
    (re.compile(r"(?i)\b((?:pid|process|thread)\W{0,3})[0-9]+\b"), r"\1…"),
    (re.compile(r"\[[0-9]+\]|==[0-9]+=="), "…"),  # process numbers before a message
    (re.compile(r"(?<![\w./])(?:/[^\s/:;,'\"()<>]+)+/"), ""),  # folders before the name of a file
)


def last_line(path: Path) -> str:
    """The last line of a file that holds anything; empty where there is none."""
    try:
        with path.open("rb") as stream:
            stream.seek(0, 2)
            stream.seek(max(0, stream.tell() - _TAIL))
            lines = stream.read().decode("utf-8", "replace").splitlines()
    except OSError:
        return ""
    return next((line for line in reversed(lines) if line.strip()), "")


def remove_variable_parts(text: str, folders: Iterable[Path]) -> str:
    """A line without what changes from run to run or from machine to machine.

    Parameters
    ----------
    text : str
        What a program printed.
    folders : iterable of Path
        Where it ran, and where its files lie; what lies in them keeps its name.

    >>> steady("[812] /usr/lib/solver.so: overflow at 0x7f3a at 12:31:07", [])
    '… solver.so: overflow at 0x… at …'
    """
    for folder in folders:
        if folder.name:  # not the root of all
            text = text.replace(f"{folder}/", "").replace(str(folder), ".")
    for pattern, instead in _UNSTEADY:
        text = pattern.sub(instead, text)
    return one_line("".join(each if each.isprintable() else " " for each in text))
