"""Readers of the outputs of a program: JSON, NetCDF, tables and any text."""

from __future__ import annotations

import contextlib
import csv
import errno
import io
import itertools
import json
import math
import re
import signal
import threading
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, Literal

import numpy as np

from uqpen.core.arrays import FloatArray, floats
from uqpen.core.errors import toml_text
from uqpen.core.files import NotAFileError, read_file
from uqpen.core.limits import Limits
from uqpen.core.model import RunWarning
from uqpen.core.netcdf.opening import RefusedContentError, read_variable
from uqpen.core.settings import choice, count, setting, text, validate
from uqpen.core.status import Status

# Files that a run has written: they can contain anything, and each is read once.

# Largest file that is read: a run gone wild must not take this process along.
_LARGEST = 64 * 1024 * 1024


class UnreadableError(Exception):
    """Requested content is not there; the message is the reason of a failed run.

    Of an entry of a list that is no number, `position` is its position there.
    """

    def __init__(
        self, reason: str, position: int | None = None, status: Status = Status.FAILED
    ) -> None:
        super().__init__(reason)
        self.position = position
        self.status = status


@dataclass
class RunFiles:
    """Files in the folder of a run, and the limits of the run."""

    folder: Path
    limits: Limits = Limits()
    _texts: dict[str, str] = field(default_factory=dict)
    _documents: dict[str, Any] = field(default_factory=dict)
    _tables: dict[tuple[str, str | None], list[list[str]]] = field(default_factory=dict)

    def content(self, name: str) -> bytes:
        """Return the bytes of a file.

        UnreadableError if it is not there, is no file (reading a pipe would never end) or is huge.
        """
        try:
            return read_file(self.folder / name, _LARGEST)
        except (FileNotFoundError, NotADirectoryError):
            raise UnreadableError(f"wrote no {name}") from None
        except NotAFileError:
            raise UnreadableError(f"{name} is no file") from None
        except OSError as error:
            is_large = error.errno == errno.EFBIG
            found = f"is larger than {_LARGEST // 2**20} MiB" if is_large else "cannot be read"
            raise UnreadableError(f"{name} {found}") from None

    def text(self, name: str) -> str:
        """Return a file as text; bytes that are not UTF-8 become replacement characters."""
        if name not in self._texts:
            self._texts[name] = self.content(name).decode("utf-8-sig", "replace")
        return self._texts[name]

    def document(self, name: str) -> Any:
        """Return the content of a JSON file."""
        if name not in self._documents:
            try:
                self._documents[name] = json.loads(self.text(name))
            except (ValueError, RecursionError):
                found = "is not JSON" if self.text(name).strip() else "is empty"
                raise UnreadableError(f"{name} {found}") from None
        return self._documents[name]

    def table(self, name: str, after: str | None = None) -> Sequence[Sequence[str]]:
        """Return the non-empty rows of a CSV file, or those below the last occurrence of a text."""
        if (name, after) not in self._tables:
            content = text_after(self, name, after)
            if after is not None:
                content = content.partition("\n")[2]
            lines = csv.reader(io.StringIO(content, newline=""))
            try:
                rows = [[cell.strip() for cell in row] for row in lines]
            except csv.Error:
                raise UnreadableError(f"{name} is not CSV") from None
            self._tables[name, after] = [row for row in rows if any(row)]
        return self._tables[name, after]


# Columns of a table whose columns are separated by blanks, as gnuplot and many programs write.

# Lines that begin so are comments; the first one may have the headings.
_COMMENT = ("#", "%", "!", "*")


def blank_column(content: str, column: str | int, file: str) -> list[str | None]:
    """Return a column of a table, which is given by its heading or its position.

    Only a table with headings has them in its first line, which may be a comment. UnreadableError
    for no such heading; an entry is None where a row is too short.
    """
    lines = [line.strip() for line in content.splitlines() if line.strip()]
    position = column
    if isinstance(position, str):
        headings = lines[0].lstrip("".join(_COMMENT)).split() if lines else []
        if position not in headings:
            raise _no_column(file, position, headings)
        position, lines = headings.index(position), lines[1:]
    rows = [line.split() for line in lines if not line.startswith(_COMMENT)]
    return [row[position] if -len(row) <= position < len(row) else None for row in rows]


# Headings that are named where one is missing, and characters of each.
_MOST_HEADINGS, _LONGEST_HEADING = 12, 40


def _no_column(file: str, column: str, headings: Sequence[str]) -> UnreadableError:
    """Make the error for a heading that is not there; it names those that are."""
    seen = [heading[:_LONGEST_HEADING] for heading in headings[:_MOST_HEADINGS] if heading]
    more = ", …" if len(headings) > _MOST_HEADINGS else ""
    listed = f"; it has {', '.join(seen)}{more}" if seen else ""
    return UnreadableError(f'{file} has no column "{column}"{listed}')


# Base of the readers of outputs, and what they share: settings, texts and printed numbers.


