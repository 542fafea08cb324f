"""Log of the making of an archive, in a text file beside it, and the cost of runs by it."""

from __future__ import annotations

import contextlib
import math
import os
import platform
import re
import time
from collections import Counter
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from types import TracebackType

import xarray as xr

from uqpen.archive.provenance import provenance
from uqpen.core.errors import ArchiveError
from uqpen.core.progress import ProgressBroadcast
from uqpen.execution import Progress

# Most different warnings that are logged; a model may issue another one at each run.
_MOST_WARNINGS = 100

# Runs of an archive that took less, all designs together, are made again sooner than found again.
_COSTLY_SECONDS = 60.0

_UNKNOWN = math.inf

# Lines that are read again, as `Journal` and, of the archive, `make_archive` write them.
_TIMED = re.compile(r"(\S+): (\d+) runs in (\d+\.\d+) s, \d+ of them failed$")
_FIRST = re.compile(r": the first runs(?: of (\S+))? took (\d+\.\d+) s$")
_RESTORED = re.compile(r": \d+ runs were made before$")
_TAKEN = re.compile(r": \d+ runs were taken from (.*)$")
_WRITTEN = re.compile(r": is written$")
_ENDED_EARLY = re.compile(r"^\S+ ended early: ")


class Journal(ProgressBroadcast):
    """Progress as lines with the time of day, which must not be in the archive itself.

    Parameters
    ----------
    path : Path
        The text file; lines of earlier starts are kept.
    title : str
        Name and hash of the study.
    progress : Progress
        Receives the same reports.
    """

    def __init__(self, path: Path, title: str, progress: Progress) -> None:
        super().__init__(progress)
        self._path = path
        self._title = title
        self._warnings: Counter[str] = Counter()
        self._name = ""
        self._runs = self._failed = 0
        self._reused: Counter[str] = Counter()
        self._began = 0.0
        self._model = ""
        self._runs_began: float | None = None
        self._first_seconds: dict[str, float] = {}

    def __enter__(self) -> Journal:
        version = provenance()["version_uqpen"]
        self.write_line(
            f"{self._title} by uqpen {version} "
            f"on {platform.node()} ({platform.platform()}), process {os.getpid()}"
        )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # The error that ended it is raised, even if the disk has no room for its line.
        with contextlib.suppress(*([] if kind is None else [ArchiveError])):
            self._finish()
            for warning, count in self._warnings.items():
                self.write_line(f"warning: {warning}" + f" ({count} times)" * (count > 1))
            if kind is not None:
                text = " ".join(str(error).split())
                self.write_line(f"ended early: {kind.__name__}" + f": {text}" * bool(text))

    def write_line(self, text: str) -> None:
        """Write a line.

        Raises
        ------
        ArchiveError
            If that cannot be done.
        """
        moment = datetime.now().astimezone().isoformat(timespec="milliseconds")
        try:
            with self._path.open("a", encoding="utf-8", errors="backslashreplace") as stream:
                stream.write(f"{moment} {text}\n")
        except OSError as error:
            raise ArchiveError(f"{self._path}: cannot be written: {error.strerror}") from None

    def start_step(self, name: str, number: int = 0, total: int = 0) -> None:
        self._finish()
        super().start_step(name, number, total)

    def start_design(self, name: str, runs: int) -> None:
        self._finish()
        self._name, self._runs, self._failed, self._began = name, 0, 0, time.monotonic()
        super().start_design(name, runs)

    def start_runs(self, model: str, finished_runs: Callable[[], list[xr.Dataset]]) -> None:
        self._model, self._runs_began = model, time.monotonic()
        super().start_runs(model, finished_runs)

    def count_restored(self, runs: int) -> None:
        self.write_line(f"{self._name}: {runs} runs were made before")
        super().count_restored(runs)

    def report_trial(self, text: str) -> None:
        self.write_line(" ".join(f"{self._name}: {text}".split()))
        super().report_trial(text)

    def count_reused(self, runs: int, place: str) -> None:
        self._reused[place] += runs
        super().count_reused(runs, place)

    def inform(self, text: str) -> None:
        self.write_line(" ".join(text.split()))
        super().inform(text)

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        self._runs += runs
        self._failed += failed
        if self._runs_began is not None:
            took = time.monotonic() - self._runs_began
            self._runs_began = None
            # Those of the first design may have waited for workers.
            if took < self._first_seconds.get(self._model, math.inf):
                self._first_seconds[self._model] = took
                whose = f" of {self._model}" if self._model else ""
                self.write_line(f"{self._name}: the first runs{whose} took {took:.3f} s")
        super().advance(runs, failed, in_progress)

    def start_analysis(self) -> None:
        self._finish()
        super().start_analysis()

    def warn(self, text: str) -> None:
        if len(self._warnings) < _MOST_WARNINGS or text in self._warnings:
            self._warnings[text] += 1
        super().warn(text)

    def _finish(self) -> None:
        """Write the summary line of the last design."""
        for place, runs in self._reused.items():
            self.write_line(f"{self._name}: {runs} runs were taken from {place}")
        self._reused.clear()
        if self._name:
            took = time.monotonic() - self._began
            self.write_line(
                f"{self._name}: {self._runs} runs in {took:.3f} s, {self._failed} of them failed"
            )
            self._name = ""


def are_costly(log: Path, archive: str) -> bool:
    """Check whether the runs of an archive have taken a minute; True where its log does not say.

    Parameters
    ----------
    log : Path
        The log beside it, also of earlier archives in its place. These count as far as it has runs
        of them.
    archive : str
        Its name. What the runs of other archives have cost is not known.
    """
    lines = _lines(log)
    before, seconds = _UNKNOWN, 0.0
    has_runs_of_before = False
    for line in lines:
        if timed := _TIMED.search(line):
            seconds += float(timed[3])
        elif _RESTORED.search(line):
            seconds = _UNKNOWN  # a start that was killed has no times
        elif taken := _TAKEN.search(line):
            if Path(taken[1]).name == archive:
                has_runs_of_before = True
            else:
                seconds = _UNKNOWN
        elif _WRITTEN.search(line):
            before = seconds + (before if has_runs_of_before else 0.0)
            seconds, has_runs_of_before = 0.0, False
        elif _ENDED_EARLY.search(line):  # its runs, if any are kept, are none of this archive
            seconds, has_runs_of_before = 0.0, False
    # A start that could not write its last line may have made the archive.
    return before + seconds >= _COSTLY_SECONDS


def run_seconds(log: Path, model: str) -> float | None:
    """Return how long the first runs of a model took when some were last made; None if unknown.

    They are the fewest runs that are made by themselves: one, or a batch of a vectorised function.

    Parameters
    ----------
    log : Path
        The log beside an archive.
    model : str
        The name of the model in a study with several; empty for the only one.
    """
    found = (_FIRST.search(line) for line in _lines(log))
    seconds = [float(first[2]) for first in found if first and (first[1] or "") == model]
    return seconds[-1] if seconds else None


def seconds_at_last_pace(log: Path, runs: int, design: str = "") -> float | None:
    """Return how long a number of runs takes, as the last ones of a design, or of any, have taken.

    That is less than their times added where there are several workers. None if it is unknown.
    """
    found = filter(None, (_TIMED.search(line) for line in _lines(log)))
    timed = [each for each in found if design in ("", each[1]) and int(each[2])]
    return runs * float(timed[-1][3]) / int(timed[-1][2]) if timed else None


def _lines(log: Path) -> list[str]:
    """Return the lines of a log; none where it cannot be read."""
    try:
        return log.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
