"""Columns of a data file: names, units and entries, some of them blank."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.columns import heading_parts
from uqpen.core.errors import Problem, SettingsError, TableError, toml_text
from uqpen.core.files import FileSnapshot
from uqpen.core.units import DIMENSIONLESS, NUMBER

__all__ = ["BLANK", "DataColumn", "DataFile", "Entries", "data_error", "name_and_unit"]

# The entries of a column: numbers, or texts if one of them is no number.
Entries = FloatArray | Sequence[str]

_NUMBER = re.compile(NUMBER)
BLANK = frozenset({"", "nan", "na", "n/a", "none", "null"})
# The word of Dakota for a failed run, in place of its results.
_FAILED = "fail"
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)

# Characters of an entry that a message quotes.
_MOST_QUOTED = 60


def data_error(found: str, expected: str) -> SettingsError:
    """Return the error of a data file with a mistake."""
    return SettingsError([Problem((), found, expected)])


def name_and_unit(heading: str, file: str) -> tuple[str, str]:
    """Return the name and the unit of a heading ``name [unit]``; no unit is an empty text.

    Raises
    ------
    SettingsError
        If the heading has another form.
    """
    try:
        name, unit = heading_parts(heading, file)
    except TableError:
        found = f'the heading "{heading[:_MOST_QUOTED]}" in {file}'
        raise data_error(found, 'headings of the form "name [unit]"') from None
    return name, unit if unit != DIMENSIONLESS or "[" in heading else ""


@dataclass(frozen=True, eq=False)
class DataColumn:
    """Column of a data file.

    Parameters
    ----------
    name : str
        Its heading without the unit.
    unit : str
        Its unit, as written in the file; empty where the heading has none.
    entries : ndarray or sequence of str
        Numbers (NaN for a blank entry), or texts if one of them is no number.
    place : callable
        Returns the place of an entry by its number, such as the file and the line.
    """

    name: str
    unit: str
    entries: Entries
    place: Callable[[int], str]

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
        raise data_error(f"{toml_text(shown)} in {self.place_text(entry)}", "a number")


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

    def column(self, name: str) -> DataColumn:
        """Return the column of a name.

        Raises
        ------
        TableError
            If there is none.
        """
        if name not in self._by_name:
            raise TableError(f'{self.name} has no column "{name}"')
        return self._by_name[name]

    @cached_property
    def _by_name(self) -> dict[str, DataColumn]:
        return {column.name: column for column in self.columns}
