"""Columns of numbers in a CSV or NetCDF file, each with its name and unit."""

from __future__ import annotations

import csv
import functools
import io
import math
import re
import zipfile
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray, floats, is_finite_number
from uqpen.core.errors import QuantityError, TableError, counted, toml_text
from uqpen.core.files import FileSnapshot, NotAFileError, read_file
from uqpen.core.lookup import choices
from uqpen.core.netcdf.opening import (
    LARGEST_DATA,
    NetcdfVariable,
    RefusedContentError,
    read_variables,
)
from uqpen.core.units import DIMENSIONLESS, NUMBER, are_convertible, describe, scale

_NUMBER = re.compile(NUMBER)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
# A heading with its unit in round brackets, which may hold a pair of them: ``flux (kg/(m2 s))``.
_ROUND = re.compile(r"(?P<name>.*[^\s(])\s*\((?P<unit>(?:[^()]|\([^()]*\))*)\)", re.DOTALL)

# No heading and no number comes near these numbers of characters.
_LONGEST_HEADING, _LONGEST_NUMBER = 1000, 4000

# Rows that are read, and numbers that are converted, at a time: as objects they take some MB.
_ROWS = 65_536


@dataclass(frozen=True)
class Column:
    """Column of a file, with its content at the time the file was read."""

    name: str  # its heading, without the unit
    unit: str  # its unit, as written in the file
    # Returns its entries as numbers in that unit; TableError, with the line, for any other entry.
    # An unused column is not loaded, so it may contain anything.
    load: Callable[[], FloatArray]
    file: str = ""  # the name of its file, for messages

    @property
    def heading(self) -> str:
        """Name and unit, as a CSV file has them."""
        return self.name if self.unit == DIMENSIONLESS else f"{self.name} [{self.unit}]"

    def values(self, like: str) -> FloatArray:
        """Return the numbers in SI units.

        TableError if the unit is not of the dimension of `like`, or an entry is no finite number.
        """
        numbers = self.load()
        where = f'"{self.file}", column "{self.name}"' if self.file else f'column "{self.name}"'
        try:
            alike = are_convertible(self.unit, like)
        except QuantityError as error:
            raise TableError(f"{where}: {error}") from None
        if not alike:
            unit = "without a unit" if self.unit == DIMENSIONLESS else f'in "{self.unit}"'
            raise TableError(f"{where} is {unit}; expected {describe(like)}")
        measure = scale(self.unit)
        found = np.empty(len(numbers))
        for start in range(0, len(numbers), _ROWS):
            part = slice(start, start + _ROWS)
            found[part] = [measure.to_si(number) for number in numbers[part].tolist()]
        return found


@dataclass(frozen=True)
class ColumnFile:
    """Snapshot of a file, and the columns of its content at that time."""

    file: FileSnapshot
    columns: tuple[Column, ...]

    def column(self, heading: str) -> Column:
        """Return the column with a heading, with or without its unit; empty for the only column.

        TableError if there is none, or more than one.
        """
        name, headings = self.file.path.name, [column.heading for column in self.columns]
        if not heading and len(headings) > 1:
            raise TableError(f'"{name}" has the columns {", ".join(headings)}')
        found = [
            column
            for column in self.columns
            if not heading or heading.strip() in (column.heading, column.name)
        ]
        if not found:
            raise TableError(f'"{name}" has no column "{heading}"; {choices(heading, headings)}')
        if len(found) > 1:
            raise TableError(f'column "{heading}" stands twice in "{name}"')
        return found[0]


def read_columns(
    path: Path,
    labels: Mapping[str, Sequence[str]] | None = None,
    *,
    blanks: bool = False,
    groups: Collection[str] = (),
) -> ColumnFile:
    """Read the columns of a file.

    They are the variables along one dimension of a NetCDF file, which ends in ``.nc``. Anything
    else is read as CSV under a row of headings ``name [unit]``, or as the first sheet of an Excel
    file, which ends in ``.xlsx``. Columns with `labels` may have these texts there; their positions
    are read. With `blanks`, an empty entry there is not a number instead of a mistake. Entries of
    the columns `groups` are any texts, numbered from 0 in the order in which they first appear.

    TableError if it is not there, or cannot be read.
    """
    is_netcdf = path.suffix == ".nc"
    try:
        content = read_file(path, LARGEST_DATA if is_netcdf else None)
        if is_netcdf:
            columns = _netcdf(path, content)
        else:
            rows = _excel if path.suffix.lower() == ".xlsx" else _csv
            columns = _columns(path, rows(path, content), labels or {}, blanks, groups)
        return ColumnFile(FileSnapshot.from_content(path, content), columns)
    except FileNotFoundError:
        raise TableError(f'there is no file "{path}"') from None
    except NotAFileError:
        raise TableError(f'"{path}" is not a file') from None
    except OSError as error:
        raise TableError(f'"{path}" cannot be read: {error.strerror}') from None


