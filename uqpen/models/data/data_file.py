"""Data files: CSV, Excel, tables of Dakota, NetCDF and Parquet, as columns of entries."""

from __future__ import annotations

import csv
import functools
import io
import itertools
import math
import re
import zipfile
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray, floats
from uqpen.core.columns import has_decimal_comma, heading_parts, number_expected
from uqpen.core.errors import Problem, SettingsError, TableError, counted, toml_text
from uqpen.core.files import FileSnapshot, NotAFileError, read_file
from uqpen.core.netcdf.opening import (
    LARGEST_DATA,
    NetcdfVariable,
    RefusedContentError,
    read_variables,
)
from uqpen.core.units import DIMENSIONLESS, NUMBER

# Columns of a data file: names, units and entries, some of them blank.

# The entries of a column: numbers, or texts if one of them is no number.
Entries = FloatArray | Sequence[str]

_NUMBER = re.compile(NUMBER)
BLANK = frozenset({"", "nan", "na", "n/a", "none", "null"})
# The word of Dakota for a failed run, in place of its results.
_FAILED = "fail"
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)

# Distinct values of a column in which one can stand alone.
_FEWEST_VALUES = 10
# Most labels of a column of texts.
_MOST_LABELS = 100

# Characters of an entry that a message quotes.
_MOST_QUOTED = 60


def data_error(found: str, expected: str) -> SettingsError:
    """Return the error of a data file with a mistake."""
    return SettingsError([Problem((), found, expected)])


def name_and_unit(heading: str, file: str) -> tuple[str, str]:
    """Return the name and the unit of a heading, as `heading_parts`; no unit is an empty text.

    SettingsError if the heading has another form.
    """
    try:
        name, unit = heading_parts(heading, file)
    except TableError:
        found = f'the heading "{heading[:_MOST_QUOTED]}" in {file}'
        raise data_error(found, 'headings of the form "name [unit]"') from None
    return name, unit if unit != DIMENSIONLESS or {*"[("} & {*heading} else ""


def is_nines(value: float) -> bool:
    """Check that all digits of a number are 9, as in -9999, which often stands for no value."""
    return {*f"{abs(value):.15g}"} == {"9"}


