"""A study file as text: reading, limits on its extent, parsing and the line numbers of keys.

No study comes near the limits. They are there for a file that is none, or that somebody has made to
keep a reader busy: what exceeds them is refused before time or memory run out.
"""

from __future__ import annotations

import re
import stat
import tomllib
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from uqpen.core.errors import Problem, StudyError, counted, is_huge, toml_text

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


def _has_endless_keys(text: str) -> bool:
    """Check if the dotted keys of a text have too many parts to be parsed in reasonable time."""
    left = _MOST_PARTS_SQUARED
    for stretch in _STRETCH.finditer(text):
        left -= sum(1 for _ in _PART_END.finditer(stretch[0])) ** 2
        if left < 0:
            return True
    return False


def _extent_problems(content: dict[str, Any]) -> Iterator[Problem]:
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


_POSITION = re.compile(r"\s*\(at line (\d+), column (\d+)\)\Z")
# The first ones do not name in TOML's words, or not at all, what stands there twice.
_UNNAMED_MESSAGES = ("Cannot overwrite a value", "Cannot declare")
_DUPLICATE_MESSAGES = (*_UNNAMED_MESSAGES, "Cannot redefine", "Duplicate")
# Texts that a parser expects at frequent mistakes, by its message.
_QUOTED = 'a text stands in straight quotes, such as "5 mm"'
_KEY = 'other keys than of ASCII letters, digits, _ and - in quotes, such as "ξ" = 1'
_STATEMENT = f"[table], or key = value; {_KEY}"
_EXPECTED = {
    "Invalid value": f"a value of TOML, in which {_QUOTED}",
    "Illegal character '\\n'": "a quote at the end of the text",
    "Unclosed inline table": f"a comma or }} behind each value; {_QUOTED}",
    "Unclosed array": f"a comma or ] behind each value; {_QUOTED}",
    "Expected newline or end of document after a statement": f"one value; {_QUOTED}",
    "Expected '=' after a key in a key/value pair": _STATEMENT,
    "Expected ']' at the end of a table declaration": "a table in brackets, such as [inputs]",
    "Invalid statement": _STATEMENT,
    "Invalid initial character for a key part": _KEY,
}
# What stands there twice: a table in brackets, or a key.
_TWICE = re.compile(r"""\s*(\[+[^]]+\]+|[\w.\-"' ]*[\w"'])\s*(?:=|#|$)""")
_MANY_DIGITS = re.compile(r"[0-9_]{4301,}")

# Most characters that are parsed to find the lines of mistakes; it is some seconds. In a study
# so large, or with a value over so many lines, the mistakes left are told without their lines.
_MOST_PARSED = 8_000_000

_ABSENT = object()

# Nobody mends more mistakes than this before looking again.
MOST_LISTED = 50


class _CostlyError(Exception):
    """Error: the lines of more mistakes would take too long to find."""


Objects = Mapping[tuple[str | int, ...], Any]


@dataclass(frozen=True)
class Document:
    """Text and content of a study."""

    label: str  # name of its file in messages
    text: str  # verbatim
    content: dict[str, Any]  # the parsed text
    # Python objects that the text only names, by the path of the table that names each; None for a
    # file, which cannot name any.
    objects: Objects | None = None

    def value_text(self, path: Sequence[str | int]) -> str | None:
        """Return the value at a path about as its author wrote it; None where there is none."""
        value = _descend(self.content, path)
        return None if value is _ABSENT else toml_text(value)

    def line(self, path: Sequence[str | int]) -> int | None:
        """Return the line of the key at a path, or else of the table around it.

        TOML libraries do not give line numbers. But a file cut off after a line still parses,
        unless a value extends beyond that line, and it has the key from the line on that defines
        it. So the line is found by bisection.
        """
        path = list(path)
        while path and _descend(self.content, path) is _ABSENT:
            path.pop()
        if not path:
            return None
        try:
            end = bisect_left(
                range(len(self._lines)),
                True,
                key=lambda end: _descend(self._whole_prefix(end)[1], path) is not _ABSENT,
            )
            return self._whole_prefix(end - 1)[0] + 1
        except _CostlyError:
            return None

    @cached_property
    def _lines(self) -> list[str]:
        """Lines as TOML counts them: other line ends than these are text to it."""
        return [f"{line}\n" for line in self.text.split("\n")]

    @cached_property
    def _prefixes(self) -> dict[int, tuple[int, dict[str, Any]]]:
        """Cache of the results of `_whole_prefix`, by the number of lines."""
        return {0: (0, {})}

    @cached_property
    def _sizes(self) -> list[int]:
        """Sizes of the prefixes that were parsed."""
        return []

    def _whole_prefix(self, end: int) -> tuple[int, dict[str, Any]]:
        """Return the longest prefix, of `end` lines at most, that parses, and its content."""
        cut = end
        while cut not in self._prefixes:
            if sum(self._sizes) > _MOST_PARSED:
                raise _CostlyError
            prefix = "".join(self._lines[:cut])
            self._sizes.append(len(prefix))
            try:
                self._prefixes[cut] = cut, tomllib.loads(prefix)
            except ValueError:
                cut -= 1
        for line_count in range(cut + 1, end + 1):
            self._prefixes[line_count] = self._prefixes[cut]
        return self._prefixes[end]

    def error(self, problems: Sequence[Problem]) -> StudyError:
        """Return one error with all mistakes, in the order of their lines."""
        located = sorted(
            ((self.line(problem.path) or 0, problem) for problem in problems[:MOST_LISTED]),
            key=lambda pair: pair[0],
        )
        blocks = [f"{self.label}: {counted(len(problems), 'mistake')}; nothing was run"]
        blocks += [self._message_block(line, problem) for line, problem in located]
        if len(problems) > len(located):
            blocks.append(f"  and {len(problems) - len(located)} more")
        return StudyError("\n\n".join(blocks), [problem for _, problem in located])

    def _message_block(self, line: int | None, problem: Problem) -> str:
        return _message_block(self.label, line, problem)


