"""Cost of the runs of an archive, and of one of them, by its log."""

from __future__ import annotations

import math
import re
from pathlib import Path

__all__ = ["are_costly", "run_seconds", "seconds_at_last_pace"]

# Runs of an archive that took less, all designs together, are made again sooner than found again.
_COSTLY_SECONDS = 60.0

_UNKNOWN = math.inf

# As `Journal` and `make_archive` write them.
_TIMED = re.compile(r"(\S+): (\d+) runs in (\d+\.\d+) s, \d+ of them failed$")
_FIRST = re.compile(r": the first runs(?: of (\S+))? took (\d+\.\d+) s$")
_RESTORED = re.compile(r": \d+ runs were made before$")
_TAKEN = re.compile(r": \d+ runs were taken from (.*)$")
_WRITTEN = re.compile(r": is written$")
_ENDED_EARLY = re.compile(r"^\S+ ended early: ")


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
