"""Progress of a study, on standard error."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from uqpen.cli.messages import printable, wrapped_message
from uqpen.cli.options import is_quiet
from uqpen.core.errors import counted
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.progress import Progress, ProgressRecord, StudyProgress
from uqpen.results.digits import grouped_number
from uqpen.results.texts import duration_text, runs_text, step_text

# Warnings that are shown; the log beside an archive holds more.
_MOST_WARNINGS = 5

# Where there is no bar, a line tells how far a study is when the last is so old, in seconds.
_BETWEEN_LINES = 10.0


@contextmanager
def show_progress() -> Iterator[Progress]:
    """Show a bar over all designs on a terminal, a few lines elsewhere; if quiet, warnings."""
    console = Console(stderr=True, highlight=False)
    if is_quiet() or not console.is_terminal:
        lines = _Warnings(console) if is_quiet() else _Lines(console)
        yield lines
        lines.show_warnings()
        return
    bar = _Announced(console)
    # It is drawn ten times a second, whether or not there is a report: a clock goes on.
    with Live(
        get_renderable=lambda: progress_lines(bar.state, time.monotonic()),
        console=console,
        transient=True,
        refresh_per_second=10,
        # What a model prints goes above the bar, unless it goes elsewhere than to the terminal.
        redirect_stdout=sys.stdout.isatty(),
    ):
        yield bar
    bar.show_warnings()


@contextmanager
def show_step(name: str) -> Iterator[None]:
    """Show a step on a terminal while it lasts."""
    with show_progress() as progress:
        progress.start_step(name)
        yield


def progress_lines(progress: StudyProgress, now: float) -> Group:
    """Draw how far a study is: a bar, and below it numbers."""
    since = now - progress.began
    if progress.step:
        # A step that is under way is not done yet.
        done, total = max(progress.step_number - 1, 0), progress.steps
        below = f"{duration_text(since)} so far" if since >= 1 else ""
    else:
        done, total = progress.done, progress.runs
        below = runs_text(progress)
    line = Table.grid(padding=(0, 1), expand=True)
    line.add_column(no_wrap=True, overflow="ellipsis")
    line.add_column(ratio=1, min_width=10)
    line.add_column(no_wrap=True)
    line.add_row(
        Text(printable(step_text(progress))),
        ProgressBar(total=total or None, completed=done, pulse=not total, animation_time=now),
        Text(f"{100 * done // total} %" if total else ""),
    )
    return Group(line, Text(below, style="dim", no_wrap=True, overflow="ellipsis"))


class _Warnings(ProgressRecord):
    """Record that shows the warnings."""

    def __init__(self, console: Console, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(clock)
        self._console = console
        self._warnings: set[str] = set()

    def announce_designs(self, runs: Mapping[str, int]) -> None:
        super().announce_designs(runs)
        # Before any run, as the user may want to stop.
        self.show_warnings()
        self._warnings.clear()

    def warn(self, text: str) -> None:
        self._warnings.add(text)

    def show_warnings(self) -> None:
        """Show the warnings; where there are many, the log has the rest."""
        for text in sorted(self._warnings)[:_MOST_WARNINGS]:
            self._print(f"warning: {text}")
        if len(self._warnings) > _MOST_WARNINGS:
            self._print(f"and {len(self._warnings) - _MOST_WARNINGS} more warnings")

    def _print(self, text: str) -> None:
        self._console.print(Text(wrapped_message(text)), soft_wrap=True)


class _Announced(_Warnings):
    """Record that shows the runs that were made before as well, and a trial run that failed."""

    def __init__(self, console: Console, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(console, clock)
        self._design_runs = 0
        self._reused: Counter[str] = Counter()

    def start_step(self, name: str, number: int = 0, total: int = 0) -> None:
        self._show_reused()
        super().start_step(name, number, total)

    def start_design(self, name: str, runs: int) -> None:
        self._show_reused()
        super().start_design(name, runs)
        self._design_runs = runs

    def count_restored(self, runs: int) -> None:
        super().count_restored(runs)
        self._print(f"{self.state.design}: {self._share_of_design(runs)} runs already done")

    def count_reused(self, runs: int, place: str) -> None:
        super().count_reused(runs, place)
        self._reused[place] += runs

    def inform(self, text: str) -> None:
        self._print(text)

    def report_trial(self, text: str) -> None:
        self._print(f"{self.state.design}: {text}")

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        self._show_reused()
        super().advance(runs, failed, in_progress)

    def _show_reused(self) -> None:
        """Show how many runs were taken since the last report, and where from."""
        for place, runs in self._reused.items():
            share = self._share_of_design(runs)
            self._print(f"{self.state.design}: {share} runs from {place}")
        self._reused.clear()

    def _share_of_design(self, runs: int) -> str:
        return f"{grouped_number(runs)} of {grouped_number(self._design_runs)}"


class _Lines(_Announced):
    """A line when a design or the analysis ends, and now and then in between."""

    def __init__(self, console: Console, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(console, clock)
        self._said = clock()
        self._design = ""
        self._made = 0
        self._began = 0.0

    def start_step(self, name: str, number: int = 0, total: int = 0) -> None:
        self._end_design()
        super().start_step(name, number, total)
        self._say_if_late(step_text(self.state))

    def start_analysis(self) -> None:
        super().start_analysis()
        self._print(self.state.step)

    def start_design(self, name: str, runs: int) -> None:
        self._end_design()
        super().start_design(name, runs)
        self._design, self._made, self._began = name, 0, self._clock()
        if runs > RUNS_IN_MEMORY:  # to draw the first of so many points can take a while
            self._print(f"{name}: drawing the points of {grouped_number(runs)} runs")

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        super().advance(runs, failed, in_progress)
        self._made += runs
        self._say_if_late(f"{step_text(self.state)}; {runs_text(self.state)}")

    def _end_design(self) -> None:
        """Show the end of the last design."""
        self._show_reused()
        if self._design:
            took = self._clock() - self._began
            self._print(f"{self._design}: {counted(self._made, 'run')} in {took:.2f} s")
            self._design = ""

    def _say_if_late(self, text: str) -> None:
        if self._clock() - self._said >= _BETWEEN_LINES:
            self._print(text)

    def _print(self, text: str) -> None:
        super()._print(text)
        self._said = self._clock()
