"""Messages of commands: text fit for a terminal, standard error, exit codes."""

from __future__ import annotations

import codecs
import gc
import json
import os
import re
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import TextIO

import click

# Text made fit for a terminal: without commands to it, and in the characters that it has.

# The name of an error handler for streams: a character that the encoding lacks becomes others.
SPELLED_OUT = "uqpen.spelled_out"

_SPELLED_OUT = {
    "±": "+/-",
    "…": "...",
    "≤": "<=",
    "≥": ">=",
    "→": "->",
    "–": "-",
    "─": "-",
    "×": "x",
    "−": "-",
    "⁻": "-",
    "\u202f": " ",
    **dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789", strict=True)),
}


def printable(text: str) -> str:
    """Spell out the control characters of a text, but for the ends of lines."""
    return "".join(
        character if _is_shown(character) else character.encode("unicode_escape").decode("ascii")
        for character in text
    )


def screen_text(text: str) -> str:
    """Spell a text out as standard output will, so that its width is known before it is shown."""
    encoding = sys.stdout.encoding or "utf-8"
    return printable(text).encode(encoding, SPELLED_OUT).decode(encoding)


def printable_json(value: object) -> str:
    """Return a value as JSON, with all control characters in its texts as JSON's escapes.

    JSON itself escapes only the first 32 characters of Unicode.
    """
    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)
    return "".join(
        character if _is_shown(character) else json.dumps(character)[1:-1] for character in text
    )


def _is_shown(character: str) -> bool:
    return character.isprintable() or character in "\n\u202f"


def _spell_out_error(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    missing = error.object[error.start : error.end]
    return "".join(_SPELLED_OUT.get(character, "?") for character in missing), error.end


codecs.register_error(SPELLED_OUT, _spell_out_error)


# Messages on standard error: wrapped on a terminal, and whole lines for other programs.

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


# Imports of a command.


@contextmanager
def loading() -> Iterator[None]:
    """Import modules within this context: Python takes no object for garbage, then or later.

    They make some 80 000 objects that stay, and are searched 250 times otherwise.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()
