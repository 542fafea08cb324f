"""A plain loop, or one call over arrays, with NumPy: no package for uncertainty at all."""

from __future__ import annotations

import numpy as np
from shared import DIMENSION, LOWER, UPPER, Figures, FloatArray, function, main, moments, one_run


def points(runs: int, seed: int) -> FloatArray:
    return np.random.default_rng(seed).uniform(LOWER, UPPER, (runs, DIMENSION))


def vectorized(runs: int, seed: int) -> Figures:
    return moments(function(points(runs, seed)))


def one_by_one(runs: int, seed: int) -> Figures:
    values = [one_run(*point) for point in points(runs, seed).tolist()]
    return moments(np.array(values))


if __name__ == "__main__":
    main("numpy", {"start": vectorized, "moments": vectorized, "one-by-one": one_by_one})