class ArgumentsDocument(Document):
    """Study made from Python objects, as the text that states it.

    The content is the arguments' by name, so a mistake is located by its path alone.
    """

    def line(self, path: Sequence[str | int]) -> int | None:
        """Return None: whoever made the study has not seen these lines."""
        return None

    def _message_block(self, line: int | None, problem: Problem) -> str:
        argument = f"({problem.path[0]}=…)" if problem.path else ""
        return _message_block(f"{self.label}{argument}", None, problem)


def read_document(path: Path) -> Document:
    """Read and parse a study file.

    Raises
    ------
    StudyError
        If there is no such file, or it is not UTF-8, or not TOML.
    """
    label = str(path)
    try:
        data = _read_bytes(path)
    except OSError as error:
        raise StudyError(f"{label}: cannot be read: {error.strerror}") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        found = f"byte 0x{data[error.start]:02x}, which is not UTF-8"
        raise _parse_error(label, line, found, "a text file saved as UTF-8") from None
    return parse_document(text, label)


def _read_bytes(path: Path) -> bytes:
    """Read a file; raise a StudyError for what is too large, or is no file and might never end."""
    found = path.stat()
    if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
        raise _parse_error(str(path), None, "a device or a pipe", "a file")
    with path.open("rb") as file:
        data = file.read(LARGEST + 1)
    if len(data) > LARGEST:
        size = max(found.st_size, len(data))
        raise _parse_error(str(path), 1, f"{size} bytes", f"a study of at most {LARGEST} bytes")
    return data


def parse_document(
    text: str,
    label: str,
    objects: Objects | None = None,
    kind: type[Document] = Document,
) -> Document:
    """Parse a study's text; `label` names it in messages.

    Raises
    ------
    StudyError
        If it is not TOML.
    """
    if _has_endless_keys(text):
        raise _parse_error(label, None, "keys with too many dots", "a study")
    try:
        document = kind(label, text, tomllib.loads(text), objects)
    except tomllib.TOMLDecodeError as error:
        message = str(error)
        match = _POSITION.search(message)
        line = int(match[1]) if match else len(text.rstrip("\n").split("\n"))
        found = _POSITION.sub("", message).removesuffix(" (at end of document)")
        is_twice = message.startswith(_DUPLICATE_MESSAGES)
        by_message = _EXPECTED.get(found, "TOML (see https://toml.io)")
        expected = "every key and table once" if is_twice else by_message
        if message.startswith(_UNNAMED_MESSAGES) and (
            named := _TWICE.match(text.split("\n")[line - 1])
        ):
            found = f"{named[1]}, which is there already"
        raise _parse_error(label, line, found, expected) from None
    except ValueError as error:
        # A number with too many digits. Comments and texts may have them as well.
        digits = _MANY_DIGITS.search(text)
        place = text.count("\n", 0, digits.start()) + 1 if digits else None
        found = "a number of over 4300 digits" if digits else str(error)
        raise _parse_error(label, place, found, "fewer digits") from None
    except RecursionError:
        raise _parse_error(label, 1, "brackets nested too deeply", "a study") from None
    if problems := list(_extent_problems(document.content)):
        raise document.error(problems)
    return document


def inner_table(content: Mapping[str, Any], *keys: str) -> Mapping[str, Any]:
    """Return the table at a path of keys; an empty one where there is none."""
    for key in keys:
        inner = content.get(key)
        content = inner if isinstance(inner, dict) else {}
    return content


def _parse_error(label: str, line: int | None, found: str, expected: str) -> StudyError:
    problem = Problem((), found, expected)
    head = f"{label}: cannot be read as a study; nothing was run"
    return StudyError("\n\n".join([head, _message_block(label, line, problem)]), [problem])


def _message_block(label: str, line: int | None, problem: Problem) -> str:
    where = f"{label}:{line}" if line else label
    return (
        f"  {where}  {problem.key}".rstrip()
        + f"\n    found     {problem.found}\n    expected  {problem.expected}"
    )


def _descend(content: Any, path: Sequence[str | int]) -> Any:
    """Return the value at a path, or `_ABSENT`."""
    for key in path:
        if isinstance(key, str) and not isinstance(content, dict):
            return _ABSENT
        try:
            content = content[key]
        except (KeyError, IndexError, TypeError):
            return _ABSENT
    return content
