"""Tables on standard output."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence

import xarray as xr
from rich.box import SIMPLE_HEAD, Box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from uqpen.archive.read import group_names, model_trees
from uqpen.cli.exit_code import ExitCode
from uqpen.cli.printable import screen_text
from uqpen.core.labels import RUNS
from uqpen.core.status import STATUS_TEXT
from uqpen.results.failed_runs import failed_runs
from uqpen.results.field_tables import field_tables
from uqpen.results.field_texts import derived_lines
from uqpen.results.output_tables import output_tables
from uqpen.results.table import OutputTable

__all__ = [
    "plain_table",
    "show_line",
    "show_plain_tables",
    "show_table",
    "show_tables",
    "standard_output",
]

_GAP = 3

# As SIMPLE_HEAD. In its place rich would take a box with other gaps, so rules would not fit.
_ASCII_HEAD = Box("    \n    \n -- \n" + 5 * "    \n", ascii=True)

# Reasons of lost runs that are shown; an archive holds them all.
_MOST_REASONS = 10


class _StandardOutput(Console):
    """Standard output; a reader who has seen enough is no error."""

    def on_broken_pipe(self) -> None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(ExitCode.DONE)


def standard_output() -> Console:
    """Standard output."""
    return _StandardOutput(highlight=False)


def show_line(text: str) -> None:
    """Show a line that is not wrapped."""
    standard_output().print(text, soft_wrap=True, markup=False)


def show_tables(tree: xr.DataTree, *, everything: bool = False) -> None:
    """Show a title, a table for each output, and the failed runs by reason."""
    console = standard_output()
    console.print(Text(screen_text(str(tree.attrs["title"])), style="bold"))
    for table in output_tables(tree, everything=everything):
        show_table(console, table)
    _show_fields(console, tree)
    _show_failures(console, tree)
    console.print()


def show_table(console: Console, table: OutputTable) -> None:
    """Show a table under its title, in as many parts as the screen needs, with its notes."""
    console.print()
    console.print(Text(screen_text(table.title), style="bold"))
    for part, width in _table_parts(table, console.width):
        console.print(part, width=max(width, console.width), crop=False)
    for number, note in enumerate(table.notes, start=1):
        hanging = Table.grid(padding=(0, 1, 0, 0))
        hanging.add_row(Text(f" {number}", style="dim"), Text(screen_text(note), style="dim"))
        console.print(hanging)


def _show_fields(console: Console, tree: xr.DataTree) -> None:
    """Show a row for each output with dimensions, and a line for each number that follows."""
    for table in field_tables(tree):
        show_table(console, table)
    lines = [
        f"{name}: {line}" if name else line
        for name, model in model_trees(tree).items()
        for line in derived_lines(model)
    ]
    if lines:
        console.print()
    for line in lines:
        console.print(Text(screen_text(line)))


def _show_failures(console: Console, tree: xr.DataTree) -> None:
    found = [
        (f"{name}: " * bool(name), failed)
        for name, model in model_trees(tree).items()
        for design in group_names(model, RUNS)
        for failed in failed_runs(model, design)
    ]
    if not found:
        return
    rows = [
        (head + failed.design, f"{failed.runs} {STATUS_TEXT[failed.status]}", failed.text)
        for head, failed in found[:_MOST_REASONS]
    ]
    console.print()
    console.print(plain_table(["design", "failed runs", "reason"], rows))
    if len(found) > len(rows):
        left = len(found) - len(rows)
        console.print(Text(f"and {left} more reason{'s' * (left > 1)}", style="dim"))


def plain_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Make a table of texts; the first column names the rows."""
    rules = SIMPLE_HEAD if _has_lines() else _ASCII_HEAD
    table = Table(box=rules, padding=(0, 1), show_edge=False, pad_edge=False)
    for position, name in enumerate(header):
        table.add_column(Text(screen_text(name)), no_wrap=position == 0)
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


def _table_parts(table: OutputTable, width: int) -> Iterator[tuple[Table, int]]:
    """Yield the columns of a table, as many at a time as fit, with their width."""
    longest = max(len(screen_text(label)) for label, _ in table.rows)
    widths = [
        max(
            *(len(screen_text(line)) for line in name.split("\n")),
            *(len(screen_text(cells[column])) for _, cells in table.rows),
        )
        + _GAP
        for column, name in enumerate(table.columns)
    ]
    start = 0
    while start < len(widths):
        end = start + 1
        while end < len(widths) and longest + sum(widths[start : end + 1]) <= width:
            end += 1
        rows = [(label, *cells[start:end]) for label, cells in table.rows]
        yield plain_table(["", *table.columns[start:end]], rows), longest + sum(widths[start:end])
        start = end
