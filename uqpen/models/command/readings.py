"""Location of an output in the files of a run: one class for each kind of file."""

from __future__ import annotations

import contextlib
import math
import re
import warnings
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Literal

from uqpen.core.arrays import FloatArray, floats
from uqpen.core.errors import toml_text
from uqpen.core.model import RunWarning
from uqpen.core.settings import choice, count, setting, text, validate
from uqpen.models.command.written import RunFiles, UnreadableError

__all__ = [
    "ColumnReader",
    "CsvReader",
    "JsonReader",
    "NetcdfReader",
    "OutputReader",
    "TextReader",
]

# Lines of a table of columns that begin so are comments; the first one may have the headings.
_COMMENT = ("#", "%", "!", "*")


def _row(default: int | None) -> Any:
    expected = "a whole number: rows count from 0, and back from -1"
    return count(minimum=-math.inf, maximum=math.inf, default=default, expected=expected)


def _column_number_or_heading() -> Any:
    return setting(
        "count or text",
        "a heading, or a whole number: columns count from 0, and back from -1",
        lambda value: type(value) is int or (isinstance(value, str) and bool(value.strip())),
    )


def _after() -> Any:
    return text(expected="a text; what stands after its last occurrence is read", default=None)


@dataclass(frozen=True)
class OutputReader(ABC):
    """Reader of an output in a file of the run's folder, ``stdout`` and ``stderr`` among them."""

    file: str

    def __post_init__(self) -> None:
        validate(self)

    @abstractmethod
    def value(self, written: RunFiles) -> float:
        """Return the output in the program's unit; UnreadableError gives the reason for none."""


@dataclass(frozen=True)
class JsonReader(OutputReader):
    """Reader of a number in a JSON document.

    Parameters
    ----------
    key : str
        Names and positions that lead to it, with dots between: ``result.depth``, ``depths.0``.
    """

    key: str = text(expected="the names that lead to it, with dots between")

    def value(self, written: RunFiles) -> float:
        found = written.document(self.file)
        for part in [self.key] if _has_part(found, self.key) else self.key.split("."):
            if not _has_part(found, part):
                raise UnreadableError(f'{self.file} has no "{self.key}"')
            found = found[part if isinstance(found, dict) else int(part)]
        if isinstance(found, bool) or not isinstance(found, int | float):
            raise UnreadableError(f'"{self.key}" in {self.file} is no number')
        return _to_float(found)


@dataclass(frozen=True)
class CsvReader(OutputReader):
    """Reader of a number in a CSV file under a row of headings.

    Parameters
    ----------
    column : str
        The heading.
    row : int
        Position among the rows below the headings, from 0; the last is -1.
    """

    column: str = text(expected="a heading")
    row: int = _row(-1)

    def value(self, written: RunFiles) -> float:
        rows = written.table(self.file)
        if not rows:
            raise UnreadableError(f"{self.file} is empty")
        header, *entries = rows
        column = self.column.strip()
        if column not in header:
            raise UnreadableError(f'{self.file} has no column "{column}"')
        place = f'row {self.row} of column "{column}" in {self.file}'
        position = header.index(column)
        if not -len(entries) <= self.row < len(entries) or position >= len(entries[self.row]):
            raise UnreadableError(f"there is no {place}")
        return _parse_number(entries[self.row][position], place)


@dataclass(frozen=True)
class ColumnReader(OutputReader):
    """Reader of a number in a table whose columns are separated by blanks.

    Parameters
    ----------
    column : str or int
        The heading, in the first line of the table, which may be a comment; or the position, from
        0, the last is -1.
    row : int
        Position among the lines that are no comments, without the headings; from 0, the last is -1.
    after : str, optional
        A text; the table begins in the line below its last occurrence.
    """

    column: str | int = _column_number_or_heading()
    row: int = _row(-1)
    after: str | None = _after()

    def value(self, written: RunFiles) -> float:
        content = _text_after(written, self.file, self.after)
        if self.after is not None:
            content = content.partition("\n")[2]
        lines = [line.strip() for line in content.splitlines() if line.strip()]
        position = self.column
        if isinstance(position, str):
            headings = lines[0].lstrip("".join(_COMMENT)).split() if lines else []
            if position not in headings:
                raise UnreadableError(f'{self.file} has no column "{position}"')
            position, lines = headings.index(position), lines[1:]
        rows = [line.split() for line in lines if not line.startswith(_COMMENT)]
        place = f"row {self.row} of column {toml_text(self.column)} in {self.file}"
        try:
            number = rows[self.row][position]
        except IndexError:
            raise UnreadableError(f"there is no {place}") from None
        return _parse_number(number, place)


