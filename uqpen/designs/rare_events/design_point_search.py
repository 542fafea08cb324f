"""Search for design points: the most probable points of an event, in standard normal space."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray

__all__ = [
    "DIFFERENCE",
    "FoundPoints",
    "Search",
    "SearchPoints",
    "distinct_points",
    "search_design_points",
    "starting_points",
]

DIFFERENCE = 0.01
"""Step of the finite differences of a gradient, in standard deviations of an input."""

# Fractions of a step that are tried at once where the whole step is too long.
_FRACTIONS = np.array([0.5, 0.25, 0.1])

# Nothing is searched further out: the probability beyond is below 1e-22.
_FURTHEST = 10.0

# A search has converged where the performance is this part of the distance of the limit from the
# median, and the next step is this short. Both are far below the scatter of an estimate.
_AT_LIMIT = 0.005
_SHORT_STEP = 0.05

# Design points that are nearer to each other are the same: several times the length of a last step.
_SAME = 0.3


@dataclass(frozen=True, eq=False)
class SearchPoints:
    """Points of a round of the search.

    Parameters
    ----------
    points : ndarray, shape (run, random input)
        In standard normal space.
    start : ndarray of int, shape (run,)
        Number of the start whose search wants the run.
    origin : ndarray of int, shape (run,)
        Run that a point is a step from; -1 for a start.
    axis : ndarray of int, shape (run,)
        Axis that is moved for a finite difference; -1 for a point of the search itself.
    """

    points: FloatArray
    start: IntArray
    origin: IntArray
    axis: IntArray


@dataclass(frozen=True, eq=False)
class FoundPoints:
    """Points where the searches have ended, along ``start``.

    Parameters
    ----------
    points : ndarray, shape (start, random input)
        In standard normal space.
    runs : ndarray of int, shape (start,)
        Their runs.
    performance : ndarray, shape (start,)
        How near they come to the event; not finite where a search found no run to begin with.
    gradients : ndarray, shape (start, random input)
        Of the performance; NaN where it is not known.
    converged : ndarray of bool, shape (start,)
        Whether a search has reached a design point.
    """

    points: FloatArray
    runs: IntArray
    performance: FloatArray
    gradients: FloatArray
    converged: BoolArray


# A search yields points, and is sent the numbers of their runs with the performance of each.
Search = Generator[SearchPoints, tuple[IntArray, FloatArray], FoundPoints]


def starting_points(number: int, dimension: int, rng: np.random.Generator) -> FloatArray:
    """Return the median of all inputs, and draws with their mirror images.

    An event on both sides of the median then has a start on either side.

    Returns
    -------
    ndarray, shape (start, random input)
    """
    drawn = rng.standard_normal((number // 2, dimension))
    pairs = np.stack([drawn, -drawn], axis=1).reshape(-1, dimension)
    return np.concatenate([np.zeros((1, dimension)), pairs])[:number]


def distinct_points(points: FloatArray) -> IntArray:
    """Return the positions of points that are not near one before, the nearest to 0 first."""
    found: list[int] = []
    for at in np.argsort((points**2).sum(axis=1), kind="stable"):
        if all(np.linalg.norm(points[at] - points[other]) > _SAME for other in found):
            found.append(int(at))
    return np.array(found, dtype=np.int64)


def search_design_points(starts: FloatArray, iterations: int) -> Search:
    """Search from several starts at once, by the improved method of Hasofer, Lind and Rackwitz.

    Each iteration takes a gradient by forward differences, and the step to the nearest point of
    the tangent plane at the limit. The step is made shorter until the merit function decreases:
    half the squared distance from 0, plus a penalty on the distance from the limit.

    Parameters
    ----------
    starts : ndarray, shape (start, random input)
        In standard normal space.
    iterations : int
        At the most.

    References
    ----------
    Zhang, Y. & Der Kiureghian, A. (1995). Reliability and Optimization of Structural Systems,
    Chapman & Hall, 297-304.
    """
    state = FoundPoints(
        starts.copy(),
        np.zeros(len(starts), dtype=np.int64),
        np.zeros(len(starts)),
        np.full(starts.shape, np.nan),
        np.zeros(len(starts), dtype=np.bool_),
    )
    every = np.arange(len(starts))
    none = np.full(len(starts), -1)
    state.runs[:], state.performance[:] = yield SearchPoints(starts, every, none, none)
    going = np.flatnonzero(np.isfinite(state.performance))
    for _ in range(iterations):
        if not len(going):
            break
        yield from _differentiate(state, going)
        size = (state.gradients[going] ** 2).sum(axis=1)
        going = going[size > 0]  # a flat performance leads nowhere
        targets = _targets(state, going)
        is_near = np.abs(state.performance[going]) <= _AT_LIMIT
        steps = np.linalg.norm(targets - state.points[going], axis=1)
        state.converged[going] = is_near & (steps <= _SHORT_STEP)
        is_going = ~state.converged[going]
        going, targets = going[is_going], targets[is_going]
        if len(going):
            going = yield from _step(state, going, targets)
    return state


def _differentiate(
    state: FoundPoints, going: IntArray
) -> Generator[SearchPoints, tuple[IntArray, FloatArray], None]:
    """Make the runs of the gradients at the points of searches that go on."""
    dimension = state.points.shape[1]
    moved = state.points[going, np.newaxis, :] + DIFFERENCE * np.eye(dimension)
    _, performance = yield SearchPoints(
        moved.reshape(-1, dimension),
        np.repeat(going, dimension),
        np.repeat(state.runs[going], dimension),
        np.tile(np.arange(dimension), len(going)),
    )
    change = performance.reshape(-1, dimension) - state.performance[going, np.newaxis]
    # A direction in which the run failed is left as it is in this step.
    state.gradients[going] = np.where(np.isfinite(change), change, 0.0) / DIFFERENCE


def _targets(state: FoundPoints, going: IntArray) -> FloatArray:
    """Return the nearest point to 0 of each tangent plane at the limit."""
    gradients, points = state.gradients[going], state.points[going]
    factor = (gradients * points).sum(axis=1) - state.performance[going]
    targets = (factor / (gradients**2).sum(axis=1))[:, np.newaxis] * gradients
    radius = np.linalg.norm(targets, axis=1, keepdims=True)
    nearer: FloatArray = targets * np.minimum(1.0, _FURTHEST / np.maximum(radius, 1e-300))
    return nearer


def _step(
    state: FoundPoints, going: IntArray, targets: FloatArray
) -> Generator[SearchPoints, tuple[IntArray, FloatArray], IntArray]:
    """Move searches towards their targets; return those that could move."""
    penalty = _penalty(state, going, targets)
    before = _merit(state.points[going], state.performance[going], penalty)
    pending, has_moved = np.arange(len(going)), np.zeros(len(going), dtype=np.bool_)
    for fractions in (np.ones(1), _FRACTIONS):
        own = going[pending]
        change = targets[pending] - state.points[own]
        trials = state.points[own, np.newaxis, :] + fractions[:, np.newaxis] * change[:, np.newaxis]
        count, dimension = len(fractions), trials.shape[-1]
        runs, performance = yield SearchPoints(
            trials.reshape(-1, dimension),
            np.repeat(own, count),
            np.repeat(state.runs[own], count),
            np.full(len(own) * count, -1),
        )
        performance = performance.reshape(-1, count)
        merits = np.stack(
            [_merit(trials[:, k], performance[:, k], penalty[pending]) for k in range(count)], 1
        )
        best = merits.argmin(axis=1)
        row = np.arange(len(own))
        better = merits[row, best] < before[pending]
        chosen = own[better]
        state.points[chosen] = trials[row, best][better]
        state.runs[chosen] = runs.reshape(-1, count)[row, best][better]
        state.performance[chosen] = performance[row, best][better]
        has_moved[pending[better]] = True
        pending = pending[~better]
        if not len(pending):
            break
    return going[has_moved]


def _penalty(state: FoundPoints, going: IntArray, targets: FloatArray) -> FloatArray:
    """Return the factor of the penalty, so large that the step leads downhill."""
    slope = np.linalg.norm(state.gradients[going], axis=1)
    ratio = np.linalg.norm(state.points[going], axis=1) / slope
    distance = np.abs(state.performance[going])
    at_target = 0.5 * (targets**2).sum(axis=1) / np.maximum(distance, 1e-300)
    factor: FloatArray = 2 * np.maximum(ratio, np.where(distance > _AT_LIMIT, at_target, 0.0)) + 10
    return factor


def _merit(points: FloatArray, performance: FloatArray, penalty: FloatArray) -> FloatArray:
    """Return the merit of points; infinite where the run failed."""
    merit = 0.5 * (points**2).sum(axis=1) + penalty * np.abs(performance)
    return np.where(np.isfinite(performance), merit, np.inf)
