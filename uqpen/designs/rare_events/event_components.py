"""Normal distributions fitted to the parts of an event that weighted draws have met."""

from __future__ import annotations

import math

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.threads import one_blas_thread
from uqpen.designs.rare_events.gaussian_mixture import GaussianComponent

__all__ = ["effective_size", "fitted_components"]

# Most parts of an event that are told apart.
_MOST = 8

# Draws of one standard normal distribution are about the square root of 2 d apart.
_SEPARATION = 1.3

# Draws whose square of the radius is larger than that of the nearest by this have a density lower
# by a factor of e**-8: no part of the event begins there that matters.
_BEYOND = 16.0

# Iterations that assign draws to the nearest mean; few suffice from separated starts.
_ITERATIONS = 3

# A part of the event that few draws have met may be larger than they say: its share is at least
# this, divided by the number of parts.
_LEAST_SHARE = 0.3

# A fitted normal distribution has lighter tails than the event may have. So its covariance is
# widened, by 1.5 for two inputs and less for more: the volume grows with a power of the dimension.
_WIDENING = 0.7


def effective_size(weights: FloatArray) -> float:
    """Return the effective sample size of weighted draws; 0 without any."""
    total = weights.sum()
    return float(total**2 / (weights**2).sum()) if total > 0 else 0.0


@one_blas_thread()
def fitted_components(
    points: FloatArray, weights: FloatArray, centres: FloatArray
) -> tuple[tuple[GaussianComponent, ...], FloatArray]:
    """Fit a normal distribution to each part of an event.

    A part begins at a centre, or at the draw nearest to the median that is far from all centres.

    Parameters
    ----------
    points : ndarray, shape (draw, random input)
        Draws within the event, in standard normal space; at least one.
    weights : ndarray, shape (draw,)
        Ratio of the standard normal density to that of the draws.
    centres : ndarray, shape (centre, random input)
        Points that are known to be of different parts; may be none.

    Returns
    -------
    tuple of GaussianComponent
        One of each part.
    ndarray, shape (component,)
        Share of each part in the probability.
    """
    found = _centres(points, centres)
    part = _nearest(points, found)
    for _ in range(_ITERATIONS):
        part = np.unique(part, return_inverse=True)[1]
        found = np.array(
            [
                np.average(points[part == k], axis=0, weights=weights[part == k])
                for k in range(part.max() + 1)
            ]
        )
        part = _nearest(points, found)
    components, masses = [], []
    for k in np.unique(part):
        own = part == k
        components.append(_fitted(points[own], weights[own]))
        masses.append(weights[own].sum())
    shares = np.array(masses) / np.sum(masses)
    return tuple(components), np.maximum(shares, _LEAST_SHARE / len(shares))


def _centres(points: FloatArray, known: FloatArray) -> FloatArray:
    separation = _SEPARATION * math.sqrt(2 * points.shape[1])
    found = list(known)
    squared = (points**2).sum(axis=1)
    order = np.argsort(squared, kind="stable")
    for candidate in points[order[squared[order] <= squared[order[0]] + _BEYOND]]:
        if len(found) >= _MOST:
            break
        if not found or np.linalg.norm(np.array(found) - candidate, axis=1).min() > separation:
            found.append(candidate)
    return np.array(found)


def _nearest(points: FloatArray, centres: FloatArray) -> IntArray:
    distances = np.array([((points - each) ** 2).sum(axis=1) for each in centres])
    return distances.argmin(axis=0)


def _fitted(points: FloatArray, weights: FloatArray) -> GaussianComponent:
    """Return a normal distribution with weighted moments, drawn to the standard one if few."""
    dimension = points.shape[1]
    mean = np.average(points, axis=0, weights=weights)
    deviations = points - mean
    scatter = (weights[:, np.newaxis] * deviations).T @ deviations / weights.sum()
    size = effective_size(weights)
    prior = dimension + dimension**2 / 10
    covariance = (size * scatter + prior * np.eye(dimension)) / (size + prior)
    return GaussianComponent(mean, (1 + _WIDENING / math.sqrt(dimension)) * covariance)
