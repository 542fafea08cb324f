"""Coverage of the intervals that only samples by blocks have: of indices and of correlations.

    python benchmarks/large_sample_coverage.py --seeds 200

The output is 2 a + b + e / 2 of standard normal variables, of which a, b and c are inputs. So its
indices, correlations and rank correlations are known. Samples of so few runs go by blocks here, so
that many seeds can be analysed; the blocks are smaller in the same proportion.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter, defaultdict
from typing import Any

import numpy as np
import xarray as xr
from scipy import special

import uqpen.core.blocks
from uqpen.core.labels import REPLICATE, ROLE, RUN, SAMPLING, STATUS
from uqpen.core.model import Output
from uqpen.statistics.analyze import analyze
from uqpen.statistics.by_blocks.products import partial
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

INPUTS, SLOPES, REST = ("a", "b", "c"), np.array([2.0, 1.0, 0.0]), 0.5
REPLICATES = 32
VARIANCE = float((SLOPES**2).sum() + REST**2)


def truths() -> dict[str, np.ndarray]:
    """Return the exact value of each measure, by input."""
    pearson = SLOPES / math.sqrt(VARIANCE)
    spearman = 6 / math.pi * np.arcsin(pearson / 2)

    def partials(simple: np.ndarray) -> np.ndarray:
        matrix = np.eye(4)
        matrix[3, :3] = matrix[:3, 3] = simple
        return partial(matrix)

    return {
        "first_order": SLOPES**2 / VARIANCE,
        "pearson": pearson,
        "spearman": spearman,
        "partial": partials(pearson),
        "partial_rank": partials(spearman),
    }


def drawn(plan: str, runs: int, seed: int) -> xr.Dataset:
    """Draw runs, independently or as replicates of a Latin hypercube."""
    generator = np.random.default_rng(seed)
    draws, coordinates = generator.random((runs, 3)), {}
    if plan == "stratified":
        each = runs // REPLICATES
        strata = generator.permuted(np.tile(np.arange(each), (REPLICATES * 3, 1)), axis=1)
        strata = strata.reshape(REPLICATES, 3, each).transpose(0, 2, 1).reshape(runs, 3)
        draws = (strata + draws) / each
        coordinates = {REPLICATE: (RUN, np.repeat(np.arange(REPLICATES), each))}
    points = special.ndtri(draws)
    output = points @ SLOPES + REST * generator.standard_normal(runs)
    columns: dict[str, Any] = {
        name: (RUN, points[:, k], {ROLE: "input"}) for k, name in enumerate(INPUTS)
    }
    columns |= {"y": (RUN, output), STATUS: (RUN, np.zeros(runs, dtype=np.int8))}
    return xr.Dataset(columns, coordinates, {SAMPLING: plan})


def main() -> None:
    """Print the coverage and the mean half-width of each measure, and its mean error."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--runs", type=int, default=2**16)
    parser.add_argument("--block", type=int, default=2**12)
    chosen = parser.parse_args()
    setattr(uqpen.core.blocks, "BLOCK", chosen.block)  # noqa: B010
    question = QuantityOfInterest(Output("y", "1"), "1")
    for plan in ("independent", "stratified"):
        covered: Counter[tuple[str, str]] = Counter()
        widths, errors = defaultdict(list), defaultdict(list)
        for seed in range(chosen.seeds):
            runs = drawn(plan, chosen.runs, seed)
            found = analyze(runs, [question], only=["sensitivity"], in_memory=1000)["y"]
            for name, exact in truths().items():
                for k, (value, lower, upper) in enumerate(found[name].values):
                    key = name, INPUTS[k]
                    covered[key] += bool(lower <= exact[k] <= upper)
                    widths[key].append((upper - lower) / 2)
                    errors[key].append(value - exact[k])
        for key, width in widths.items():
            print(
                f"{plan} {' '.join(key)}: {100 * covered[key] / chosen.seeds:.1f} %, half-width "
                f"{np.mean(width):.5f}, bias {np.mean(errors[key]):+.5f}, scatter "
                f"{np.std(errors[key]):.5f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
