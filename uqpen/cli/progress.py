"""How far a study is, on standard error."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar
from rich.text import Text

from uqpen.cli.printable import printable
from uqpen.evaluation import Progress
from uqpen.summary.digits import grouped

__all__ = ["progress"]

# Warnings that are shown; the log beside an archive holds more.
_MOST_WARNINGS = 5

# Of a design's name on a line of 80 characters, which is to tell more.
_LONGEST_NAME = 24


@contextmanager
def progress() -> Iterator[Progress]:
    """A bar on a terminal, a line for each design elsewhere."""
    console = Console(stderr=True, highlight=False)
    if not console.is_terminal:
        lines = _Lines(console)
        yield lines
        lines.finish()
        lines.tell_warnings()
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=console, transient=True) as bar:
        in_bars = _Bar(bar)
        yield in_bars
    in_bars.tell_warnings()


class _Told(Progress):
    """Says what was found and what went wrong."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._design = ""
        self._runs = 0
        self._warnings: set[str] = set()

    def design(self, name: str, runs: int) -> None:
        self._design, self._runs = name, runs

    def found(self, runs: int) -> None:
        whole = f"{grouped(runs)} of {grouped(self._runs)}"
        self._say(f"{self._design}: {whole} runs already done")

    def warned(self, text: str) -> None:
        self._warnings.add(text)

    def tell_warnings(self) -> None:
        """Tell what was worth a warning; where there are many, the log has them."""
        for text in sorted(self._warnings)[:_MOST_WARNINGS]:
            self._say(f"warning: {text}")
        if len(self._warnings) > _MOST_WARNINGS:
            self._say(f"and {len(self._warnings) - _MOST_WARNINGS} more warnings")

    def _say(self, text: str) -> None:
        self._console.print(Text(printable(text)), soft_wrap=True)


class _Bar(_Told):
    """A bar for each design."""

    def __init__(self, bar: Bar) -> None:
        super().__init__(bar.console)
        self._bar = bar
        self._task = bar.add_task("", total=None)
        self._lost = 0

    def preparing(self, model: str) -> None:
        self._bar.update(self._task, description=f"preparing {model}")

    def design(self, name: str, runs: int) -> None:
        super().design(name, runs)
        self._bar.remove_task(self._task)
        self._task = self._bar.add_task(_short(name), total=runs)
        self._lost = 0

    def found(self, runs: int) -> None:
        super().found(runs)
        self._bar.advance(self._task, runs)

    def advance(self, runs: int, lost: int, under_way: int) -> None:
        self._lost += lost
        told = [_short(self._design)]
        if self._lost:
            told.append(f"{grouped(self._lost)} lost")
        if under_way:
            told.append(f"{grouped(under_way)} under way")
        self._bar.update(self._task, advance=runs, description=", ".join(told))

    def analysing(self) -> None:
        self._bar.remove_task(self._task)
        self._task = self._bar.add_task("analysing", total=None)


def _short(name: str) -> str:
    """A name, cut where it would take the line for itself.

    >>> _short("a_latin_hypercube_of_the_rod")
    'a_latin_hypercube_of_th…'
    """
    return name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 1]}…"


class _Lines(_Told):
    """A line when a design ends."""

    def __init__(self, console: Console) -> None:
        super().__init__(console)
        self._name = ""
        self._done = 0
        self._began = 0.0

    def design(self, name: str, runs: int) -> None:
        self.finish()
        super().design(name, runs)
        self._name, self._done, self._began = name, 0, time.monotonic()

    def advance(self, runs: int, lost: int, under_way: int) -> None:
        self._done += runs

    def analysing(self) -> None:
        self.finish()

    def finish(self) -> None:
        """Say how long the last design took."""
        if self._name:
            took = time.monotonic() - self._began
            self._say(f"{self._name}: {self._done} runs in {took:.2f} s")
            self._name = ""
