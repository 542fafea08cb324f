"""How often intervals cover on designs that were extended in steps, over many seeds.

Run it as ``python benchmarks/extended_coverage.py``, with uqpen installed. Each design is made at a
quarter of its size, at half of it, and whole; runs at the same inputs, to the bit, are taken from
the steps before. Runs and intervals must equal those of a fresh design of the whole size. Then the
intervals are held against the truth, as `interval_coverage.py` does.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from interval_coverage import PROBLEMS, Problem, cells_of, made_runs, summary, summary_line

from uqpen.core.labels import FAILED_RUN, RUN
from uqpen.designs.design import Design
from uqpen.designs.drawn_points import Points, points_in_memory
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence
from uqpen.designs.saltelli import Saltelli
from uqpen.execution import evaluate

SIZES = (512, 1024, 2048)
STATISTICS = ("moments", "quantiles", "exceedance")

# By the number of runs, or of blocks, of a step.
DESIGNS: dict[str, Callable[[int], Design]] = {
    "monte-carlo": MonteCarlo,
    "latin-hypercube": lambda runs: LatinHypercube(runs, replicates=runs // 32),
    "sobol-sequence": SobolSequence,
    "halton": Halton,
    "saltelli, base": lambda runs: Saltelli(runs // 4),
    "saltelli, replicates": lambda runs: Saltelli(runs // 4, replicates=runs // 64),
}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--problems", nargs="+", choices=PROBLEMS, default=["half lost"])
    parser.add_argument("--designs", nargs="+", choices=DESIGNS, default=list(DESIGNS))
    options = parser.parse_args()
    differing = 0
    for name in options.problems:
        problem = PROBLEMS[name]()
        for title in options.designs:
            differing += _report(name, problem, title, options.seeds)
    return 1 if differing else 0


def _report(name: str, problem: Problem, title: str, seeds: int) -> int:
    """Print the coverage of a design; return how many seeds differ from a fresh one."""
    began = time.perf_counter()
    steps = [DESIGNS[title](size) for size in SIZES]
    statistics = (*STATISTICS, "sensitivity") if title.startswith("saltelli") else STATISTICS
    found, differing, calls = [], 0, [0] * len(steps)
    for seed in range(seeds):
        known: dict[bytes, dict[str, Any]] = {}
        for position, design in enumerate(steps):
            before = len(known)
            runs = made_runs(problem, design, seed, partial(_make_unknown, problem, known))
            calls[position] += len(known) - before
        fresh = made_runs(problem, steps[-1], seed)
        found.append(cells_of(problem, runs, statistics))
        # Reasons of failed runs are texts for people.
        is_same = runs.equals(fresh.drop_dims(FAILED_RUN, errors="ignore"))
        # As texts, since NaN is not equal to itself.
        is_same &= repr(found[-1]) == repr(cells_of(problem, fresh, statistics))
        differing += not is_same
    made = " + ".join(f"{number / seeds:.0f}" for number in calls)
    print(
        f"\n{name}, {title}: {made} runs a seed, {seeds} seeds, {differing} differ from fresh",
        end="",
    )
    print(f" ({time.perf_counter() - began:.0f} s)")
    for statistic in found[0]:
        row = summary([seed[statistic] for seed in found])
        print(f"  {summary_line(statistic, row)}", flush=True)
    return differing


def _make_unknown(
    problem: Problem, known: dict[bytes, dict[str, Any]], points: Points
) -> xr.Dataset:
    """Make the runs whose inputs are not known, and take the others."""
    points = points_in_memory(points)
    inputs = [points[entry.variable.name].values for entry in problem.law.random]
    keys = [row.tobytes() for row in np.column_stack(inputs)]
    new = list({key: place for place, key in enumerate(keys) if key not in known}.values())
    made = evaluate(problem.evaluator, points.isel({RUN: new or [0]}), {})
    results = [name for name in made.data_vars if name not in points and made[name].dims == (RUN,)]
    for row, place in enumerate(new):
        known[keys[place]] = {name: made[name].values[row] for name in results}
    columns = {name: [known[key][name] for key in keys] for name in results}
    return points.assign_attrs(made.attrs).assign(
        {
            name: (RUN, np.array(values, made[name].dtype), made[name].attrs)
            for name, values in columns.items()
        }
    )


if __name__ == "__main__":
    raise SystemExit(main())
