"""Progress reports: their interface, for several receivers, and as a record of a study's state."""

from __future__ import annotations

import functools
import time
import warnings
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr


class Progress:
    """Receiver of progress reports of a study; this base class ignores them."""

    def start_step(self, name: str, number: int = 0, total: int = 0) -> None:
        """Report the start of a step other than runs, such as the fit of a surrogate.

        Parameters
        ----------
        name : str
            The step in words: "fitting polynomial_chaos".
        number, total : int
            Its number among the steps of the analysis, from 1, and their total; 0 for other steps.
        """

    def start_preparation(self, model: str) -> None:
        """Report that the model is being prepared; the first time, it may be compiled."""

    def announce_designs(self, runs: Mapping[str, int]) -> None:
        """Report the approximate number of runs of each design, before the first one starts."""

    def start_design(self, name: str, runs: int) -> None:
        """Report the start of a design, with its approximate number of runs."""

    def start_runs(self, model: str, finished_runs: Callable[[], list[xr.Dataset]]) -> None:
        """Report that the runs of a model at the points of a round start.

        Parameters
        ----------
        model : str
            The name of the model in a study with several; empty for the only one.
        finished_runs : callable
            Returns the finished runs of each block under way when it is called, with their numbers
            along ``run``. It is called in the thread of the reports.
        """

    def end_block(self, model: str, runs: xr.Dataset) -> None:
        """Report that all runs of the next block of a model's round are finished."""

    def count_restored(self, runs: int) -> None:
        """Report a number of runs that were made before, and are not made again."""

    def report_trial(self, text: str) -> None:
        """Report at once that the trial run of a model has failed, and how."""

    def count_reused(self, runs: int, place: str) -> None:
        """Report a number of runs of the design that are taken from an archive, or another place.

        They are not made again. There may be several reports of one design.
        """

    def inform(self, text: str) -> None:
        """Report what else a user should know now, such as which runs cannot be taken."""

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        """Report finished runs, the missing ones among them, and the runs in progress."""

    def start_analysis(self) -> None:
        """Report that all runs are done, and that their analysis begins."""

    def warn(self, text: str) -> None:
        """Report a warning, which changes no result."""
        warnings.warn(text, RuntimeWarning, stacklevel=2)


class ProgressBroadcast(Progress):
    """Receiver that passes each report on to several others, in their order."""

    def __init__(self, *receivers: Progress) -> None:
        self._receivers = receivers


def _passed_on(report: str) -> Callable[..., None]:
    @functools.wraps(getattr(Progress, report))
    def pass_on(self: ProgressBroadcast, *arguments: Any, **options: Any) -> None:
        for each in self._receivers:
            getattr(each, report)(*arguments, **options)

    return pass_on


for _report in [name for name in vars(Progress) if not name.startswith("_")]:
    setattr(ProgressBroadcast, _report, _passed_on(_report))


# Record of how far a study is, from its progress reports.

# The rate of runs is that of the last samples, at least so many seconds apart.
_SAMPLES, _BETWEEN_SAMPLES = 60, 0.5


@dataclass(frozen=True)
class StudyProgress:
    """Progress of a study at the moment of its last report."""

    step: str = ""  # the step under way, in words; empty while runs are made
    step_number: int = 0  # among the steps of the analysis; 0 for other steps
    steps: int = 0  # their total
    design: str = ""  # the design whose runs are made
    design_number: int = 0  # among the designs; 0 where that is not known
    designs: int = 0  # their total
    runs: int = 0  # approximate number of runs of all designs
    done: int = 0  # the finished runs of all designs
    restored: int = 0  # those of them that were made before
    failed: int = 0  # those of them that are missing
    in_progress: int = 0  # the runs under way
    runs_per_second: float | None = None  # rate of the last runs; None if it is not known yet
    # Time of the start of the step or the design, by the clock of the record, in seconds.
    began: float = 0.0

    @property
    def seconds_left(self) -> float | None:
        """Expected duration of the remaining runs, in seconds; None if it is not known."""
        return (self.runs - self.done) / self.runs_per_second if self.runs_per_second else None


class ProgressRecord(Progress):
    """Receiver that keeps the state of a study as one value, which any thread may read.

    Parameters
    ----------
    clock : callable
        Returns the time in seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._expected: dict[str, int] = {}
        self._samples: deque[tuple[float, int]] = deque(maxlen=_SAMPLES)
        self.state = StudyProgress(began=clock())

    def start_step(self, name: str, number: int = 0, total: int = 0) -> None:
        """Record the step under way."""
        self.state = replace(
            self.state,
            step=name,
            step_number=number,
            steps=total,
            in_progress=0,
            began=self._clock(),
        )

    def start_preparation(self, model: str) -> None:
        """Record the preparation as a step."""
        self.start_step(f"preparing {model}")

    def start_analysis(self) -> None:
        """Record the analysis as a step."""
        self.start_step("analysing the runs")

    def announce_designs(self, runs: Mapping[str, int]) -> None:
        """Record the numbers of runs of all designs."""
        self._expected = dict(runs)
        self.state = replace(self.state, runs=sum(runs.values()))

    def start_design(self, name: str, runs: int) -> None:
        """Record the design, and correct the total by the runs of the designs before it."""
        names = list(self._expected)
        is_announced = name in self._expected
        number = names.index(name) + 1 if is_announced else 0
        later = sum(self._expected[each] for each in names[number:]) if is_announced else 0
        now = self._clock()
        self.state = replace(
            self.state,
            step="",
            design=name,
            design_number=number,
            designs=len(names) if is_announced else 0,
            runs=self.state.done + runs + later,
            in_progress=0,
            began=now,
        )
        if not self._samples:
            self._samples.append((now, 0))

    def count_restored(self, runs: int) -> None:
        """Count runs that were made before; they say nothing of the rate."""
        self.state = replace(self.state, restored=self.state.restored + runs)
        self._count(runs, 0, self.state.in_progress)

    def count_reused(self, runs: int, place: str) -> None:
        """Count runs that are taken from elsewhere; they do not enter the rate of runs."""
        self.count_restored(runs)

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        """Count finished runs."""
        self._count(runs, failed, in_progress)
        now, made = self._clock(), self.state.done - self.state.restored
        if self._samples:
            start, before = self._samples[0]
            if now > start:
                self.state = replace(self.state, runs_per_second=(made - before) / (now - start))
        if not self._samples or now - self._samples[-1][0] >= _BETWEEN_SAMPLES:
            self._samples.append((now, made))

    def _count(self, runs: int, failed: int, in_progress: int) -> None:
        done = self.state.done + runs
        self.state = replace(
            self.state,
            done=done,
            runs=max(self.state.runs, done),
            failed=self.state.failed + failed,
            in_progress=in_progress,
        )
