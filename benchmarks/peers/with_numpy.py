"""A plain loop, or one call over arrays, with NumPy: no package for uncertainty at all."""

from __future__ import annotations

import numpy as np
from shared import DIMENSION, LOWER, UPPER, Figures, FloatArray, function, main, one_run
from shared import moments as figures


def points(runs: int, seed: int) -> FloatArray:
    return np.random.default_rng(seed).uniform(LOWER, UPPER, (runs, DIMENSION))


def moments(runs: int, seed: int) -> Figures:
    return figures(function(points(runs, seed)))


def one_by_one(runs: int, seed: int) -> Figures:
    values = [one_run(*point) for point in points(runs, seed).tolist()]
    return figures(np.array(values))


if __name__ == "__main__":
    main("numpy", moments, one_by_one)