@dataclass(frozen=True, eq=False)
class DataColumn:
    """Column of a data file."""

    name: str  # its heading without the unit
    unit: str  # its unit, as written in the file; empty where the heading has none
    entries: Entries  # numbers (NaN for a blank entry), or texts if one of them is no number
    # Returns the place of an entry by its number, such as the file and the line.
    place: Callable[[int], str]
    labels: tuple[str, ...] = ()  # of categories, whose entries are positions in them
    heading: str = ""  # its whole heading; empty for that of a variable, which is its name

    def coded(self) -> DataColumn:
        """Return a column of texts with codes: positions in its labels, the sorted distinct texts.

        A column with a number among its texts, also one with a comma, stays as it is, as does one
        without labels that several rows share: it has a mistake, or a remark on each row.
        """
        texts = [] if isinstance(self.entries, np.ndarray) else self.texts()
        labels = sorted({*texts} - {""})
        if not 2 <= len(labels) <= min(len(texts) // 2, _MOST_LABELS) or any(
            _NUMBER.fullmatch(each) or has_decimal_comma(each) or each.lower() == _FAILED
            for each in labels
        ):
            return self
        code = {"": math.nan} | {label: float(place) for place, label in enumerate(labels)}
        return replace(self, entries=np.array([code[each] for each in texts]), labels=tuple(labels))

    def numbers(self) -> FloatArray:
        """Return its entries as numbers in its unit, shape (run,); NaN if blank, or for ``fail``.

        Raises
        ------
        SettingsError
            With the file, the line and the column of an entry that is no number.
        """
        if isinstance(self.entries, np.ndarray):
            return self.entries
        return np.array([self._number(number, text) for number, text in enumerate(self.entries)])

    def texts(self) -> list[str]:
        """Return its entries as texts without blanks around them; empty for a blank entry."""
        if isinstance(self.entries, np.ndarray):
            return ["" if math.isnan(each) else f"{each:.15g}" for each in self.entries.tolist()]
        plain = (text.strip() for text in self.entries)
        return ["" if text.lower() in BLANK else text for text in plain]

    def without(self, missing: Collection[float | str]) -> DataColumn:
        """Return the column with blank entries where a number or a text stands that means none."""
        numbers = [each for each in missing if not isinstance(each, str)]
        if isinstance(self.entries, np.ndarray):
            entries: Entries = np.where(np.isin(self.entries, numbers), np.nan, self.entries)
        else:
            plain = [text.strip() for text in self.entries]
            entries = [
                ""
                if text in missing or (_NUMBER.fullmatch(text) and float(text) in numbers)
                else text
                for text in plain
            ]
        return replace(self, entries=entries)

    def rows(self, kept: Sequence[int]) -> DataColumn:
        """Return the column with some of its entries, which have the places that they had."""
        entries = self.entries
        some = entries[kept] if isinstance(entries, np.ndarray) else [entries[row] for row in kept]
        return replace(self, entries=some, place=lambda entry: self.place(kept[entry]))

    def distant_value(self) -> float | None:
        """Return the value at an end of its range that stands alone; None where none does.

        It stands in at most a twentieth of the rows, and is away from the next one by ten times
        the range of the others. If its digits are all 9, half of the rows and of the range do.
        """
        numbers = self.numbers()
        values, counts = np.unique(numbers[np.isfinite(numbers)], return_counts=True)
        if len(values) < _FEWEST_VALUES:
            return None
        for end, others in ((0, values[1:]), (-1, values[:-1])):
            value, spread = float(values[end]), float(np.ptp(others))
            gap = float(min(abs(others - value)))
            farthest, share = (0.5, 2) if is_nines(value) else (10, 20)
            if gap > spread * farthest and counts[end] * share <= counts.sum():
                return value
        return None

    def distant_text(self) -> str:
        """Return a text on the value that stands alone; empty where none does."""
        value, numbers = self.distant_value(), self.numbers()
        if value is None:
            return ""
        rows = np.flatnonzero(numbers == value)
        others = numbers[np.isfinite(numbers) & (numbers != value)]
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{value:.15g} stands alone in {counted(rows.size, 'row')} "
            f"({self.place(int(rows[0]))}), and the others are "
            f"{others.min():.4g} to {others.max():.4g}{unit}"
        )

    def entry_text(self, entry: int) -> str:
        """Return an entry as `texts` does, without the others."""
        return replace(self, entries=self.entries[entry : entry + 1]).texts()[0]

    def place_text(self, entry: int) -> str:
        """Return the column and the place of an entry, for a message."""
        return f'column "{self.name}", {self.place(entry)}'

    def _number(self, entry: int, text: str) -> float:
        plain = text.strip()
        if plain.lower() in BLANK or plain.lower() == _FAILED:
            return math.nan
        if _NUMBER.fullmatch(plain) or _INFINITE.fullmatch(plain):
            return float(plain)
        shown = plain if len(plain) <= _MOST_QUOTED else f"{plain[:_MOST_QUOTED]}…"
        expected = number_expected(plain)
        raise data_error(f"{toml_text(shown)} in {self.place_text(entry)}", expected)


@dataclass(frozen=True, eq=False)
class DataFile:
    """Snapshot of a data file, and the columns of its content at that time.

    Raises
    ------
    SettingsError
        If two columns have one name, or the file has no row.
    """

    file: FileSnapshot
    columns: tuple[DataColumn, ...]

    def __post_init__(self) -> None:
        for name, count in Counter(column.name for column in self.columns).items():
            if count > 1:
                raise data_error(f'two columns "{name}" in {self.name}', "a column for each name")
        if not self.rows:
            raise data_error(f"no row in {self.name}", "a row for each run")

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.file.path.name

    @property
    def rows(self) -> int:
        """Number of its rows."""
        return len(self.columns[0].entries) if self.columns else 0

    @cached_property
    def by_name(self) -> dict[str, DataColumn]:
        """The columns by their names."""
        return {column.name: column for column in self.columns}


# Data files of text: CSV with commas, semicolons or tabs, and the tabular files of Dakota.

# What marks the line of headings of a tabular file of Dakota. Either of the columns that number its
# runs can be left out; each interface is a model.
_DAKOTA, _INTERFACE = "%", "interface"
_OF_DAKOTA = frozenset({"eval_id", _INTERFACE})
# The same of a table of EasyVVUQ, whose second line has the place of a column in its output.
_OF_EASYVVUQ = frozenset({"run_id", "iteration"})

_BLANKS = [*BLANK, *map(str.upper, BLANK), *map(str.capitalize, BLANK), "NaN"]


