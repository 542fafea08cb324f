"""Cost of the runs of an archive, by its log."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

__all__ = ["are_costly"]

# Runs of an archive that took less, all designs together, are made again sooner than found again.
_COSTLY_SECONDS = 60.0

# As `Journal` writes them.
_TIMED = re.compile(r": \d+ runs in (\d+\.\d+) s, \d+ of them failed$")
_RESTORED = re.compile(r": \d+ runs were made before$")
_TAKEN = re.compile(r": \d+ runs were taken from (.*)$")


def are_costly(log: Path, archive: str) -> bool:
    """Check whether the runs of an archive have taken a minute; True where its log does not say.

    Parameters
    ----------
    log : Path
        The log beside it. It has the starts that made this archive, and those of the archives
        that were in its place before.
    archive : str
        Its name. What the runs of other archives have cost is not known.
    """
    try:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return True
    seconds = 0.0
    is_timed = False
    for line in _own_lines(lines, archive):
        if timed := _TIMED.search(line):
            is_timed = True
            seconds += float(timed[1])
        elif _RESTORED.search(line) or _is_from_another(line, archive):
            return True  # a start that was killed has no times either
    return not is_timed or seconds >= _COSTLY_SECONDS


def _own_lines(lines: list[str], archive: str) -> Iterator[str]:
    """Yield the lines on runs of the archive that was written last, and not of those before it.

    If it has taken runs from the one in its place, the lines of that one belong to it as well.
    """
    written = f" {archive}: is written"
    places = [place for place, line in enumerate(lines) if line.endswith(written)]
    ends = places or [len(lines)]
    for start, end in reversed(list(pairwise([0, *ends]))):
        own = lines[start:end]
        yield from own
        if not any(_TAKEN.search(line) for line in own):
            return


def _is_from_another(line: str, archive: str) -> bool:
    taken = _TAKEN.search(line)
    return taken is not None and Path(taken[1]).name != archive
