"""The distribution of Anderson and Darling's statistic of a fitted generalised Pareto distribution.

Run it as ``python benchmarks/tail_fit_table.py --samples 40000``, with uqpen installed. It prints
the table of `uqpen.statistics.tails`: for each shape, the values that the statistic
exceeds with some probabilities. It depends on the shape alone; samples have 200 excesses.
"""

from __future__ import annotations

import argparse

import numpy as np

from uqpen.statistics.tails import P_VALUES, SHAPES, fit_tails

EXCESSES, TOGETHER = 200, 500


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=40_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    for shape in SHAPES:
        rng = np.random.default_rng([options.seed, round(100 * shape) % 2**32])
        found = []
        for _ in range(options.samples // TOGETHER):
            unit = rng.random((TOGETHER, EXCESSES))
            excesses = np.expm1(-shape * np.log(unit)) / shape if shape else -np.log(unit)
            found.append(fit_tails(excesses).anderson_darling)
        points = np.quantile(np.concatenate(found), 1 - np.array(P_VALUES))
        print(f"    ({', '.join(f'{each:.3f}' for each in points)}),  # {shape:g}", flush=True)


if __name__ == "__main__":
    main()
