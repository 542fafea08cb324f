"""Curvature of the limit of an event at a design point, by second differences."""

from __future__ import annotations

import numpy as np

from uqpen.core.arrays import FloatArray

__all__ = ["CURVATURE_AXIS", "curvature_offsets", "principal_curvatures", "tangent_basis"]

CURVATURE_AXIS = -2
"""Axis of a run for the curvature, which is moved in the tangent plane."""

# Step in the tangent plane, in standard deviations: a probability averages over about one.
_STEP = 0.3


def tangent_basis(gradient: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the plane across a gradient, by a reflection.

    Parameters
    ----------
    gradient : ndarray, shape (random input,)
        Not 0.

    Returns
    -------
    ndarray, shape (random input - 1, random input)
    """
    normal = gradient / np.sqrt((gradient**2).sum())
    axis = int(np.abs(normal).argmax())
    mirror = normal.copy()
    mirror[axis] += np.sign(normal[axis])
    reflection = np.eye(len(normal)) - 2 * np.outer(mirror, mirror) / (mirror**2).sum()
    return np.delete(reflection, axis, axis=0)


def curvature_offsets(dimension: int) -> FloatArray:
    """Return the steps in a tangent plane, shape (run, random input - 1).

    A step forward along each of its axes, a step backward, and one along each pair of axes.
    """
    steps = _STEP * np.eye(dimension - 1)
    first, second = np.triu_indices(dimension - 1, 1)
    return np.concatenate([steps, -steps, steps[first] + steps[second]])


def principal_curvatures(
    performance: FloatArray, at_point: float, gradient: FloatArray
) -> FloatArray:
    """Return the principal curvatures; above 0 where the limit bends away from the median.

    Parameters
    ----------
    performance : ndarray, shape (run,)
        At the points of `curvature_offsets`.
    at_point : float
        At the design point.
    gradient : ndarray, shape (random input,)
        There.
    """
    number = len(gradient) - 1
    forward, backward = performance[:number], performance[number : 2 * number]
    hessian = np.diag(forward + backward - 2 * at_point)
    first, second = np.triu_indices(number, 1)
    mixed = performance[2 * number :] - forward[first] - forward[second] + at_point
    hessian[first, second] = hessian[second, first] = mixed
    slope = np.sqrt((gradient**2).sum())
    curvatures: FloatArray = np.linalg.eigvalsh(-hessian / (_STEP**2 * slope))
    return curvatures