def read_text(name: str, content: bytes) -> tuple[DataColumn, ...]:
    """Read the columns of a text under a line of headings ``name [unit]``.

    The format is recognised: commas, semicolons or tabs, whichever is most frequent in the
    headings; a line of headings that begins with ``%`` is that of Dakota, with spaces between
    columns; a second line of numbers below ``run_id`` is that of EasyVVUQ. A first column without
    a heading (an index of pandas) is left out.

    SettingsError if it is not UTF-8, a heading or the length of a row is wrong, a run stands twice,
    or runs are of several interfaces of Dakota.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise data_error(f"bytes that are no UTF-8 in {name}, line {line}", "a text file") from None
    table = _Table(name, text)
    kept = {
        position: name_and_unit(heading, name)
        for position, heading in enumerate(table.headings)
        if position not in table.numbering and (heading or position)
    }
    table.check_lengths()
    frame = table.frame([*table.numbering, *kept])
    table.check_numbering(frame)
    return tuple(
        DataColumn(*parts, _entries(frame[place]), table.place, heading=table.headings[place])
        for place, parts in kept.items()
    )


@dataclass(frozen=True)
class _Table:
    """Rows of a text below its headings."""

    file: str  # its name
    text: str  # its content

    @functools.cached_property
    def is_of_dakota(self) -> bool:
        """True if the headings are marked as Dakota does."""
        return self._first_line.lstrip().startswith(_DAKOTA)

    @functools.cached_property
    def headings(self) -> list[str]:
        """The headings; two of EasyVVUQ with one name have their places behind it."""
        first, second = self._head
        if not self._places:
            return first
        several = {name for name in first if first.count(name) > 1}
        numbered = zip(first, second, strict=True)
        return [f"{name}_{place}" if name in several else name for name, place in numbered]

    @functools.cached_property
    def numbering(self) -> dict[int, str]:
        """The headings, by their positions, of columns that only number runs."""
        names = _OF_DAKOTA if self.is_of_dakota else _OF_EASYVVUQ
        if not self.is_of_dakota and not names <= {*self.headings}:
            return {}
        return {place: name for place, name in enumerate(self.headings) if name in names}

    def check_lengths(self) -> None:
        """Refuse a row with more or fewer values than there are headings."""
        expected = len(self.headings)
        if not self.is_of_dakota and '"' not in self.text:  # some ten times as fast
            counts = {line.count(self._delimiter) for line in self.text.split("\n") if line.strip()}
            if counts == {expected - 1}:
                return
        headings = 2 if self._places else 1
        for line, row in itertools.islice(self._all_rows(), headings, None):
            if len(row) != expected:
                found = f"{counted(len(row), 'value')} in {self.file}, line {line}"
                raise data_error(found, f"{expected}, one under each heading")

    def frame(self, positions: Sequence[int]) -> Any:
        """Return the columns at some positions as a pandas DataFrame, blank entries missing.

        Rows without any entry, with which a spreadsheet may end, are left out.
        """
        import pandas as pd

        options: dict[str, Any] = {"sep": self._delimiter or r"\s+"}
        if int(pd.__version__.partition(".")[0]) < 3:
            options["float_precision"] = "round_trip"  # as every later version does
        header = 2 if self._places else 1
        frame = pd.read_csv(
            io.StringIO(self.text),
            header=None,
            names=list(range(len(self.headings))),
            usecols=list(positions),
            skiprows=self._line_of(header - 1),
            keep_default_na=False,
            na_values=_BLANKS,
            skipinitialspace=True,
            low_memory=False,
            **options,
        )
        return frame[frame.notna().any(axis="columns")]

    def check_numbering(self, frame: Any) -> None:
        """Refuse runs of several interfaces, and two runs of one number."""
        numbers = [place for place, name in self.numbering.items() if name != _INTERFACE]
        for position in self.numbering.keys() - numbers:
            firsts = np.flatnonzero(~frame[position].duplicated())[:2]
            if len(firsts) > 1:
                names = " and ".join(str(frame[position].iloc[row]) for row in firsts)
                found = f"the interfaces {names} in {self._lines(*firsts)}"
                raise data_error(found, "runs of one interface: keep the lines of one")
        if numbers and frame.duplicated(numbers).any():
            run = frame.groupby(numbers, dropna=False, sort=False).ngroup().to_numpy()
            repeated = run[frame.duplicated(numbers)][0]
            first, second = np.flatnonzero(run == repeated)[:2]
            number = ", ".join(f"{self.numbering[p]} {frame[p].iloc[first]}" for p in numbers)
            found = f"{number} twice in {self._lines(first, second)}"
            if frame.iloc[first].equals(frame.iloc[second]):
                expected = "each run once: remove one of the lines"
                raise data_error(f"{found}, with equal values", expected)
            expected = "a number for each run: number them anew if they are of several studies"
            raise data_error(f"{found}, with other values", expected)

    def place(self, entry: int) -> str:
        """Return the file and the line of a row."""
        return f"{self.file}, line {self._line(entry)}"

    def _lines(self, first: int, second: int) -> str:
        """Return the file and the lines of two rows."""
        return f"{self.file}, lines {self._line(first)} and {self._line(second)}"

    def _line(self, entry: int) -> int:
        """Return the number of the line of a row below the headings."""
        return self._line_of(entry + (2 if self._places else 1))

    @functools.cached_property
    def _first_line(self) -> str:
        return self.text.lstrip("\r\n").partition("\n")[0]

    @functools.cached_property
    def _delimiter(self) -> str:
        """The character between columns; empty for spaces."""
        return "" if self.is_of_dakota else max(",;\t", key=self._first_line.count)

    @functools.cached_property
    def _head(self) -> tuple[list[str], list[str]]:
        """The first two rows."""
        rows = [[cell.strip() for cell in row] for _, row in itertools.islice(self._all_rows(), 2)]
        if not rows:
            raise data_error(f"no headings in {self.file}", 'a line of headings "name [unit]"')
        first, second = (*rows, [])[:2]
        if self.is_of_dakota:
            mark, *others = first
            first = [*filter(None, [mark.removeprefix(_DAKOTA)]), *others]
        return first, second

    @functools.cached_property
    def _places(self) -> bool:
        """True if the second row has the places of columns in the outputs of EasyVVUQ."""
        first, second = self._head
        known = dict(zip(first, second, strict=False))
        is_table = {*first} >= _OF_EASYVVUQ and len(first) == len(second)
        return is_table and all(known[name] == "0" for name in _OF_EASYVVUQ)

    def _all_rows(self) -> Iterator[tuple[int, list[str]]]:
        stream = io.StringIO(self.text, newline="")
        if self.is_of_dakota:
            for line, text in enumerate(stream, 1):
                if row := text.split():
                    yield line, row
            return
        reader = csv.reader(stream, delimiter=self._delimiter)
        try:
            for row in reader:
                if any(map(str.strip, row)):
                    yield reader.line_num, row
        except csv.Error as error:
            raise data_error(
                f"{error} in {self.file}, line {reader.line_num}", "a CSV file"
            ) from None

    def _line_of(self, row: int) -> int:
        """Return the number of the line on which a row ends, headings included."""
        return next(itertools.islice(self._all_rows(), row, None))[0]


def _entries(column: Any) -> Entries:
    """Return a column of pandas as numbers if all its entries are, else as texts."""
    if column.dtype.kind in "iuf":
        return np.asarray(column, dtype=np.float64)
    return [str(each) for each in column.astype(object).where(column.notna(), "").tolist()]


# Data files that are no text: NetCDF and Parquet.


def read_netcdf(name: str, content: bytes) -> tuple[DataColumn, ...]:
    """Read the variables of a NetCDF file along its one dimension.

    SettingsError if it is no NetCDF file, or its variables are along other dimensions.
    """
    try:
        columns = [_netcdf_column(name, each) for each in read_variables(content)]
    except RefusedContentError as error:
        found = f"{name}, which cannot be read as NetCDF: {error}"
        raise data_error(found, f"a NetCDF file{error.remedy and ': '}{error.remedy}") from None
    if len({len(column.entries) for column in columns}) > 1:
        raise data_error(f"variables of different length in {name}", "one dimension, of the runs")
    return tuple(columns)


def _netcdf_column(file: str, variable: NetcdfVariable) -> DataColumn:
    values = variable.values()
    if values.ndim != 1:
        found = f'a variable "{variable.name}" of {values.ndim} dimensions in {file}'
        raise data_error(found, "variables along one dimension, of the runs")
    if values.dtype.kind in "biuf":
        place = functools.partial(_row, file)
        return DataColumn(variable.name, variable.unit, floats(values), place)
    return _column(file, variable.name, variable.unit, np.ma.filled(values.astype(object), None))


def read_parquet(name: str, content: bytes) -> tuple[DataColumn, ...]:
    """Read the columns of a Parquet file, headed ``name [unit]``.

    SettingsError if it cannot be read, or pandas lacks the package that reads it.
    """
    import pandas as pd

    try:
        frame = pd.read_parquet(io.BytesIO(content))
    except ImportError:
        found = f"{name}, a Parquet file, and neither pyarrow nor fastparquet installed"
        raise data_error(found, "one of these packages, or a CSV or NetCDF file") from None
    except (OSError, ValueError) as error:
        raise data_error(f"{name}, which cannot be read: {error}", "a Parquet file") from None
    return frame_columns(name, frame)


def read_excel(name: str, content: bytes) -> tuple[DataColumn, ...]:
    """Read the columns of the first sheet of an Excel file, headed ``name [unit]``.

    SettingsError if it cannot be read, or openpyxl is not installed.
    """
    import pandas as pd

    try:
        frame = pd.read_excel(io.BytesIO(content), engine="openpyxl", dtype=object)
    except ImportError:
        found = f"{name}, an Excel file, and openpyxl not installed"
        raise data_error(found, "pip install uqpen[excel], or a CSV file") from None
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise data_error(f"{name}, which cannot be read: {error}", "an Excel file") from None
    kept = np.flatnonzero(frame.notna().any(axis="columns")).tolist()

    def place(entry: int) -> str:
        return f"{name}, row {kept[entry] + 2}"

    return tuple(replace(each, place=place) for each in frame_columns(name, frame.iloc[kept]))


def frame_columns(file: str, frame: Any) -> tuple[DataColumn, ...]:
    """Return the columns of a pandas DataFrame, headed ``name [unit]``.

    SettingsError if a heading has another form.
    """
    columns = []
    for position, heading in enumerate(map(str, frame.columns)):
        name, unit = name_and_unit(heading, file)
        column = _column(file, name, unit, frame.iloc[:, position].to_numpy(object))
        columns.append(replace(column, heading=heading.strip()))
    return tuple(columns)


def _column(file: str, name: str, unit: str, entries: Any) -> DataColumn:
    """Return a column with numbers where all entries are numbers or missing, else with texts."""
    found: Entries
    try:
        found = np.array([np.nan if each is None else each for each in entries], dtype=np.float64)
    except (TypeError, ValueError):
        missing = [each is None or each != each for each in entries]
        found = ["" if no else str(each) for each, no in zip(entries, missing, strict=True)]
    return DataColumn(name, unit, found, functools.partial(_row, file))


def _row(file: str, entry: int) -> str:
    return f"{file}, row {entry + 1}"


# Reading of data files of every format.

# The readers of the endings of names; any other file is text.
_READERS: dict[str, Callable[[str, bytes], tuple[DataColumn, ...]]] = {
    ".nc": read_netcdf,
    ".parquet": read_parquet,
    ".xlsx": read_excel,
}


def read_data_file(path: Path) -> DataFile:
    """Read a data file: by the ending ``.nc``, ``.parquet`` or ``.xlsx``, else a text.

    SettingsError if it is not there, or has a mistake, which it names with its line.
    """
    expected = "a CSV, Excel, NetCDF, Parquet or Dakota file"
    try:
        is_netcdf = path.suffix.lower() == ".nc"
        return data_file(path, read_file(path, LARGEST_DATA if is_netcdf else None))
    except FileNotFoundError:
        raise data_error(f'no file "{path}"', expected) from None
    except NotAFileError:
        raise data_error(f'"{path}", which is not a file', expected) from None
    except OSError as error:
        raise data_error(f'"{path}", which cannot be read: {error.strerror}', expected) from None


def data_file(path: Path, content: bytes) -> DataFile:
    """Return the data file of a content; see `read_data_file`."""
    read = _READERS.get(path.suffix.lower(), read_text)
    return DataFile(FileSnapshot.from_content(path, content), _distinct(read(path.name, content)))


def _distinct(columns: tuple[DataColumn, ...]) -> tuple[DataColumn, ...]:
    """Return columns that differ only by round brackets, as ``T (min)``, under whole headings."""
    counts = Counter(column.name for column in columns)
    return tuple(
        replace(each, name=each.heading, unit="")
        if counts[each.name] > 1 and each.heading.endswith(")")
        else each
        for each in columns
    )
