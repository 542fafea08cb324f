"""First-order reliability method: the design points of an event, and how it curves there."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.errors import Problem
from uqpen.core.labels import MOVED_AXIS, NORMAL_DISTANCE, SEARCH_ORIGIN, SEARCH_START
from uqpen.core.settings import count, flag
from uqpen.core.streams import Stream
from uqpen.designs.design import NO_STEP_BETWEEN_LABELS, steps_of_single_values
from uqpen.designs.rare_events.limit_state import LimitState
from uqpen.designs.rare_events.rare_event_design import RareEventDesign, Replicate, RequestedPoints
from uqpen.distributions.joint_distribution import JointDistribution

# Curvature of the limit of an event at a design point, by second differences.

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


# Search for design points: the most probable points of an event, in standard normal space.

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
    """Points of a round of the search."""

    points: FloatArray  # (run, random input): in standard normal space
    start: IntArray  # (run,): number of the start whose search wants the run
    origin: IntArray  # (run,): run that a point is a step from; -1 for a start
    # (run,): axis that is moved for a finite difference; -1 for a point of the search itself.
    axis: IntArray


@dataclass(frozen=True, eq=False)
class FoundPoints:
    """Points where the searches have ended, along ``start``."""

    points: FloatArray  # (start, random input): in standard normal space
    runs: IntArray  # (start,): their runs
    # (start,): how near they come to the event; not finite where a search found no run to begin
    # with.
    performance: FloatArray
    gradients: FloatArray  # (start, random input): of the performance; NaN where it is not known
    converged: BoolArray  # (start,): whether a search has reached a design point


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


@dataclass(frozen=True)
class Form(RareEventDesign):
    """First-order reliability method (FORM), from several starts.

    It finds the design points of an event and takes its limit as a plane at each. Further runs
    around a design point give the curvature there (SORM). Nothing in it measures its own error, so
    its probability has no interval: a design that samples the event has one.

    Parameters
    ----------
    event : str
        The event: ``"depth > 3 m"``, or limits joined by ``and``, or by ``or``.
    starts : int
        Number of starts: the median of the inputs, and random points in opposite pairs.
    iterations : int
        Largest number of iterations of a search.
    curvature : bool
        Whether to make the runs for the curvature.

    References
    ----------
    Hasofer, A. M. & Lind, N. C. (1974). Journal of the Engineering Mechanics Division 100, 111-121;
    Hohenbichler, M. & Rackwitz, R. (1988). Journal of Engineering Mechanics 114, 2195-2199.
    """

    unordered_reason = NO_STEP_BETWEEN_LABELS

    needs_numbers = True

    starts: int = count(default=5, maximum=1000)
    iterations: int = count(default=20, maximum=1000)
    curvature: bool = flag(default=True)

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        yield from super().check_inputs(joint)
        yield from steps_of_single_values(joint)

    @property
    def ends_early(self) -> bool:
        return True

    def run_count(self, joint: JointDistribution) -> int:
        dimension = len(joint.random)
        of_iteration = dimension + 4  # a gradient, a whole step, and three fractions of it
        of_curvature = len(curvature_offsets(dimension)) if self.curvature else 0
        return self.starts * (1 + self.iterations * of_iteration + of_curvature)

    def replicate(self, joint: JointDistribution, event: LimitState, stream: Stream) -> Replicate:
        dimension = len(joint.random)
        starts = starting_points(self.starts, dimension, stream.generator("starts"))
        search = search_design_points(starts, self.iterations)
        wanted, scales = next(search), None
        while True:
            made = yield _request(wanted)
            scales = event.scales(made.outcomes) if scales is None else scales
            try:
                wanted = search.send((made.runs, event.performance(made.outcomes, scales)))
            except StopIteration as ended:
                found: FoundPoints = ended.value
                break
        converged = np.flatnonzero(found.converged)
        if self.curvature and dimension > 1 and len(converged):
            yield _request(_around(found, converged[distinct_points(found.points[converged])]))


def _around(found: FoundPoints, chosen: IntArray) -> SearchPoints:
    """Return the points for the curvature at some design points."""
    dimension = found.points.shape[1]
    offsets = curvature_offsets(dimension)
    points = [found.points[at] + offsets @ tangent_basis(found.gradients[at]) for at in chosen]
    return SearchPoints(
        np.concatenate(points),
        np.repeat(chosen, len(offsets)),
        np.repeat(found.runs[chosen], len(offsets)),
        np.full(len(chosen) * len(offsets), CURVATURE_AXIS),
    )


def _request(searched: SearchPoints) -> RequestedPoints:
    """Return points of the search with what the analysis needs."""
    return RequestedPoints(
        searched.points,
        {
            SEARCH_START: searched.start,
            SEARCH_ORIGIN: searched.origin,
            MOVED_AXIS: searched.axis,
            NORMAL_DISTANCE: np.sqrt((searched.points**2).sum(axis=1)),
        },
    )
