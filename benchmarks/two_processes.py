"""How much faster two processes make the runs of a model that only computes.

By turns: the runs of one study in this process alone, and on two others, their start included. The
model counts in Python for some milliseconds a run. It returns its processor time, its process, and
when it began and ended. Beside the ratio of times stands how many processors other programs kept
busy meanwhile (on Linux). Where they do, the ratio says as much about them. So does the ratio of
bare processes, which only call the model: no more can be had of this machine. Two figures are less
sensitive: the time before the first run, which is longest the first time, and the share of the time
from then on in which the two processes make no run.

    python benchmarks/two_processes.py
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:  # each of the processes imports this script, too
    import xarray as xr

    from uqpen.core.model import Model

SOURCE = """\
import os, time

def simulate(x, y):
    began, spent = time.monotonic(), time.process_time()
    total = x
    for each in range(60_000):
        total = total * 0.999 + y
    spent = time.process_time() - spent
    return {"z": total, "processor": spent, "began": began, "ended": time.monotonic(),
            "process": os.getpid()}
"""
STUDY = """\
seed = 1
[model]
python = "model.py:simulate"
inputs = { x = "1", y = "1" }
outputs = { z = "1", processor = "s", began = "s", ended = "s", process = "1" }
[inputs]
x = "0 ± 1"
y = "0 ± 1"
[designs.some]
kind = "monte-carlo"
runs = 10
"""
BARE = "import model, sys\nfor run in range(int(sys.argv[1])): model.simulate(0.5, 0.5)"


class Spent(NamedTuple):
    """Seconds by the clock in all and before the first run, idle share, and use by others."""

    clock: float
    start: float
    idle: float
    others: float


def main() -> None:
    """Measure and print."""
    import uqpen
    from uqpen.core.processors import processors

    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=8000)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    print(f"{processors()} processors")
    ratios, limits = [], []
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "model.py").write_text(SOURCE)
        model = uqpen.parse_study(STUDY, folder=Path(folder)).model
        for _ in range(options.repeats):
            one, two = (_spent(model, options.runs, workers) for workers in (1, 2))
            ratios.append(one.clock / two.clock)
            bare_one, bare_two = (_bare_seconds(folder, options.runs, each) for each in (1, 2))
            limits.append(bare_one / bare_two)
            print(
                f"one: {one.clock:.2f} s, two: {two.clock:.2f} s, ratio {ratios[-1]:.2f}, "
                f"bare {limits[-1]:.2f}; "
                f"two begin after {two.start:.2f} s, then are idle for {two.idle:.2%}; "
                f"others used {one.others:.2f} and {two.others:.2f} processors",
                flush=True,
            )
    median, limit = statistics.median(ratios), statistics.median(limits)
    print(f"ratio: median {median:.2f}, best {max(ratios):.2f}; bare processes {limit:.2f}")


def _spent(model: Model, runs: int, workers: int) -> Spent:
    import numpy as np
    import xarray as xr

    from uqpen.execution import EvaluationOptions, Evaluator, evaluate
    from uqpen.execution.processes import processes

    rng = np.random.default_rng(1)
    draws = {name: ("run", rng.random(runs)) for name in "xy"}
    points = xr.Dataset(draws, {"run": np.arange(runs)})
    began, own, busy = time.monotonic(), time.process_time(), _busy_time()
    with processes(workers) if workers > 1 else nullcontext(map) as spread:
        found = evaluate(Evaluator(model), points, {}, EvaluationOptions(map=spread))
    clock = time.monotonic() - began
    own = time.process_time() - own + float(found["processor"].sum())
    others = max(0.0, _busy_time() - busy - own) / clock
    return Spent(clock, float(found["began"].min()) - began, _idle_share(found), others)


def _bare_seconds(folder: str, runs: int, processes: int) -> float:
    """Return the time that processes take to call the model, each for its share of the runs."""
    began = time.monotonic()
    command = [sys.executable, "-c", BARE, str(runs // processes)]
    running = [subprocess.Popen(command, cwd=folder) for _ in range(processes)]
    for process in running:
        process.wait()
    return time.monotonic() - began


def _idle_share(runs: xr.Dataset) -> float:
    """Return the share of the time from their first run to their last that processes make none."""
    made = total = 0.0
    for process in set(runs["process"].values):
        of_process = runs["process"].values == process
        began, ended = runs["began"].values[of_process], runs["ended"].values[of_process]
        made += float((ended - began).sum())
        total += float(ended.max() - began.min())
    return 1 - made / total


def _busy_time() -> float:
    """Processor time of all programs, in seconds; not a number where it is unknown."""
    try:
        fields = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
    except OSError:
        return float("nan")
    user, nice, system, _, _, *interrupts = (int(field) for field in fields[:7])
    return (user + nice + system + sum(interrupts)) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