@dataclass(frozen=True)
class NetcdfReader(OutputReader):
    """Reader of a number in a NetCDF file.

    Parameters
    ----------
    variable : str
        Its name, groups before it with slashes between.
    row : int, optional
        Position of the value in a one-dimensional variable, from 0; the last is -1.
    """

    variable: str = text(expected="the name of a variable")
    row: int | None = _row(None)

    def value(self, written: RunFiles) -> float:
        values = self._values(written)
        place = f'"{self.variable}" in {self.file}'
        if self.row is None and values.size == 1:
            return float(values.reshape(()))
        if self.row is None or values.ndim != 1:
            wanted = "a single number" if self.row is None else "numbers along one dimension"
            raise UnreadableError(f"{place} is of shape {values.shape}, not {wanted}")
        if not -values.size <= self.row < values.size:
            raise UnreadableError(f"there is no row {self.row} of {place}")
        return float(values[self.row])

    def _values(self, written: RunFiles) -> FloatArray:
        import netCDF4

        path = written.path(self.file)
        try:
            with netCDF4.Dataset(path) as dataset:
                return floats(dataset[self.variable][...])
        except (IndexError, KeyError):
            raise UnreadableError(f'{self.file} has no "{self.variable}"') from None
        except (TypeError, ValueError):
            raise UnreadableError(f'"{self.variable}" in {self.file} is no number') from None
        except (OSError, RuntimeError, AttributeError):
            # A group has no values; for a damaged file, the library raises several types of errors.
            reason = f'{self.file} is not NetCDF, or has no "{self.variable}"'
            raise UnreadableError(reason) from None


@dataclass(frozen=True)
class TextReader(OutputReader):
    """Reader of a number in any text.

    Parameters
    ----------
    pattern : str
        A regular expression.
    group : int
        Number of the group that contains the number.
    match : str, optional
        Which match counts: the ``"first"``, the ``"last"`` (as without it, but then several matches
        are warned of), or the one with the smallest (``"min"``) or largest (``"max"``) number.
    after : str, optional
        A text; only what stands after its last occurrence is searched.
    """

    pattern: str
    group: int = 1
    match: Literal["first", "last", "min", "max"] | None = choice(
        "first",
        "last",
        "min",
        "max",
        default=None,
        expected='which match counts: "first", "last", "min" or "max"',
    )
    after: str | None = _after()

    def value(self, written: RunFiles) -> float:
        content = _text_after(written, self.file, self.after)
        matches = re.finditer(self.pattern, content, re.MULTILINE)
        numbers = [match[self.group] or "" for match in matches]
        pattern = toml_text(self.pattern)
        if not numbers:
            raise UnreadableError(f"no match for {pattern} in {self.file}")
        place = f"what {pattern} matches in {self.file}"
        if self.match in ("min", "max"):
            found = [_parse_number(number, place) for number in numbers]
            return min(found) if self.match == "min" else max(found)
        if len(numbers) > 1 and self.match is None:
            message = (
                f'matches for {pattern} in {self.file}; the last is taken ("match" can say which)'
            )
            warning = RunWarning(f"several {message}", f"{len(numbers)} {message}")
            warnings.warn(warning, stacklevel=2)
        return _parse_number(numbers[0 if self.match == "first" else -1], place)


def _text_after(written: RunFiles, file: str, after: str | None) -> str:
    """Return the text of a file, or what stands in it after the last occurrence of another."""
    content = written.text(file)
    if after is None:
        return content
    _, found, rest = content.rpartition(after)
    if not found:
        raise UnreadableError(f"{file} does not contain {toml_text(after)}")
    return rest


def _has_part(found: Any, part: str) -> bool:
    if isinstance(found, dict):
        return part in found
    is_position = isinstance(found, list) and part.isascii() and part.isdecimal() and len(part) < 10
    return is_position and int(part) < len(found)


def _to_float(value: float) -> float:
    """Convert a number of JSON to a float; an integer may be too large for one."""
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")


def _parse_number(text: str, place: str) -> float:
    """Parse a printed number, which may have a Fortran exponent."""
    written = text.strip().lower()
    for number in (written, written.replace("d", "e")):
        with contextlib.suppress(ValueError):
            return float(number)
    raise UnreadableError(f"{place} is no number")
