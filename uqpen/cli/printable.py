"""Text from elsewhere, made safe for a terminal."""

from __future__ import annotations

__all__ = ["printable"]


def printable(text: str) -> str:
    """A text whose control characters are spelled out, but for the ends of lines."""
    return "".join(
        character
        if character.isprintable() or character in "\n\u202f"
        else character.encode("unicode_escape").decode("ascii")
        for character in text
    )
