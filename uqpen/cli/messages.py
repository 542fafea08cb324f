"""Messages on standard error: wrapped on a terminal, and whole lines for other programs."""

from __future__ import annotations

import os
import re
import sys
import textwrap
from enum import IntEnum
from typing import TextIO

import click

from uqpen.cli.printable import printable

__all__ = ["ExitCode", "show_message", "wrapped_message"]

_WIDTH = 80
_LEAST_WIDTH = 40

# Further lines stand below the text, not below the words in front of it.
_HEAD = re.compile(r" *(?:found +|expected +)?")
# Texts in quotes, such as quantities and paths, stay in one piece.
_QUOTED = re.compile(r'"[^"\n]*"')
_SPACE = "\0"


def show_message(text: str) -> None:
    """Show a message on standard error."""
    click.echo(wrapped_message(text), err=True)


def wrapped_message(text: str, stream: TextIO | None = None) -> str:
    """Return a message with its control characters spelled out, wrapped at a terminal's width.

    Where its stream, by default standard error, is no terminal, no line is wrapped, so that a
    program such as grep finds a sentence. No word and no text in quotes is broken, so a path stays
    whole.
    """
    text = printable(text)
    stream = stream or sys.stderr
    if not stream.isatty():
        return text
    columns = os.environ.get("COLUMNS", "")
    if columns.isdecimal():
        width = int(columns)
    else:
        try:
            width = os.get_terminal_size(stream.fileno()).columns
        except (OSError, ValueError):
            width = 0
    width = max(width or _WIDTH, _LEAST_WIDTH)
    return "\n".join(_wrapped_line(line, width) for line in text.split("\n"))


def _wrapped_line(line: str, width: int) -> str:
    head = _HEAD.match(line)
    indent = " " * (head.end() if head else 0)
    whole = _QUOTED.sub(lambda quoted: quoted[0].replace(" ", _SPACE), line)
    wrapped = textwrap.fill(
        whole,
        width,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
        replace_whitespace=False,
    )
    return wrapped.replace(_SPACE, " ")


# Exit codes of commands.


class ExitCode(IntEnum):
    """Exit codes; 1, a fault of uqpen's own, is Python's after a traceback."""

    DONE = 0
    MISTAKE = 2
    TOO_MANY_FAILED = 3
    DIFFERENT = 4
    INTERRUPTED = 130
