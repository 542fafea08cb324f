"""Text made fit for a terminal: without commands to it, and in the characters that it has."""

from __future__ import annotations

import codecs
import json
import sys

__all__ = ["SPELLED_OUT", "printable", "printable_json", "screen_text"]

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


def printable_json(text: str) -> str:
    """Write the control characters in the texts of a JSON document as JSON's escapes.

    It says the same as before. JSON itself escapes only the first 32 characters of Unicode.
    """
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
