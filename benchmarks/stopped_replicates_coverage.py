"""How often intervals cover where a design of replicates ends by itself, in whole studies.

Run it as ``python benchmarks/stopped_replicates_coverage.py --markdown docs/coverage.md``, with
uqpen installed. Looks, estimates and intervals are those of the package. The true values come from
one Sobol' set of four million points, whose error is far below the widths of intervals.
"""

from __future__ import annotations

import argparse
import multiprocessing
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from deciding_coverage import (
    FUNCTIONS,
    KINDS,
    FloatArray,
    Problem,
    bounds_of,
    precision_cells,
    problem_of,
    worst_of_other_seeds,
)
from seed_table import fill

from uqpen.core.labels import REPLICATE, SAMPLING, STATUS
from uqpen.core.sampling import Sampling
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence, sobol_points
from uqpen.designs.replicated import ReplicatedDesign

DOUBLINGS = 5
REFERENCE_EXPONENT = 22


class Replicates(NamedTuple):
    """Replicates at the first look, and the points of each."""

    design: ReplicatedDesign
    replicates: int
    points: int

    def draw(self, seed: int) -> Iterator[FloatArray]:
        """Yield the points of each look, shape (replicate, point, input)."""
        factor = 1 << DOUBLINGS
        grows = self.design.is_sequence
        numbers = range(self.replicates * (1 if grows else factor))
        points = self.points * (factor if grows else 1)
        rngs = (np.random.default_rng([2_066, seed, number]) for number in numbers)
        sets = np.stack([self.design.draw(rng, points, 3) for rng in rngs])
        for doublings in range(DOUBLINGS + 1):
            part = 1 << doublings
            yield sets[:, : self.points * part] if grows else sets[: self.replicates * part]


DESIGNS = {
    "Sobol' sets": Replicates(SobolSequence(64), 32, 16),
    "Halton sets": Replicates(Halton(64), 32, 16),
    "hypercubes": Replicates(LatinHypercube(20), 20, 26),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=400)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--markdown", type=Path, metavar="FILE.md")
    options = parser.parse_args()
    text = "\n".join(_table(options.seeds, options.workers))
    print(text)
    if options.markdown:
        fill(options.markdown, "replicates that end by themselves", text)


@cache
def problem(name: str) -> Problem:
    """A problem by its name."""
    unit = sobol_points(np.random.default_rng(2_065), 1 << REFERENCE_EXPONENT, 3)
    return problem_of(FUNCTIONS[name](unit.T))


def estimates(case: tuple[str, int]) -> FloatArray:
    """Return the bounds of all statistics of a seed, shape (function, look, kind, 3)."""
    name, seed = case
    looks = list(DESIGNS[name].draw(seed))
    return np.array(
        [
            [bounds_of(_runs(function(look.T).T), problem(each).quantity) for look in looks]
            for each, function in FUNCTIONS.items()
        ]
    )


def _runs(values: FloatArray) -> xr.Dataset:
    """Return runs of outputs, shape (replicate, point)."""
    return xr.Dataset(
        {
            "y": ("run", values.ravel(), {"units": "1", "role": "output"}),
            STATUS: ("run", np.zeros(values.size, np.int8)),
        },
        coords={REPLICATE: ("run", np.repeat(np.arange(len(values)), values.shape[1]))},
        attrs={SAMPLING: str(Sampling.STRATIFIED)},
    )


def _table(seeds: int, workers: int) -> Iterator[str]:
    yield (
        "| design | output | target | at the first look | worst target | of other seeds | "
        "middle target |"
    )
    yield "|---|---|---|---|---|---|---|"
    truths = {name: problem(name).truth for name in FUNCTIONS}
    for design in DESIGNS:
        cases = [(design, seed) for seed in range(seeds)]
        with multiprocessing.get_context("fork").Pool(workers) as pool:
            bounds = np.array(pool.map(estimates, cases, chunksize=5))
        for number, (name, truth) in enumerate(truths.items()):
            for kind, key in enumerate(KINDS):
                case = key, kind, bounds[:, number], truth[kind]
                cells = precision_cells(*case)
                cells.insert(2, f"{worst_of_other_seeds(*case):.1f}")
                yield f"| {design} | {name} | `{key}` | {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