def row_setting(default: int | None) -> Any:
    """Declare the position of a row."""
    expected = "a whole number: rows count from 0, and back from -1"
    return count(minimum=-math.inf, maximum=math.inf, default=default, expected=expected)


def after_setting() -> Any:
    """Declare a text behind which an output stands."""
    return text(expected="a text; what stands after its last occurrence is read", default=None)


@dataclass(frozen=True)
class OutputReader(ABC):
    """Reader of an output in a file of the run's folder, ``stdout`` and ``stderr`` among them."""

    file: str

    def __post_init__(self) -> None:
        validate(self)

    @property
    @abstractmethod
    def place(self) -> str:
        """Place of the output, for a reason."""

    @abstractmethod
    def value(self, written: RunFiles) -> float:
        """Return the output in the program's unit; UnreadableError gives the reason for none."""

    @abstractmethod
    def values(self, written: RunFiles) -> FloatArray:
        """Return all numbers there, in their order; UnreadableError names one that is none."""


def text_after(written: RunFiles, file: str, after: str | None) -> str:
    """Return the text of a file, or what stands in it after the last occurrence of another."""
    content = written.text(file)
    if after is None:
        return content
    _, found, rest = content.rpartition(after)
    if not found:
        raise UnreadableError(f"{file} does not contain {toml_text(after)}")
    return rest


def parse_number(text: str, place: str, row: int | None = None) -> float:
    """Parse a printed number, which may have a Fortran exponent.

    UnreadableError if it is none, with its place and, in a list, its row.
    """
    written = text.strip().lower()
    for number in (written, written.replace("d", "e")):
        with contextlib.suppress(ValueError):
            return float(number)
    raise UnreadableError(f"{place} is no number", row)


# Readers of outputs in JSON, NetCDF and any text.


@dataclass(frozen=True)
class JsonReader(OutputReader):
    """Reader of a number in a JSON document."""

    # Names and positions that lead to it, with dots between: ``result.depth``, ``depths.0``.
    key: str = text(expected="the names that lead to it, with dots between")

    @property
    def place(self) -> str:
        return f'"{self.key}" in {self.file}'

    def value(self, written: RunFiles) -> float:
        found = self._find(written)
        if isinstance(found, bool) or not isinstance(found, int | float):
            raise UnreadableError(f"{self.place} is no number")
        try:
            return float(found)
        except OverflowError:  # of an integer that is too large for a float
            return math.inf if found > 0 else -math.inf

    def values(self, written: RunFiles) -> FloatArray:
        try:
            return floats(self._find(written))
        except ValueError as error:
            raise UnreadableError(f"{self.place} holds {error}") from None

    def _find(self, written: RunFiles) -> Any:
        found = written.document(self.file)
        for part in [self.key] if _has_part(found, self.key) else self.key.split("."):
            if not _has_part(found, part):
                raise UnreadableError(f'{self.file} has no "{self.key}"')
            found = found[part if isinstance(found, dict) else int(part)]
        return found


@dataclass(frozen=True)
class NetcdfReader(OutputReader):
    """Reader of a number in a NetCDF file."""

    # Its name, groups before it with slashes between.
    variable: str = text(expected="the name of a variable")
    # Position of the value in a one-dimensional variable, from 0; the last is -1.
    row: int | None = row_setting(None)

    @property
    def place(self) -> str:
        return f'"{self.variable}" in {self.file}'

    def value(self, written: RunFiles) -> float:
        values, place = self.values(written), self.place
        if self.row is None and values.size == 1:
            return float(values.reshape(()))
        if self.row is None or values.ndim != 1:
            wanted = "a single number" if self.row is None else "numbers along one dimension"
            raise UnreadableError(f"{place} is of shape {values.shape}, not {wanted}")
        if not -values.size <= self.row < values.size:
            raise UnreadableError(f"there is no row {self.row} of {place}")
        return float(values[self.row])

    def values(self, written: RunFiles) -> FloatArray:
        try:
            return floats(read_variable(written.content(self.file), self.variable))
        except KeyError:
            raise UnreadableError(f'{self.file} has no "{self.variable}"') from None
        except RefusedContentError as error:
            raise UnreadableError(f"{self.file} cannot be read as NetCDF: {error}") from None
        except ValueError as error:
            raise UnreadableError(f"{self.place} holds {error}") from None


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
    after: str | None = after_setting()

    @property
    def place(self) -> str:
        return f"what {toml_text(self.pattern)} matches in {self.file}"

    def value(self, written: RunFiles) -> float:
        numbers, place, pattern = self._matches(written), self.place, toml_text(self.pattern)
        if self.match in ("min", "max"):
            found = [parse_number(number, place) for number in numbers]
            return min(found) if self.match == "min" else max(found)
        if len(numbers) > 1 and self.match is None:
            message = (
                f'matches for {pattern} in {self.file}; the last is taken ("match" can say which)'
            )
            warning = RunWarning(f"several {message}", f"{len(numbers)} {message}")
            warnings.warn(warning, stacklevel=2)
        return parse_number(numbers[0 if self.match == "first" else -1], place)

    def values(self, written: RunFiles) -> FloatArray:
        matches = enumerate(self._matches(written))
        numbers = [parse_number(text, f"match {n} of {self.place}", n) for n, text in matches]
        return np.array(numbers, dtype=np.float64)

    def _matches(self, written: RunFiles) -> list[str]:
        """Return the texts of the group in all matches, one at least."""
        content = text_after(written, self.file, self.after)

        def search() -> list[str]:
            matches = re.finditer(self.pattern, content, re.MULTILINE)
            return [match[self.group] or "" for match in matches]

        try:
            numbers = _within(written.limits.seconds, search)
        except TimeoutError:
            reason = f"reading {self.place} {written.limits.timeout_reason}"
            raise UnreadableError(reason, status=Status.TIMED_OUT) from None
        if not numbers:
            raise UnreadableError(f"no match for {toml_text(self.pattern)} in {self.file}")
        return numbers