def read_draws(path: Path, group: str) -> ColumnFile:
    """Read the draws in a group of a NetCDF file, whose variables lie along one or two dimensions.

    Of two, such as ``chain`` and ``draw``, the first comes first. A variable with other dimensions
    or content is refused when it is loaded.

    TableError if it is not there, or cannot be read.
    """
    try:
        content = read_file(path, LARGEST_DATA)
        variables = read_variables(content, group)
    except FileNotFoundError:
        raise TableError(f'there is no file "{path}"') from None
    except (NotAFileError, OSError) as error:
        raise TableError(f'"{path}" cannot be read: {error}') from None
    except RefusedContentError as error:
        raise TableError(f'"{path.name}" cannot be read as NetCDF: {error}') from None
    columns = (
        Column(
            each.name,
            each.unit or DIMENSIONLESS,
            functools.partial(_values, each, path, most_dimensions=2),
            path.name,
        )
        for each in variables
    )
    return ColumnFile(FileSnapshot.from_content(path, content), tuple(columns))


def columns_of_table(table: Mapping[str, object], *, blanks: bool = False) -> tuple[Column, ...]:
    """Return the columns of a table of lists by heading, each as a CSV file would have it.

    An empty text is a blank, which is NaN where blanks are allowed.

    TableError if a heading is not of the form ``name [unit]``, or the lists differ in length.
    """
    columns = []
    lengths = set()
    for heading, values in table.items():
        name, unit = heading_parts(heading, "the table")
        if not isinstance(values, list):
            raise TableError(f'column "{name}": found {toml_text(values)}, expected a list')
        lengths.add(len(values))
        columns.append(Column(name, unit, functools.partial(_listed, values, name, blanks)))
    if len(lengths) != 1:
        raise TableError("its columns differ in length" if lengths else "it has no columns")
    return tuple(columns)


def _listed(values: list[Any], name: str, blanks: bool) -> FloatArray:
    kept = [value for value in values if not (blanks and value == "")]
    for value in kept:
        if not isinstance(value, int | float) or not is_finite_number(value):
            raise TableError(f'column "{name}": found {toml_text(value)}, expected a number')
    return floats([math.nan if value == "" else value for value in values])


def _csv(path: Path, content: bytes) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows of a CSV file, each with its line."""
    # The reader goes through the bytes: a text of them takes four times as much.
    text = io.TextIOWrapper(io.BytesIO(content), encoding="utf-8-sig", newline="")
    lines = [*islice(io.BytesIO(content), 2)]
    for mark, marks in ((b";", "semicolons"), (b"\t", "tabs")):
        counts = {line.count(mark) for line in lines}
        if len(counts) == 1 and 0 not in counts and b"," not in lines[0]:
            expected = "expected commas between columns, and points before decimals"
            raise TableError(f'"{path.name}" seems to be separated by {marks}; {expected}')
    reader = csv.reader(text)
    try:
        for row in reader:
            yield reader.line_num, row
    except UnicodeDecodeError:
        raise TableError(f'"{path.name}" is not UTF-8') from None
    except csv.Error as error:
        raise TableError(f'"{path.name}", line {reader.line_num}: {error}') from None


def _excel(path: Path, content: bytes) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows of the first sheet of an Excel file, each with its number."""
    try:
        from openpyxl import load_workbook
    except ImportError:
        needed = "openpyxl: pip install uqpen[excel]; a CSV file needs nothing"
        raise TableError(f'"{path.name}": an Excel file needs {needed}') from None
    try:
        sheet = load_workbook(io.BytesIO(content), read_only=True, data_only=True).worksheets[0]
        for number, row in enumerate(sheet.iter_rows(values_only=True), 1):
            yield number, ["" if value is None else str(value) for value in row]
    except (OSError, ValueError, KeyError, IndexError, zipfile.BadZipFile) as error:
        raise TableError(f'"{path.name}" cannot be read as Excel: {error}') from None


def _columns(
    path: Path,
    every: Iterator[tuple[int, list[str]]],
    labels: Mapping[str, Sequence[str]],
    blanks: bool,
    groups: Collection[str],
) -> tuple[Column, ...]:
    """Return the columns of rows; the headings stand in the first."""
    lines = ((line, row) for line, row in every if any(map(str.strip, row)))
    _, header = next(lines, (0, []))
    if not header:
        raise TableError(f'"{path.name}" is empty')
    parts = [heading_parts(heading, f'"{path.name}"') for heading in header]
    entries = [
        _Entries(position, labels.get(name, ()), blanks, is_group=name in groups)
        for position, (name, _) in enumerate(parts)
    ]
    while rows := list(islice(lines, _ROWS)):
        for line, row in rows:
            if len(row) != len(header):
                found = f"{counted(len(row), 'value')} under {counted(len(header), 'heading')}"
                expected = "commas separate columns, and a point stands before decimals"
                raise TableError(f'"{path.name}", line {line}: {found}; {expected}')
        for each in entries:
            each.add(rows)
    return tuple(
        Column(*names, functools.partial(each.numbers, names[0], path), path.name)
        for names, each in zip(parts, entries, strict=True)
    )


