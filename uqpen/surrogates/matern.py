"""Matérn correlations, with a length for each input.

References
----------
Stein, M. L. (1999). Interpolation of Spatial Data. Springer.
Rasmussen, C. E. & Williams, C. K. I. (2006). Gaussian Processes for Machine Learning. MIT Press.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from uqpen.core.arrays import FloatArray

__all__ = ["SMOOTHNESS", "correlations", "correlations_and_slopes"]

# The smoothness ν of the correlations that can be chosen, by its name.
SMOOTHNESS = {"matern-5/2": 2.5, "matern-3/2": 1.5}


def correlations(one: FloatArray, other: FloatArray, smoothness: float) -> FloatArray:
    """Return the correlations between two sets of points, shape (one, other).

    Parameters
    ----------
    one, other : ndarray, shape (point, input)
        Coordinates in units of the lengths.
    smoothness : float
        ν: 2.5 for processes with two derivatives, 1.5 with one.
    """
    scaled = _scaled_distances(one, other, smoothness)
    decay = np.exp(-scaled)
    if smoothness == 1.5:
        return (1 + scaled) * decay
    return (1 + scaled + scaled**2 / 3) * decay


def correlations_and_slopes(points: FloatArray, smoothness: float) -> tuple[FloatArray, FloatArray]:
    """Return the correlations between points, and the slopes that their derivatives share.

    The derivative in the logarithm of the length of input k is the slope times the square of the
    difference in coordinate k.
    """
    scaled = _scaled_distances(points, points, smoothness)
    decay = np.exp(-scaled)
    if smoothness == 1.5:
        return (1 + scaled) * decay, 3 * decay
    return (1 + scaled + scaled**2 / 3) * decay, 5 / 3 * (1 + scaled) * decay


def _scaled_distances(one: FloatArray, other: FloatArray, smoothness: float) -> FloatArray:
    return np.sqrt(2 * smoothness) * cdist(one, other)
