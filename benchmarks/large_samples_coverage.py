"""Coverage and width of first-order indices from many runs, whose bins grow with these.

A table of docs/coverage/many_runs.md as `seed_table.py` makes it: independent draws of functions
whose indices are known. Beside each figure stands that with bins of 16 runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from gaussian_process import ishigami
from problems import independent
from seed_table import Row, SeedTable, counted, per_cent, summed

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.distributions.univariate import Uniform
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample
from uqpen.statistics.sensitivity import local_regression
from uqpen.statistics.sensitivity.given_data import first_order

NAMES = ("x1", "x2", "x3")
QUANTITY = QuantityOfInterest(Output("y", "1"), "1")


def jump(x: FloatArray) -> FloatArray:
    return 3.0 * (x[:, 0] > 0.713) + x[:, 1]


def waves(x: FloatArray) -> FloatArray:
    """Forty periods along an input, and noise by another."""
    return np.asarray(np.sin(80 * math.pi * x[:, 0]) + x[:, 1])


def spike(x: FloatArray) -> FloatArray:
    """Large at one end of an input: a steep pole there."""
    return np.asarray((x[:, 0] + 0.01) ** -0.5 * (0.5 + x[:, 1]))


_JUMP = 9 * 0.713 * 0.287
_MEAN = 2 * (math.sqrt(1.01) - math.sqrt(0.01))
_SQUARE = math.log(1.01 / 0.01)
_SPIKE = _SQUARE * (1 + 1 / 12) - _MEAN**2
PROBLEMS: dict[str, tuple[Callable[[FloatArray], FloatArray], tuple[float, ...]]] = {
    "ishigami": (
        lambda x: ishigami(math.pi * (2 * x - 1)),
        (0.31390519114781146, 0.4424111447900409, 0.0),
    ),
    "jump": (jump, (_JUMP / (_JUMP + 1 / 12), 1 / 12 / (_JUMP + 1 / 12), 0.0)),
    "waves": (waves, (0.5 / (0.5 + 1 / 12), 1 / 12 / (0.5 + 1 / 12), 0.0)),
    "spike": (spike, ((_SQUARE - _MEAN**2) / _SPIKE, _MEAN**2 / 12 / _SPIKE, 0.0)),
}


def drawn(runs: int, seed: int) -> Sample:
    joint = independent(**dict.fromkeys(NAMES, Uniform(0.0, 1.0)))
    made = points_in_memory(next(MonteCarlo(runs=runs).rounds(joint, Stream(seed))))
    points = np.column_stack([made[name].values for name in NAMES])
    everything = np.arange(len(points))
    columns = InputColumns.from_matrix(NAMES, points)
    empty = everything[:0]
    values = np.zeros(len(points))
    return Sample(values, everything, empty, columns, everything * 0, Sampling.INDEPENDENT)


@contextmanager
def small_bins() -> Iterator[None]:
    """Bins of 16 runs for any number of runs."""
    kept = local_regression._RUNS_FOR_SMALL_BINS
    local_regression._RUNS_FOR_SMALL_BINS = 2**62
    try:
        yield
    finally:
        local_regression._RUNS_FOR_SMALL_BINS = kept


def estimates(sample: Sample, function: Callable[[FloatArray], FloatArray]) -> FloatArray:
    # Other bins are those of other inputs, which an array of its own stands for.
    own = replace(sample, values=function(sample.points), used=sample.used.copy())
    found = dict(first_order(own, QUANTITY))["first_order"].values
    return np.asarray(found)


def _rows(runs: int, problem: str, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield how many intervals of an input cover, and their half-widths added up."""
    function, exact = PROBLEMS[problem]
    found: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    for seed in seeds:
        sample = drawn(runs, seed)
        found[0].append(estimates(sample, function))
        with small_bins():
            found[1].append(estimates(sample, function))
    for number, name in enumerate(NAMES):
        row: dict[str, Any] = {"input": name}
        for bins, bounds in zip(("", "_of_16"), found, strict=True):
            _, lower, upper = np.array(bounds)[:, number].T
            covers = (lower <= exact[number]) & (exact[number] <= upper)
            row |= {f"covers{bins}": covers.sum(), f"width{bins}": (upper - lower).sum() / 2}
        yield row


COLUMNS = {
    "runs": lambda c: counted(c.runs),
    "function": "problem",
    "input": "input",
    "coverage": lambda c: per_cent(c.covers, c.count),
    "coverage, bins of 16": lambda c: per_cent(c.covers_of_16, c.count),
    "half-width": lambda c: f"{c.width / c.count:.4f}",
    "half-width, bins of 16": lambda c: f"{c.width_of_16 / c.count:.4f}",
}
TABLE = SeedTable(
    {"runs": (30_000, 100_000), "problem": PROBLEMS},
    _rows,
    {"many runs": summed(COLUMNS, "runs", "problem", "input")},
    seeds=400,
    at_once=10,
)

if __name__ == "__main__":
    TABLE.main(__doc__)
