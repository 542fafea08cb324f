"""Location of an output in the files of a run: one class for each kind of file."""

from __future__ import annotations

import contextlib
import math
import re
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass
from typing import Any

from uqpen.core.arrays import FloatArray, floats
from uqpen.core.errors import toml_text
from uqpen.core.settings import count, text, validate
from uqpen.models.command.written import RunFiles, UnreadableError

__all__ = ["CsvReader", "JsonReader", "NetcdfReader", "OutputReader", "TextReader"]


def _row(default: int | None) -> Any:
    expected = "a whole number: rows count from 0, and back from -1"
    return count(minimum=-math.inf, maximum=math.inf, default=default, expected=expected)


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
        A regular expression; its last match counts.
    group : int
        Number of the group that contains the number.
    """

    pattern: str
    group: int = 1

    def value(self, written: RunFiles) -> float:
        matches = re.finditer(self.pattern, written.text(self.file), re.MULTILINE)
        last = next(iter(deque(matches, maxlen=1)), None)
        if last is None:
            raise UnreadableError(f"no match for {toml_text(self.pattern)} in {self.file}")
        place = f"what {toml_text(self.pattern)} matches in {self.file}"
        return _parse_number(last[self.group] or "", place)


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
