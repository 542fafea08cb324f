"""Processor time and memory of the statistics of large samples, without a model and without files.

    python benchmarks/large_samples.py 3000000 10000000

The runs are drawn anew in each pass: four inputs, and three outputs, of which one has a threshold
and one two categories. The time of drawing all runs once is stated beside.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.blocks import BlockedRuns, block_ranges
from uqpen.core.labels import ROLE, RUN, SAMPLING, STATUS
from uqpen.core.model import Category, Output
from uqpen.core.streams import BLOCK, Stream
from uqpen.statistics.analyze import analyze, analyze_failures
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold

INPUTS = ("a", "b", "c", "d")
DEPTH, TIME = Output("depth", "m"), Output("time", "s")
KIND = Output("kind", "1", categories=(Category("stop", "stops"), Category("pass", "passes")))
QUANTITIES = [
    QuantityOfInterest(DEPTH, "m", thresholds=(Threshold("3 m", 3.0),)),
    QuantityOfInterest(TIME, "s"),
    QuantityOfInterest(KIND, "1"),
]


class DrawnRuns(BlockedRuns):
    """Independent runs of a formula, drawn block by block whenever they are read."""

    def __init__(self, size: int, seed: int = 1) -> None:
        self._size, self._stream = size, Stream(seed, "benchmarks", "large samples")

    @property
    def size(self) -> int:
        """Number of runs."""
        return self._size

    def part(self, start: int, stop: int, names: Iterable[str]) -> dict[str, npt.NDArray[Any]]:
        """Return some columns of runs; the status alone is not drawn, as a file has it beside."""
        names = [*names]
        if names == [STATUS]:
            return {STATUS: np.zeros(stop - start, dtype=np.int8)}
        first = start // BLOCK * BLOCK
        columns = self._block(first)
        rows = slice(start - first, stop - first)
        return {name: columns[name][rows] for name in names}

    def _block(self, start: int) -> dict[str, npt.NDArray[Any]]:
        drawn = self._stream.generator(start // BLOCK).standard_normal((4, BLOCK))
        columns: dict[str, npt.NDArray[Any]] = dict(zip(INPUTS, drawn, strict=True))
        a, b, c, d = drawn
        columns["depth"] = np.exp(0.5 * a + 0.2 * b + 0.1 * c * d)
        columns["time"] = 20 + 3 * b + a * c
        columns["kind"] = (b + 0.5 * d > 2).astype(np.int8)
        columns[STATUS] = np.zeros(BLOCK, dtype=np.int8)
        return columns

    def read(self, start: int, stop: int) -> xr.Dataset:
        """Return all columns of runs of one block."""
        columns = self.part(start, stop, [*INPUTS, "depth", "time", "kind", STATUS])
        described = {
            name: (RUN, values, {ROLE: "input"} if name in INPUTS else {})
            for name, values in columns.items()
        }
        return xr.Dataset(described, attrs={SAMPLING: "independent"})

    def column(self, name: str) -> npt.NDArray[Any]:
        """Return a column; the status alone is read as a whole."""
        if name == STATUS:
            return np.zeros(self.size, dtype=np.int8)
        ranges = block_ranges(self.size)
        return np.concatenate([self.part(start, stop, [name])[name] for start, stop in ranges])


def main() -> None:
    """Print a line for each number of runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", type=int, nargs="+")
    analyze(DrawnRuns(2**16), QUANTITIES, in_memory=1000)  # compiles
    for size in parser.parse_args().runs:
        runs = DrawnRuns(size)
        begun = time.process_time()
        for start, stop in block_ranges(size):
            runs.part(start, stop, INPUTS)
        drawing = time.process_time() - begun
        begun = time.process_time()
        analyze(runs, QUANTITIES, in_memory=1000)
        analyze_failures(runs, in_memory=1000)
        spent = time.process_time() - begun
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        print(
            f"{size} runs: {1e6 * spent / size:.3f} µs a run, "
            f"drawing once {1e6 * drawing / size:.3f}; peak {peak:.0f} MB",
            flush=True,
        )


if __name__ == "__main__":
    main()
