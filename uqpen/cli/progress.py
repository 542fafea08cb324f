"""Progress of a study, on standard error."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    ProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as Bar
from rich.text import Text

from uqpen.cli.printable import printable
from uqpen.execution import Progress
from uqpen.results.digits import grouped_number

__all__ = ["bar_or_lines", "show_progress"]

T = TypeVar("T")

# Warnings that are shown; the log beside an archive holds more.
_MOST_WARNINGS = 5

# Of a design's name on a line of 80 characters, which is to tell more.
_LONGEST_NAME = 24


@contextmanager
def bar_or_lines(
    bar: Callable[[Bar], T], lines: Callable[[Console], T], *columns: ProgressColumn
) -> Iterator[T]:
    """Report progress in a bar with these columns on a terminal, in lines elsewhere."""
    console = Console(stderr=True, highlight=False)
    if not console.is_terminal:
        yield lines(console)
        return
    with Bar(
        TextColumn("{task.description}"), BarColumn(), *columns, console=console, transient=True
    ) as shown:
        yield bar(shown)


@contextmanager
def show_progress() -> Iterator[Progress]:
    """Show a bar on a terminal, a line for each design elsewhere."""
    columns = MofNCompleteColumn(), TimeRemainingColumn()
    with bar_or_lines(_Bar, _Lines, *columns) as progress:
        yield progress
    progress.finish()
    progress.show_warnings()


class _Announced(Progress):
    """Shows the runs that were made before, and the warnings."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._design = ""
        self._runs = 0
        self._warnings: set[str] = set()

    def start_design(self, name: str, runs: int) -> None:
        self._design, self._runs = name, runs

    def count_restored(self, runs: int) -> None:
        whole = f"{grouped_number(runs)} of {grouped_number(self._runs)}"
        self._print(f"{self._design}: {whole} runs already done")

    def warn(self, text: str) -> None:
        self._warnings.add(text)

    def finish(self) -> None:
        """Show the end of the last design."""

    def show_warnings(self) -> None:
        """Show the warnings; where there are many, the log has the rest."""
        for text in sorted(self._warnings)[:_MOST_WARNINGS]:
            self._print(f"warning: {text}")
        if len(self._warnings) > _MOST_WARNINGS:
            self._print(f"and {len(self._warnings) - _MOST_WARNINGS} more warnings")

    def _print(self, text: str) -> None:
        self._console.print(Text(printable(text)), soft_wrap=True)


class _Bar(_Announced):
    """A bar for each design."""

    def __init__(self, bar: Bar) -> None:
        super().__init__(bar.console)
        self._bar = bar
        self._task = bar.add_task("", total=None)
        self._failed = 0

    def start_preparation(self, model: str) -> None:
        self._bar.update(self._task, description=f"preparing {model}")

    def start_design(self, name: str, runs: int) -> None:
        super().start_design(name, runs)
        self._failed = 0
        self._begin(_shorten(name), runs)

    def count_restored(self, runs: int) -> None:
        super().count_restored(runs)
        self._bar.advance(self._task, runs)

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        self._failed += failed
        counts = {"failed": self._failed, "under way": in_progress}
        texts = [f"{grouped_number(count)} {what}" for what, count in counts.items() if count]
        description = ", ".join([_shorten(self._design), *texts])
        self._bar.update(self._task, advance=runs, description=description)

    def start_analysis(self) -> None:
        self._begin("analysing", None)

    def _begin(self, description: str, total: int | None) -> None:
        self._bar.remove_task(self._task)
        self._task = self._bar.add_task(description, total=total)


def _shorten(name: str) -> str:
    """Cut a name that would take the line for itself.

    >>> _shorten("a_latin_hypercube_of_the_rod")
    'a_latin_hypercube_of_th…'
    """
    return name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 1]}…"


class _Lines(_Announced):
    """A line when a design ends."""

    _done = 0
    _began = 0.0

    def start_design(self, name: str, runs: int) -> None:
        self.finish()
        super().start_design(name, runs)
        self._done, self._began = 0, time.monotonic()

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        self._done += runs

    def start_analysis(self) -> None:
        self.finish()

    def finish(self) -> None:
        if self._design:
            took = time.monotonic() - self._began
            self._print(f"{self._design}: {self._done} runs in {took:.2f} s")
            self._design = ""
