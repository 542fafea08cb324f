"""Designs that are extended in steps have the runs and intervals of fresh ones.

Run it as ``python benchmarks/extended_designs.py``, with uqpen installed. Each design is made at a
quarter of its size, at half of it, and whole; runs at the same inputs, to the bit, are taken from
the steps before. Runs and intervals must equal those of a fresh design of the whole size.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from interval_coverage import PROBLEMS, Problem, cells_of, made_runs
from seed_table import fill

from uqpen.core.labels import FAILED_RUN, RUN
from uqpen.designs.design import Design
from uqpen.designs.drawn_points import Points, points_in_memory
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence
from uqpen.designs.saltelli import Saltelli
from uqpen.execution import evaluate

SIZES = (512, 1024, 2048)
STATISTICS = ("moments", "quantiles", "exceedance", "sensitivity")

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
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--markdown", type=Path, metavar="FILE.md", help="the table of the docs")
    options = parser.parse_args()
    problem = PROBLEMS["half lost"]()
    lines = ["| design | runs made in each step | seeds | seeds that differ |", "|---|---|---|---|"]
    has_differences = False
    for title in DESIGNS:
        made, differing = _extended(problem, title, options.seeds)
        has_differences |= differing > 0
        lines.append(f"| {title} | {made} | {options.seeds} | {differing} |")
        print(lines[-1], flush=True)
    if options.markdown:
        fill(options.markdown, "extended designs", "\n".join(lines))
    return int(has_differences)


def _extended(problem: Problem, title: str, seeds: int) -> tuple[str, int]:
    """Runs that each step makes in the mean, and how many seeds differ from a fresh design."""
    steps = [DESIGNS[title](size) for size in SIZES]
    differing, calls = 0, [0] * len(steps)
    for seed in range(seeds):
        known: dict[bytes, dict[str, Any]] = {}
        for position, design in enumerate(steps):
            before = len(known)
            runs = made_runs(problem, design, seed, partial(_make_unknown, problem, known))
            calls[position] += len(known) - before
        differing += not _is_same(problem, runs, made_runs(problem, steps[-1], seed))
    return " + ".join(f"{number / seeds:.0f}" for number in calls), differing


def _is_same(problem: Problem, extended: xr.Dataset, fresh: xr.Dataset) -> bool:
    """Whether all runs are the same, and all intervals."""
    # Reasons of failed runs are texts for people, and an interval that is not there is NaN.
    intervals = [repr(cells_of(problem, runs, STATISTICS)) for runs in (extended, fresh)]
    has_same_runs = extended.equals(fresh.drop_dims(FAILED_RUN, errors="ignore"))
    return has_same_runs and intervals[0] == intervals[1]


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
