"""Line of the user's own code at which a run has failed, for its reason."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from pathlib import Path
from types import CodeType
from typing import Any

from uqpen.models.function_source import FunctionSource
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_code import one_line

__all__ = ["line_in_folder", "line_in_function"]

# An exception of a class of its own may have another attribute of this name.
_TRACEBACK = BaseException.__dict__["__traceback__"]

# Characters of a line that are shown.
_LONGEST_LINE = 80


def line_in_folder(error: BaseException, folder: ModelFolder) -> str:
    """Return the innermost line of a folder's modules in the traceback of an exception.

    The file is named as in the folder, so the text is the same wherever the folder is. The
    traceback is removed from the exception: an exception that is raised again adds to it.

    Returns
    -------
    str
        Such as `` (beam.py, line 7: return force / area)``; empty where no module is there.
    """
    for code, number in reversed(_lines(error)):
        content = folder.module_content(code.co_filename)
        if content is not None:
            name = _file_name(Path(code.co_filename), folder.folder)
            return _line_text(name, number, content)
    return ""


def line_in_function(
    error: BaseException, function: Callable[..., Any], source: FunctionSource
) -> str:
    """Return the line of a function itself in the traceback of an exception, as `line_in_folder`.

    Lines count from that of its definition, wherever that stands in a program or a notebook.
    """
    for code, number in reversed(_lines(error)):
        if code is getattr(function, "__code__", None):
            own = number - code.co_firstlineno + 1
            return _line_text(source.name, own, source.text.encode())
    return ""


def _lines(error: BaseException) -> list[tuple[CodeType, int]]:
    """Return the code and the number of each line in a traceback, which is removed."""
    frames = _TRACEBACK.__get__(error)
    _TRACEBACK.__set__(error, None)
    return [(frame.f_code, number) for frame, number in traceback.walk_tb(frames)]


def _file_name(path: Path, folder: Path) -> str:
    """Return the path of a file within a folder; the bare name of a file outside it."""
    is_inside = path.is_relative_to(folder) and ".." not in path.relative_to(folder).parts
    return path.relative_to(folder).as_posix() if is_inside else path.name


def _line_text(name: str, number: int, source: bytes) -> str:
    # Python ends lines where bytes do. Texts end them also at a form feed, or inside a quotation.
    lines = source.splitlines()
    line = one_line(lines[number - 1].decode("utf-8", "replace")) if number <= len(lines) else ""
    line = line if len(line) <= _LONGEST_LINE else f"{line[: _LONGEST_LINE - 1]}…"
    return f" ({name}, line {number}{f': {line}' if line else ''})"