class _Entries:
    """Numbers of one column of a CSV file, up to the first entry that is none."""

    def __init__(
        self, position: int, labels: Sequence[str], blanks: bool, *, is_group: bool
    ) -> None:
        self._position, self._labels, self._blanks = position, [*labels], blanks
        self._is_group = is_group
        self._parts: list[FloatArray] = []
        self._wrong: tuple[int, str] | None = None

    def add(self, rows: Sequence[tuple[int, list[str]]]) -> None:
        """Add the entries of further rows, each with the number of its line."""
        if self._wrong is not None:
            return
        values = np.empty(len(rows))
        for place, (line, row) in enumerate(rows):
            text = row[self._position].strip()
            if self._is_group and text not in self._labels:
                self._labels.append(text)
            if text in self._labels:
                values[place] = self._labels.index(text)
                continue
            if self._blanks and not text:
                values[place] = np.nan
                continue
            is_long = len(text) > _LONGEST_NUMBER
            if is_long or not _NUMBER.fullmatch(text) or not math.isfinite(float(text)):
                self._wrong = line, text
                return
            values[place] = float(text)
        self._parts.append(values)

    def numbers(self, name: str, path: Path) -> FloatArray:
        """Return all entries; refuse one that is no number."""
        if self._wrong is not None:
            line, text = self._wrong
            where = f'"{path.name}", line {line}, column "{name}"'
            is_long = len(text) > _LONGEST_NUMBER
            found = f"{len(text)} characters" if is_long else toml_text(text)
            rest = f", expected {number_expected(text)}"
            rest = f"; {choices(text, self._labels)}" if self._labels else rest
            raise TableError(f"{where}: found {found}{rest}")
        return np.concatenate([np.empty(0), *self._parts])


def has_decimal_comma(text: str) -> bool:
    """Check that a text is a number with a comma, which may stand before decimals or thousands."""
    return _DECIMAL_COMMA.fullmatch(text.strip()) is not None


def number_expected(text: str) -> str:
    """Return what is expected in place of a text that is no number."""
    point = text.strip().replace(",", ".")
    return f"a number with a point, as {point}" if has_decimal_comma(text) else "a number"


def heading_parts(text: str, place: str) -> tuple[str, str]:
    """Return the name and the unit of a heading ``name [unit]`` or ``name (unit)``.

    TableError, with `place`, if the brackets of the unit have no end or no name before them.
    """
    if len(text) > _LONGEST_HEADING:
        longest = f"a heading of {len(text)} characters, expected at most {_LONGEST_HEADING}"
        raise TableError(f"{place}: found {longest}")
    if not {*"[]"} & {*text} and (found := _ROUND.fullmatch(text.strip())):
        return found["name"].strip(), found["unit"].strip() or DIMENSIONLESS
    name, bracket, unit = text.strip().removesuffix("]").partition("[")
    is_closed = text.rstrip().endswith("]")
    if not name.strip() or is_closed != bool(bracket) or {*"[]"} & {*name, *unit}:
        raise TableError(f'{place}: heading "{text}" is not of the form "name [unit]"')
    return name.strip(), unit.strip() or DIMENSIONLESS


def _netcdf(path: Path, content: bytes) -> tuple[Column, ...]:
    try:
        return tuple(
            Column(
                each.name,
                each.unit or DIMENSIONLESS,
                functools.partial(_values, each, path),
                path.name,
            )
            for each in read_variables(content)
        )
    except RefusedContentError as error:
        remedy = f"; {error.remedy}" if error.remedy else ""
        raise TableError(f'"{path.name}" cannot be read as NetCDF: {error}{remedy}') from None


def _values(variable: NetcdfVariable, path: Path, most_dimensions: int = 1) -> FloatArray:
    """Return the values of a NetCDF variable in one row; a missing value is an error."""
    where = f'"{path.name}", variable "{variable.name}"'
    try:
        entries = variable.values()
        if not 1 <= np.ndim(entries) <= most_dimensions:
            expected = "one" if most_dimensions == 1 else "one or two"
            raise TableError(f"{where} has {np.ndim(entries)} dimensions, expected {expected}")
        values = floats(entries).ravel()
    except RefusedContentError as error:
        raise TableError(f'"{path.name}" cannot be read as NetCDF: {error}') from None
    except ValueError as error:
        raise TableError(f"{where} holds {error}") from None
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise TableError(f"{where} has no number at position {bad[0]}")
    return values
