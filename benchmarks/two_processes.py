"""How much faster two processes make the runs of a model that only computes.

By turns: the runs of one study in this process alone, and on two others, their start included. The
model counts in Python for some milliseconds a run, and returns its processor time. Beside the ratio
of times stands how many processors other programs kept busy meanwhile (on Linux). Where they do,
the ratio says as much about them.

    python benchmarks/two_processes.py
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from contextlib import nullcontext
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

import uqpen
from uqpen.core.model import Model
from uqpen.core.processors import processors
from uqpen.execution import Evaluator, evaluate
from uqpen.execution.processes import processes

SOURCE = """\
import time

def simulate(x, y):
    began = time.process_time()
    total = x
    for each in range(60_000):
        total = total * 0.999 + y
    return {"z": total, "processor": time.process_time() - began}
"""
STUDY = """\
seed = 1
[model]
python = "model.py:simulate"
inputs = { x = "1", y = "1" }
outputs = { z = "1", processor = "s" }
[inputs]
x = "0 ± 1"
y = "0 ± 1"
[designs.some]
kind = "monte-carlo"
runs = 10
"""


class Spent(NamedTuple):
    """Seconds by the clock, and processors that other programs kept busy."""

    clock: float
    others: float


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=8000)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    print(f"{processors()} processors")
    ratios = []
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "model.py").write_text(SOURCE)
        model = uqpen.parse_study(STUDY, folder=Path(folder)).model
        for _ in range(options.repeats):
            one, two = (_spent(model, options.runs, workers) for workers in (1, 2))
            ratios.append(one.clock / two.clock)
            print(
                f"one: {one.clock:.2f} s, two: {two.clock:.2f} s, ratio {ratios[-1]:.2f}; "
                f"others used {one.others:.2f} and {two.others:.2f} processors",
                flush=True,
            )
    print(f"ratio: median {statistics.median(ratios):.2f}, best {max(ratios):.2f}")


def _spent(model: Model, runs: int, workers: int) -> Spent:
    rng = np.random.default_rng(1)
    draws = {name: ("run", rng.random(runs)) for name in "xy"}
    points = xr.Dataset(draws, {"run": np.arange(runs)})
    began, own, busy = time.perf_counter(), time.process_time(), _busy_time()
    with processes(workers) if workers > 1 else nullcontext(map) as spread:
        found = evaluate(Evaluator(model), points, {}, map=spread)
    clock = time.perf_counter() - began
    own = time.process_time() - own + float(found["processor"].sum())
    return Spent(clock, max(0.0, _busy_time() - busy - own) / clock)


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
