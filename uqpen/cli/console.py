"""Lines, tables and findings about archives on standard output."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from rich.box import SIMPLE_HEAD, Box
from rich.cells import cell_len, set_cell_size
from rich.console import Console, ConsoleOptions
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from uqpen.cli.messages import screen_text

if TYPE_CHECKING:
    from uqpen.results.table import OutputTable
    from uqpen.verification.check_result import CheckResult
    from uqpen.verification.diff import DiffSection

_GAP = 3

# As SIMPLE_HEAD. In its place rich would take a box with other gaps, so rules would not fit.
_ASCII_HEAD = Box("    \n    \n -- \n" + 5 * "    \n", ascii=True)


def standard_output() -> Console:
    """Standard output."""
    return Console(highlight=False)


def show_line(text: str) -> None:
    """Show a line that is not wrapped."""
    standard_output().print(text, soft_wrap=True, markup=False)


def show_table(console: Console, table: OutputTable) -> None:
    """Show a table under its title, in as many parts as the screen needs, with its notes."""
    title = Text(screen_text(table.title)).wrap(console, console.width)
    console.print(_Lines([("", "none"), *((str(line), "bold") for line in title)]))
    for part in _table_parts(table, console.width):
        if part.width <= console.width:
            console.print(_Lines(list(part.lines())))
        else:
            console.print(plain_table(part.names, part.rows))
    if table.notes:
        console.print(_Lines(list(_note_lines(console, table.notes))))


class _Lines(NamedTuple):
    """Lines of a style each, which fit the screen.

    A rich table finds the width of each cell again and again, which took a tenth of a study of 300
    outputs. The widths of these are known.
    """

    lines: Sequence[tuple[str, str]]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Segment]:
        for text, style in self.lines:
            yield Segment(text, console.get_style(style))
            yield Segment.line()


def _note_lines(console: Console, notes: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield numbered notes, their further lines indented below the text."""
    for number, note in enumerate(notes, start=1):
        head, text = f" {number} ", Text(screen_text(note))
        width = min(console.width - len(head), max(map(cell_len, str(text).split("\n"))))
        for line in text.wrap(console, width, justify="left", overflow="ellipsis"):
            yield f"{head}{line}", "dim"
            head = " " * len(head)


def plain_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Make a table of texts; the first column names the rows."""
    rules = SIMPLE_HEAD if _has_lines() else _ASCII_HEAD
    table = Table(box=rules, padding=(0, 1), show_edge=False, pad_edge=False)
    for name in header:
        table.add_column(Text(screen_text(name)))
    for row in rows:
        table.add_row(*(Text(screen_text(cell)) for cell in row))
    return table


def _has_lines() -> bool:
    """Check that rich draws lines here; it takes only encodings of Unicode to have them."""
    return (sys.stdout.encoding or "utf-8").lower().startswith("utf")


def show_plain_tables(
    console: Console, *tables: tuple[Sequence[str], Sequence[Sequence[str]]]
) -> None:
    """Show tables, each a header and its rows; those without rows are left out."""
    for header, rows in tables:
        if rows:
            console.print()
            console.print(plain_table(header, rows))


class _TablePart(NamedTuple):
    """Columns of a table, each with its name and its width; the first names the rows."""

    names: Sequence[str]
    widths: Sequence[int]
    rows: Sequence[Sequence[str]]

    @property
    def width(self) -> int:
        """Width of its lines."""
        return sum(self.widths) + _GAP * (len(self.widths) - 1)

    def lines(self) -> Iterator[tuple[str, str]]:
        """Yield the lines as `plain_table` has them, each with its style."""
        names = [name.split("\n") for name in self.names]
        height = max(map(len, names))
        for line in zip(*([""] * (height - len(name)) + name for name in names), strict=True):
            yield self._line(line), "table.header"
        yield ("─" if _has_lines() else "-") * self.width, "none"
        for row in self.rows:
            yield self._line(row), "none"

    def _line(self, cells: Sequence[str]) -> str:
        return (" " * _GAP).join(map(set_cell_size, cells, self.widths))


def _table_parts(table: OutputTable, width: int) -> Iterator[_TablePart]:
    """Yield the columns of a table, as many at a time as fit."""
    labels = [screen_text(label) for label, _ in table.rows]
    names = [screen_text(name) for name in table.columns]
    cells = [[screen_text(cell) for cell in row] for _, row in table.rows]
    longest = max(map(cell_len, labels))
    widths = [
        max(map(cell_len, (*name.split("\n"), *(row[column] for row in cells))))
        for column, name in enumerate(names)
    ]
    start = 0
    while start < len(widths):
        end, taken = start + 1, longest + widths[start] + _GAP
        while end < len(widths) and taken + widths[end] + _GAP <= width:
            taken += widths[end] + _GAP
            end += 1
        rows = [[label, *row[start:end]] for label, row in zip(labels, cells, strict=True)]
        yield _TablePart(["", *names[start:end]], [longest, *widths[start:end]], rows)
        start = end


# Findings about archives, on a screen of any width.

_COLUMN = 13
_INDENT = "  "

_STYLES = {
    "DIFFERENT": "bold red",
    "UNLIKELY": "bold red",
    "IMPOSSIBLE": "bold red",
    "CLOSE": "yellow",
}


def show_check(result: CheckResult) -> None:
    """Show a check with its result, and the differences below."""
    console = standard_output()
    head = f"{result.name:<{_COLUMN}}{result.text}"
    _show(console, head, " " * _COLUMN, _STYLES.get(result.verdict.name, ""))
    _show_lines(console, result.details)


def show_section(section: DiffSection) -> None:
    """Show the differences of one kind, under its name."""
    console = standard_output()
    console.print(Text(section.name, style="bold"))
    if not section.verbatim:
        _show_lines(console, section.lines)
        return
    for line in section.lines:
        text = Text(f"{_INDENT}{screen_text(line)}")
        text.truncate(console.width - 1, overflow="ellipsis")
        console.print(text, soft_wrap=True)


def _show_lines(console: Console, lines: Sequence[str]) -> None:
    for line in lines:
        # A message of several lines has an indentation of its own, which is kept.
        text = line.lstrip(" ")
        margin = _INDENT + line[: len(line) - len(text)]
        _show(console, f"{margin}{text}", f"{margin}{_INDENT}", "")


def _show(console: Console, text: str, indent: str, style: str) -> None:
    wrapped = textwrap.wrap(screen_text(text), console.width - 1, subsequent_indent=indent)
    for line in wrapped or [""]:
        console.print(Text(line, style=style), soft_wrap=True)
