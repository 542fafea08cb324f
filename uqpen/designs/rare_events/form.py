"""First-order reliability method: the design points of an event, and how it curves there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import IntArray
from uqpen.core.labels import MOVED_AXIS, NORMAL_DISTANCE, SEARCH_ORIGIN, SEARCH_START
from uqpen.core.settings import count, flag
from uqpen.core.streams import Stream
from uqpen.designs.rare_events.curvature import CURVATURE_AXIS, curvature_offsets, tangent_basis
from uqpen.designs.rare_events.design_point_search import (
    FoundPoints,
    SearchPoints,
    distinct_points,
    search_design_points,
    starting_points,
)
from uqpen.designs.rare_events.limit_state import LimitState
from uqpen.designs.rare_events.rare_event_design import RareEventDesign
from uqpen.designs.rare_events.replicates import Replicate, RequestedPoints
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["Form"]


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

    starts: int = count(default=5, maximum=1000)
    iterations: int = count(default=20, maximum=1000)
    curvature: bool = flag(default=True)

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
