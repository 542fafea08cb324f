"""How well Gaussian processes predict, and how often their 95 % intervals hold fresh points.

A table of docs/surrogates.md as `seed_table.py` makes it. The inputs are uniform. Each row is of
several Latin hypercubes and 2 000 fresh points, and has medians over the hypercubes. It fails if a
function is fitted worse than by the best of the 29 emulators that Rumsey, Gibson, Francom & Morris
(2025, arXiv 2512.09060) have compared, or if the intervals of these hold less than 93 % or more
than 97 %.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import qmc
from seed_table import Row, SeedTable, medians, table

from uqpen.core.arrays import FloatArray
from uqpen.distributions.univariate import Uniform
from uqpen.surrogates.gaussian_process import GaussianProcess
from uqpen.surrogates.gaussian_process_fit import StandardisedInputs

FRESH = 2000


def borehole(x: FloatArray) -> FloatArray:
    r_w, r, t_u, h_u, t_l, h_l, length, k_w = x.T
    ratio = np.log(r / r_w)
    leak = 2 * length * t_u / (ratio * r_w**2 * k_w)
    return 2 * np.pi * t_u * (h_u - h_l) / (ratio * (1 + leak + t_u / t_l))


def friedman(x: FloatArray) -> FloatArray:
    waves = 10 * np.sin(np.pi * x[:, 0] * x[:, 1])
    return waves + 20 * (x[:, 2] - 0.5) ** 2 + 10 * x[:, 3] + 5 * x[:, 4]


def piston(x: FloatArray) -> FloatArray:
    mass, area, volume, spring, pressure, ambient, filling = x.T
    force = pressure * area + 19.62 * mass - spring * volume / area
    gas = pressure * volume * ambient / filling
    found = area / (2 * spring) * (np.sqrt(force**2 + 4 * spring * gas) - force)
    return 2 * np.pi * np.sqrt(mass / (spring + area**2 * gas / found**2))


def wing_weight(x: FloatArray) -> FloatArray:
    area, fuel, aspect, sweep, pressure, taper, thickness, load, gross, paint = x.T
    cosine = np.cos(np.radians(sweep))
    shape = (aspect / cosine**2) ** 0.6 * (100 * thickness / cosine) ** -0.3
    rest = pressure**0.006 * taper**0.04 * (load * gross) ** 0.49
    return 0.036 * area**0.758 * fuel**0.0035 * shape * rest + area * paint


def ishigami(x: FloatArray) -> FloatArray:
    return np.sin(x[..., 0]) * (1 + 0.1 * x[..., 2] ** 4) + 7 * np.sin(x[..., 1]) ** 2


def step(x: FloatArray) -> FloatArray:
    return (x[:, 0] + 0.5 * x[:, 1] > 0.8) + 0.3 * x[:, 2]


class Case(NamedTuple):
    """A function of uniform inputs, and the best public figure at 100 runs."""

    function: Callable[[FloatArray], FloatArray]
    lower: list[float]
    upper: list[float]
    best_public: float = np.inf


CASES = {
    "borehole": Case(
        borehole,
        [0.05, 100, 63070, 990, 63.1, 700, 1120, 9855],
        [0.15, 50000, 115600, 1110, 116, 820, 1680, 12045],
        1.2e-3,
    ),
    "Friedman": Case(friedman, [0] * 5, [1] * 5, 8.7e-4),
    "piston": Case(
        piston,
        [30, 0.005, 0.002, 1000, 90000, 290, 340],
        [60, 0.02, 0.01, 5000, 110000, 296, 360],
        1.4e-2,
    ),
    "wing weight": Case(
        wing_weight,
        [150, 220, 6, -10, 16, 0.5, 0.08, 2.5, 1700, 0.025],
        [200, 300, 10, 10, 45, 1, 0.18, 6, 2500, 0.08],
    ),
    "Ishigami": Case(ishigami, [-np.pi] * 3, [np.pi] * 3),
    "a jump": Case(step, [0] * 3, [1] * 3),
}


def _rows(function: str, runs: int, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield shares of the variance, fresh and left out, the coverage, and the processor time."""
    case = CASES[function]
    lower, width = np.array(case.lower), np.subtract(case.upper, case.lower)
    laws = [Uniform(*ends) for ends in zip(case.lower, case.upper, strict=True)]
    surrogate = GaussianProcess(design="training")
    for seed in seeds:
        rng = np.random.default_rng(seed)
        points = lower + width * qmc.LatinHypercube(len(laws), rng=rng).random(runs)
        fresh = lower + width * rng.random((FRESH, len(laws)))
        start = time.process_time()
        inputs = StandardisedInputs.of_runs(laws, points)
        fit = surrogate.fit_values(inputs, points, case.function(points), rng)
        seconds = time.process_time() - start
        if isinstance(fit, str):
            raise TypeError(fit)
        found, truth = fit.predict(fresh), case.function(fresh)
        error = np.abs(truth - found.mean)
        yield {
            "unexplained": float(np.mean(error**2) / np.var(truth)),
            "left_out": 1 - fit.q2,
            "coverage": float(np.mean(error <= 1.959964 * found.std)),
            "seconds": seconds,
        }


COLUMNS = {
    "function": "function",
    "runs": "runs",
    "unexplained": lambda c: f"{c.unexplained:.1e}",
    "1 - Q², runs left out": lambda c: f"{c.left_out:.1e}",
    "intervals hold, %": lambda c: f"{100 * c.coverage:.1f}",
    "fit, s": lambda c: f"{c.seconds:.2g}",
}


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for (name, runs), cell in medians(rows, "function", "runs").items():
        best = CASES[name].best_public
        if runs == 100 and np.isfinite(best):
            if cell.unexplained > best:
                yield f"{name}: {cell.unexplained:.1e} of the variance is unexplained"
            if not 0.93 <= cell.coverage <= 0.97:
                yield f"{name}: intervals hold {cell.coverage:.1%}"


TABLE = SeedTable(
    {"function": CASES, "runs": (20, 50, 100, 200)},
    _rows,
    {"gaussian processes": lambda rows: table(medians(rows, "function", "runs").values(), COLUMNS)},
    _failing,
    seeds=20,
)

if __name__ == "__main__":
    TABLE.main(__doc__)
