"""What a person sees: tables on standard output, progress on standard error."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import xarray as xr
from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar
from rich.table import Table
from rich.text import Text

from uqpen.summary.tables import OutputTable, output_tables
from uqpen.workflow import Progress

__all__ = ["output", "plain_table", "progress", "show_tables"]

_GAP = 2


def output() -> Console:
    """Standard output."""
    return Console(highlight=False)


def show_tables(tree: xr.DataTree) -> None:
    """A title, then a table for each output, in as many parts as the screen's width takes."""
    console = output()
    console.print(Text(str(tree.attrs["title"]), style="bold"))
    for table in output_tables(tree):
        console.print()
        for part in _parts(table, console.width):
            console.print(part)
        for number, note in enumerate(table.notes, start=1):
            hanging = Table.grid(padding=(0, 1, 0, 0))
            hanging.add_row(Text(f" {number}", style="dim"), Text(note, style="dim"))
            console.print(hanging)
    console.print()


def plain_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """A table of texts, the first column being what the others are of."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), show_edge=False, pad_edge=False)
    for position, name in enumerate(header):
        table.add_column(Text(name), no_wrap=position == 0)
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    return table


def _parts(table: OutputTable, width: int) -> Iterator[Table]:
    """The table's columns, as many at a time as fit."""
    label = max(len(table.title), *(len(label) for label, _ in table.rows)) + _GAP
    widths = [
        max(len(name), *(len(cells[column]) for _, cells in table.rows)) + _GAP
        for column, name in enumerate(table.columns)
    ]
    start = 0
    while start < len(widths):
        end = start + 1
        while end < len(widths) and label + sum(widths[start : end + 1]) <= width:
            end += 1
        rows = [(label, *cells[start:end]) for label, cells in table.rows]
        yield plain_table([table.title, *table.columns[start:end]], rows)
        start = end


@contextmanager
def progress() -> Iterator[Progress]:
    """A bar on a terminal, a line for each design elsewhere."""
    console = Console(stderr=True, highlight=False)
    if not console.is_terminal:
        reporter = _Lines(console)
        yield reporter
        reporter.finish()
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=console, transient=True) as bar:
        yield _Bar(bar)


class _Bar(Progress):
    """A bar for each design."""

    def __init__(self, bar: Bar) -> None:
        self._bar = bar
        self._task = bar.add_task("", total=None)

    def preparing(self, model: str) -> None:
        self._bar.update(self._task, description=f"preparing {model}")

    def design(self, name: str, runs: int) -> None:
        self._bar.remove_task(self._task)
        self._task = self._bar.add_task(name, total=runs)

    def advance(self, runs: int) -> None:
        self._bar.advance(self._task, runs)


class _Lines(Progress):
    """A line when a design ends."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._name = ""
        self._done = 0
        self._began = 0.0

    def design(self, name: str, runs: int) -> None:
        self.finish()
        self._name, self._done, self._began = name, 0, time.monotonic()

    def advance(self, runs: int) -> None:
        self._done += runs

    def finish(self) -> None:
        """Say how long the last design took."""
        if self._name:
            took = time.monotonic() - self._began
            line = Text(f"{self._name}: {self._done} runs in {took:.2f} s")
            self._console.print(line, soft_wrap=True)
            self._name = ""
