"""Campbell's curve with the exact statistics of its usual inputs, for benchmarks and tests.

Its moments and indices are those of Gauss-Legendre quadratures of x1, x2 and x3, in panels that are
small where the curve has a narrow peak. It is linear in x4, whose part is known in closed form.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import problems
import xarray as xr
from scipy.integrate import trapezoid

from uqpen.core.arrays import FloatArray
from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.distributions.univariate import Uniform
from uqpen.execution import Evaluator, evaluate
from uqpen.models.known_functions import Campbell

LOWER, UPPER = -1.0, 5.0
CURVE = Campbell.outputs[0]
JOINT = problems.independent(**{each.name: Uniform(LOWER, UPPER) for each in Campbell.inputs})
# Mean and variance of x4, and of any other input.
MEAN, VARIANCE = 2.0, 3.0


def runs_of(design: Design, seed: int) -> xr.Dataset:
    """Return the runs of a design, by its seed."""
    stream, evaluator = Stream(seed, "designs", "campbell"), Evaluator(Campbell())
    return problems.runs_of(design, JOINT, stream, lambda points: evaluate(evaluator, points, {}))


class Exact(NamedTuple):
    """Statistics of the curve, at its angles and as a whole.

    Attributes
    ----------
    mean, std : ndarray, shape (angle,)
    first_order, total_order : ndarray, shape (angle, input)
    generalized_first_order, generalized_total_order : ndarray, shape (input,)
        Weighted by the variance at each angle, by the trapezoidal rule.
    """

    mean: FloatArray
    std: FloatArray
    first_order: FloatArray
    total_order: FloatArray
    generalized_first_order: FloatArray
    generalized_total_order: FloatArray


@cache
def exact() -> Exact:
    """Return the exact statistics, to about five digits."""
    angles = np.array(CURVE.dims[0].values)
    parts = np.array([_parts(angle) for angle in angles])
    mean, variance, first, total = parts[:, 0], parts[:, 1], parts[:, 2:6], parts[:, 6:]
    shares = [first / variance[:, None], total / variance[:, None]]
    whole = [
        trapezoid(part, angles, axis=0) / trapezoid(variance, angles) for part in (first, total)
    ]
    return Exact(mean, np.sqrt(variance), *shares, *whole)


def _parts(angle: float) -> list[float]:
    """Mean, variance and each input's parts of it, of the first and of total order, at an angle."""
    (x1, w1), (x2, w2), (x3, w3) = (_rule(edges) for edges in (_PEAK, _SMOOTH, _PEAK))
    slope = np.exp(0.002 * x1 * angle)
    distance = (angle - 10 * x2[:, None]) ** 2
    width = 60 * x1[:, None, None] ** 2 + x3**2
    values = 10 + x1[:, None, None] * np.exp(-distance / width)
    values += ((x2 + MEAN) * slope[:, None])[:, :, None]
    weights = w1, w2, w3

    def mean(array: FloatArray, *axes: int) -> FloatArray:
        for axis in axes:
            array = np.average(array, axis, weights[axis], keepdims=True)
        return array

    others = [(1, 2), (0, 2), (0, 1)]
    centre, square = mean(values, 0, 1, 2).item(), mean(values**2, 0, 1, 2).item()
    of_x4 = VARIANCE * float(w1 @ slope**2)
    variance = square - centre**2 + of_x4
    first = [mean(mean(values, *o) ** 2, i).item() - centre**2 for i, o in enumerate(others)]
    total = [square - mean(mean(values, i) ** 2, *o).item() for i, o in enumerate(others)]
    alone = VARIANCE * float(w1 @ slope) ** 2
    total[0] += of_x4 - alone
    return [centre, variance, *first, alone, *total, of_x4]


def _rule(edges: list[float]) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre points and their probabilities in panels between some edges."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    left, half = np.array(edges[:-1]), np.diff(edges) / 2
    points = left[:, None] + half[:, None] * (nodes + 1)
    return points.ravel(), (half[:, None] * weights).ravel() / (UPPER - LOWER)


_PEAK = [LOWER, -0.5, -0.2, -0.05, 0.0, 0.05, 0.2, 0.5, 1.0, 2.0, 3.5, UPPER]
_SMOOTH = [LOWER, 0.0, 1.0, 2.0, 3.0, 4.0, UPPER]
