"""Limits on the extent of a study: what exceeds them is refused before time or memory run out.

No study comes near them. They are there for a file that is none, or that somebody has made to keep
a reader busy.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from uqpen.core.errors import Problem, is_huge, toml_text

__all__ = ["LARGEST", "extent_problems", "has_endless_keys"]

# Most bytes of a study's text.
LARGEST = 4 * 1024 * 1024

# Most keys of all tables, and most tables and lists inside each other.
_MOST_KEYS, _DEEPEST = 100_000, 50

# The parser takes the square of the number of parts of each dotted key in time; this sum of squares
# is about a second.
_MOST_PARTS_SQUARED = 10_000_000

# Stretches of a text without what a dotted key cannot contain outside quotes; the parts of a key.
_STRETCH = re.compile(r"[^\n,=#{}]++")
_PART_END = re.compile(r"[A-Za-z0-9_\"'-][ \t]*+\.")


def has_endless_keys(text: str) -> bool:
    """Check if the dotted keys of a text have too many parts to be parsed in reasonable time."""
    left = _MOST_PARTS_SQUARED
    for stretch in _STRETCH.finditer(text):
        left -= sum(1 for _ in _PART_END.finditer(stretch[0])) ** 2
        if left < 0:
            return True
    return False


def extent_problems(content: dict[str, Any]) -> Iterator[Problem]:
    """Yield the first part of a study's content, if there is any, that is beyond a limit."""
    # A stack of its own: recursion could be too deep for Python.
    waiting: list[tuple[tuple[str | int, ...], Any]] = [((), content)]
    keys = 0
    while waiting:
        path, value = waiting.pop()
        if is_huge(value):
            yield Problem(path, toml_text(value), "a whole number of at most 4000 digits")
            return
        if not isinstance(value, dict | list):
            continue
        if len(path) > _DEEPEST:
            expected = f"at most {_DEEPEST} tables inside each other"
            yield Problem(path[:2], f"tables nested {len(path)} deep", expected)
            return
        if isinstance(value, dict):
            keys += len(value)
            if keys > _MOST_KEYS:
                yield Problem(path[:1], f"over {_MOST_KEYS} keys", "a study with fewer of them")
                return
        entries = value.items() if isinstance(value, dict) else enumerate(value)
        waiting += [((*path, key), entry) for key, entry in entries]
