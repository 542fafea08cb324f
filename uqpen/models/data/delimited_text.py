"""Data files of text: CSV with commas, semicolons or tabs, and the tabular files of Dakota."""

from __future__ import annotations

import csv
import functools
import io
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqpen.models.data.columns import BLANK, DataColumn, Entries, data_error, name_and_unit

__all__ = ["read_text"]

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

    Raises
    ------
    SettingsError
        If it is not UTF-8, a heading or the length of a row is wrong, a run stands twice, or runs
        are of several interfaces of Dakota.
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
        DataColumn(*kept[position], _entries(frame[position]), table.place) for position in kept
    )


@dataclass(frozen=True)
class _Table:
    """Rows of a text below its headings.

    Parameters
    ----------
    file : str
        Its name.
    text : str
        Its content.
    """

    file: str
    text: str

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
        for line, row in self._rows():
            if len(row) != expected:
                values = "1 value" if len(row) == 1 else f"{len(row)} values"
                found = f"{values} in {self.file}, line {line}"
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

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Yield the rows below the headings, each with the number of its line."""
        return itertools.islice(self._all_rows(), 2 if self._places else 1, None)

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
