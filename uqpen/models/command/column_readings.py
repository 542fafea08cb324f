"""Readers of outputs in columns: of CSV, and of tables with blanks between their columns."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import toml_text
from uqpen.core.settings import setting, text
from uqpen.models.command.output_reader import (
    OutputReader,
    after_setting,
    parse_number,
    row_setting,
    text_after,
)
from uqpen.models.command.tables import blank_column
from uqpen.models.command.written import RunFiles, UnreadableError

__all__ = ["ColumnReader", "CsvReader"]


def _column_number_or_heading() -> Any:
    return setting(
        "count or text",
        "a heading, or a whole number: columns count from 0, and back from -1",
        lambda value: type(value) is int or (isinstance(value, str) and bool(value.strip())),
    )


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
        The heading.
    row : int
        Position among the rows below the headings, from 0; the last is -1.
    """

    column: str = text(expected="a heading")
    row: int = row_setting(-1)

    @property
    def place(self) -> str:
        return f'column "{self.column.strip()}" in {self.file}'

    def entries(self, written: RunFiles) -> list[str | None]:
        rows = written.table(self.file)
        if not rows:
            raise UnreadableError(f"{self.file} is empty")
        header, *entries = rows
        column = self.column.strip()
        if column not in header:
            raise UnreadableError(f'{self.file} has no column "{column}"')
        position = header.index(column)
        return [row[position] if position < len(row) else None for row in entries]


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

    column: str | int = _column_number_or_heading()
    row: int = row_setting(-1)
    after: str | None = after_setting()

    @property
    def place(self) -> str:
        return f"column {toml_text(self.column)} in {self.file}"

    def entries(self, written: RunFiles) -> list[str | None]:
        content = text_after(written, self.file, self.after)
        if self.after is not None:
            content = content.partition("\n")[2]
        found = blank_column(content, self.column)
        if found is None:
            raise UnreadableError(f'{self.file} has no column "{self.column}"')
        return found
