"""Processor time that it takes to make runs again before all of them are taken.

A study of a million runs of a function of four inputs is made, made again where nothing has
changed, taken into another archive, and continued after an interruption. What is added is the time
of all that belongs to the comparison; the runs themselves are told apart, and so is the index of
all runs by their inputs, which is needed to take them in any case.

    python benchmarks/recheck_costs.py --runs 1_000_000
"""

from __future__ import annotations

import argparse
import contextlib
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import uqpen
from uqpen.checkpoints import make_archive, recheck
from uqpen.checkpoints.sources import IndexedRuns
from uqpen.core.progress import Progress

STUDY = """\
seed = 11
[model]
python = "model.py:simulate"
vectorized = {vectorized}
inputs = {{ a = "1", b = "1", c = "1", d = "1" }}
outputs = {{ z = "1" }}
[inputs]
a = "0 ± 1"
b = "0 ± 1"
c = "0 ± 1"
d = "0 ± 1"
[designs.one]
kind = "monte-carlo"
runs = {runs}
"""
MODEL = "def simulate(a, b, c, d):\n    return {'z': a * b + c - d}\n"

spent: Counter[str] = Counter()


class Stopped(Progress):
    """Receiver that interrupts a study when nearly all runs are made."""

    def __init__(self, runs: int) -> None:
        self._left = 0.99 * runs

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        """Interrupt the study if few runs are left."""
        self._left -= runs
        if self._left <= 0:
            raise KeyboardInterrupt


class Quiet(Progress):
    """Receiver that shows nothing, not even warnings."""

    def warn(self, text: str) -> None:
        """Show nothing."""


def main() -> None:
    """Print a table of processor times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1_000_000)
    runs = parser.parse_args().runs
    _time(make_archive, "is_as_made", "comparison")
    _time(make_archive, "runs_that_are_as_made", "comparison")
    _time(recheck, "evaluate", "runs")
    _time(IndexedRuns, "find", "index")
    print(f"{'function':12}{'start':24}{'added':>8}{'runs':>8}{'in all':>8}  seconds")
    for vectorized in ("true", "false"):
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            (folder / "model.py").write_text(MODEL)
            (folder / "study.toml").write_text(STUDY.format(vectorized=vectorized, runs=runs))
            kind = "vectorised" if vectorized == "true" else "run by run"
            _make(folder, "study.nc")
            starts: dict[str, Callable[[], None]] = {
                "nothing has changed": lambda at=folder: _make(at, "study.nc"),
                "--reuse": lambda at=folder: _make(at, "b.nc", reuse=[at / "study.nc"]),
                "after an interruption": lambda at=folder: _make(at, "c.nc"),
            }
            with contextlib.suppress(KeyboardInterrupt):
                _make(folder, "c.nc", progress=Stopped(runs))
            for name, start in starts.items():
                spent.clear()
                began = time.process_time()
                start()
                total = time.process_time() - began
                # Only what the comparison itself has looked up is a part of it.
                index = spent["index in comparison"]
                added = spent["comparison"] - spent["runs"] - index
                print(f"{kind:12}{name:24}{added:8.3f}{spent['runs']:8.3f}{total:8.2f}")


def _make(folder: Path, name: str, **options: Any) -> None:
    study = uqpen.load_study(folder / "study.toml")
    uqpen.make_archive(study, folder / name, **{"progress": Quiet(), **options})


def _time(owner: Any, name: str, what: str) -> None:
    """Add up the processor time of a function."""
    function = getattr(owner, name)

    def timed(*arguments: Any, **options: Any) -> Any:
        began = time.process_time()
        inside = "comparison" in open_parts
        open_parts.append(what)
        try:
            return function(*arguments, **options)
        finally:
            open_parts.pop()
            spent[f"{what} in comparison" if what == "index" and inside else what] += (
                time.process_time() - began
            )

    setattr(owner, name, timed)


open_parts: list[str] = []

if __name__ == "__main__":
    main()
