"""A benchmark of methods on a screen, and its progress."""

from __future__ import annotations

import textwrap
import time
from collections.abc import Iterator
from contextlib import contextmanager

import xarray as xr
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar
from rich.text import Text

from uqpen.benchmark.compare import BenchmarkProgress
from uqpen.cli.console import show_table, standard_output
from uqpen.cli.messages import screen_text
from uqpen.cli.options import is_quiet
from uqpen.results.digits import grouped_number
from uqpen.results.method_comparison import (
    LEGEND,
    MethodComparison,
    entry_table,
    methods_table,
    reference_remarks,
    replicated_verdicts,
    single_set_verdicts,
    standings_table,
)
from uqpen.results.texts import duration_text

# Where there is no bar, a line tells how far it is when the last is so old, in seconds.
_BETWEEN_LINES = 10.0


def show_benchmark(tree: xr.DataTree) -> None:
    """Show the title, the methods, and a table with its verdicts for each statistic."""
    console = standard_output()
    title = f"{tree.attrs['title']}: benchmark of methods"
    console.print(Text(screen_text(title), style="bold"))
    comparison = MethodComparison.of(tree)
    show_table(console, methods_table(comparison))
    for entry in comparison.entries:
        show_table(console, entry_table(entry))
        for sentences in (single_set_verdicts, reference_remarks, replicated_verdicts):
            for sentence in sentences(entry):
                _show_text(console, sentence)
    show_table(console, standings_table(comparison))
    _show_text(console, LEGEND)
    console.print()


def _show_text(console: Console, text: str) -> None:
    """Show a text in lines that keep the groups of a number's digits together."""
    for line in textwrap.wrap(screen_text(text), console.width - 1, break_long_words=False):
        console.print(Text(f" {line}", style="dim"), soft_wrap=True)


@contextmanager
def show_progress() -> Iterator[BenchmarkProgress]:
    """Show a bar with the time remaining on a terminal, lines elsewhere."""
    if is_quiet():
        yield BenchmarkProgress()
        return
    console = Console(stderr=True, highlight=False)
    if not console.is_terminal:
        yield _Lines(console)
        return
    columns = TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn()
    with Bar(*columns, console=console, transient=True) as shown:
        yield _Bar(shown)


class _Announced(BenchmarkProgress):
    """Announces the runs and their duration."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._repeats = 0

    def start_benchmark(self, *, runs: int, reference: int, repeats: int, seconds: float) -> None:
        self._repeats = repeats
        self._print(
            f"{grouped_number(runs)} runs, {grouped_number(reference)} of them for the reference; "
            f"the model alone takes about {duration_text(seconds)}"
        )

    def _print(self, text: str) -> None:
        self._console.print(Text(text), soft_wrap=True)


class _Bar(_Announced):
    """A bar over the repeats; each repeat takes as long as the others."""

    def __init__(self, bar: Bar) -> None:
        super().__init__(bar.console)
        self._bar = bar
        self._task = bar.add_task("", total=None)

    def start_preparation(self, model: str) -> None:
        self._bar.update(self._task, description=f"preparing {model}")

    def start_benchmark(self, *, runs: int, reference: int, repeats: int, seconds: float) -> None:
        super().start_benchmark(runs=runs, reference=reference, repeats=repeats, seconds=seconds)
        self._begin("reference", reference)
        self._each = (runs - reference) // repeats

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        self._bar.advance(self._task, runs)

    def finish_repeat(self, done: int) -> None:
        if not done:
            self._begin("", self._each * self._repeats)
        self._bar.update(self._task, description=f"repeat {done} of {self._repeats}")

    def _begin(self, description: str, total: int) -> None:
        self._bar.remove_task(self._task)
        self._task = self._bar.add_task(description, total=total)


class _Lines(_Announced):
    """A line now and then with the time remaining."""

    def __init__(self, console: Console) -> None:
        super().__init__(console)
        self._began = self._last = time.monotonic()

    def finish_repeat(self, done: int) -> None:
        now = time.monotonic()
        if not done:
            self._began = now
            self._print("the reference is there")
        elif done == 1 or done == self._repeats or now - self._last > _BETWEEN_LINES:
            left = (now - self._began) / done * (self._repeats - done)
            end = f"about {duration_text(left)} to go" if done < self._repeats else "done"
            self._print(f"repeat {done} of {self._repeats}: {end}")
            self._last = now