def _within(seconds: float | None, search: Callable[[], list[str]]) -> list[str]:
    """Search within a limit of processor time, in seconds; TimeoutError if it takes longer.

    Some patterns have a cost that is exponential in the length of the text. A search lets no other
    thread run. But it looks for signals, which reach the main thread. In other threads there is no
    limit.
    """
    if seconds is None or threading.current_thread() is not threading.main_thread():
        return search()
    before = signal.signal(signal.SIGVTALRM, _end_search)
    try:
        signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
        return search()
    finally:
        try:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        finally:  # should it end just now
            signal.signal(signal.SIGVTALRM, before or signal.SIG_DFL)


def _end_search(number: int, frame: FrameType | None) -> None:
    raise TimeoutError


def _has_part(found: Any, part: str) -> bool:
    if isinstance(found, dict):
        return part in found
    is_position = isinstance(found, list) and part.isascii() and part.isdecimal() and len(part) < 10
    return is_position and int(part) < len(found)


# Readers of outputs in columns: of CSV, and of tables with blanks between their columns.


class _RowsReader(OutputReader):
    """Reader of numbers in the rows of a column; an output without dimensions is in one of them."""

    row: int

    @abstractmethod
    def entries(self, written: RunFiles) -> list[str | None]:
        """Return the entries of the column; None where a row is too short."""

    def value(self, written: RunFiles) -> float:
        return self._number(self.entries(written), self.row)

    def values(self, written: RunFiles) -> FloatArray:
        column = self.entries(written)
        return np.array([self._number(column, row) for row in range(len(column))], dtype=np.float64)

    def _number(self, column: Sequence[str | None], row: int) -> float:
        place = f"row {row} of {self.place}"
        entry = column[row] if -len(column) <= row < len(column) else None
        if entry is None:
            raise UnreadableError(f"there is no {place}", row)
        return parse_number(entry, place, row)


@dataclass(frozen=True)
class CsvReader(_RowsReader):
    """Reader of a number in a CSV file under a row of headings.

    Parameters
    ----------
    column : str
        The heading. The row of headings is the first one that is no comment (``#``), or else the
        comment above it.
    row : int
        Position among the rows below the headings, from 0; the last is -1.
    after : str, optional
        A text; the table begins in the line below its last occurrence.
    """

    column: str = text(expected="a heading")
    row: int = row_setting(-1)
    after: str | None = after_setting()

    @property
    def place(self) -> str:
        return f'column "{self.column.strip()}" in {self.file}'

    def entries(self, written: RunFiles) -> list[str | None]:
        rows = written.table(self.file, self.after)
        comments = list(itertools.takewhile(_is_comment, rows))
        entries = [row for row in rows[len(comments) :] if not _is_comment(row)]
        if not rows:
            raise UnreadableError(f"{self.file} is empty")
        column = self.column.strip()
        header = entries[0] if entries else []
        if column in header:
            entries = entries[1:]
        elif comments:
            # The headings may be a comment themselves.
            first, *others = comments[-1]
            named = [first.lstrip("#").strip(), *others]
            header = next((each for each in (comments[-1], named) if column in each), header)
        if column not in header:
            raise _no_column(self.file, column, header)
        position = header.index(column)
        return [row[position] if position < len(row) else None for row in entries]


def _is_comment(row: Sequence[str]) -> bool:
    return row[0].startswith("#")


@dataclass(frozen=True)
class ColumnReader(_RowsReader):
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

    column: str | int = setting(
        "count or text",
        "a heading, or a whole number: columns count from 0, and back from -1",
        lambda value: type(value) is int or (isinstance(value, str) and bool(value.strip())),
    )
    row: int = row_setting(-1)
    after: str | None = after_setting()

    @property
    def place(self) -> str:
        return f"column {toml_text(self.column)} in {self.file}"

    def entries(self, written: RunFiles) -> list[str | None]:
        content = text_after(written, self.file, self.after)
        if self.after is not None:
            content = content.partition("\n")[2]
        return blank_column(content, self.column, self.file)
