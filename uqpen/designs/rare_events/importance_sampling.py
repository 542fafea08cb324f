"""Importance sampling: draws around the design points of an event, with weights."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import (
    DENSITY_RATIO,
    MIXTURE_COMPONENT,
    NORMAL_DISTANCE,
    SAMPLING_STAGE,
)
from uqpen.core.limits import MOST_REPLICATES
from uqpen.core.settings import choice, count
from uqpen.core.streams import Stream
from uqpen.designs.rare_events.design_point_search import (
    distinct_points,
    search_design_points,
    starting_points,
)
from uqpen.designs.rare_events.gaussian_mixture import GaussianMixture, log_normal_density
from uqpen.designs.rare_events.importance_stages import ImportanceStages
from uqpen.designs.rare_events.limit_state import LimitState
from uqpen.designs.rare_events.rare_event_design import RareEventDesign
from uqpen.designs.rare_events.replicates import Replicate, RequestedPoints, RunOutcomes
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["ImportanceSampling"]

# Part of the runs of a replicate that the search for design points may take. Part of those after it
# that each stage before the last takes, and the largest number of such stages.
_SEARCH_SHARE = 0.25
_STAGE_SHARE = 0.15
_STAGES = 4

_STARTS, _ITERATIONS = 3, 12
# A point where a search ended is near the event within this part of the distance of the limit from
# the median, and tells where to draw.
_NEAR = 0.1


@dataclass(frozen=True)
class ImportanceSampling(RareEventDesign):
    """Importance sampling from a mixture of normal distributions, in independent replicates.

    A replicate searches for design points from several starts, draws around them, fits the mixture
    to the draws that show the event, and draws again. Only the last draws are in the estimate. An
    inflated component of every mixture looks for parts of the event that the search has missed.

    Parameters
    ----------
    event : str
        The event: ``"depth > 3 m"``, or limits joined by ``and``, or by ``or``.
    samples : int
        Number of runs of a replicate, those of the search and of all stages together.
    replicates : int
        Number of independent repetitions of the whole method. Their scatter gives the interval. At
        most 10 000.
    start : str
        ``"form"``: at design points, by gradients. ``"cross-entropy"``: by draws alone, level by
        level, for an event without useful gradients. A search that finds nothing goes on so, too.

    References
    ----------
    Melchers, R. E. (1989). Structural Safety 6, 3-10; Rubinstein, R. Y. & Kroese, D. P. (2004).
    The Cross-Entropy Method, Springer; Hesterberg, T. (1995). Technometrics 37, 185-194.
    """

    samples: int = count(minimum=200, default=2000)
    replicates: int = count(minimum=3, maximum=MOST_REPLICATES, default=5)
    start: str = choice("form", "cross-entropy", default="form")

    @property
    def replicate_count(self) -> int:
        return self.replicates

    def run_count(self, joint: JointDistribution) -> int:
        return self.replicates * self.samples

    def replicate(self, joint: JointDistribution, event: LimitState, stream: Stream) -> Replicate:
        dimension = len(joint.random)
        centres, spent = np.empty((0, dimension)), 0
        if self.start == "form":
            centres, spent = yield from self._search(event, stream, dimension)
        stages = ImportanceStages(event, centres)
        number = round(_STAGE_SHARE * (self.samples - spent))
        mixture = stages.first(number)
        for stage in range(1, _STAGES + 1):
            points = mixture.draw(stream.generator("stage", stage))
            made = yield _request(points, stage, mixture)
            stages.add(mixture, points, made.outcomes)
            spent += number
            if stages.are_enough:
                break
            mixture = stages.following(number)
        mixture = stages.following(self.samples - spent)
        points = mixture.draw(stream.generator("last stage"))
        yield _request(points, stage + 1, mixture)

    def _search(
        self, event: LimitState, stream: Stream, dimension: int
    ) -> Generator[RequestedPoints, RunOutcomes, tuple[FloatArray, int]]:
        """Yield the points of the search; return where it ended near the event, and its runs."""
        most = int(_SEARCH_SHARE * self.samples)
        starts = starting_points(_STARTS, dimension, stream.generator("starts"))
        search = search_design_points(starts, _ITERATIONS)
        wanted, scales, spent = next(search), None, 0
        while spent + len(wanted.points) <= most:
            made = yield _request(wanted.points, 0, None)
            spent += len(wanted.points)
            scales = event.scales(made.outcomes) if scales is None else scales
            try:
                wanted = search.send((made.runs, event.performance(made.outcomes, scales)))
            except StopIteration as ended:
                found = ended.value
                near = np.flatnonzero(np.abs(found.performance) <= _NEAR)
                return found.points[near[distinct_points(found.points[near])]], spent
        search.close()
        return np.empty((0, dimension)), spent


def _request(points: FloatArray, stage: int, mixture: GaussianMixture | None) -> RequestedPoints:
    """Return points with their stage, the component that drew them, and the ratio of densities.

    The points of a search are no draws: their component is -1, and they have no ratio.
    """
    size = len(points)
    if mixture is None:
        component, ratio = np.full(size, -1), np.full(size, np.nan)
    else:
        component = mixture.component
        ratio = np.exp(log_normal_density(points) - mixture.log_density(points))
    return RequestedPoints(
        points,
        {
            SAMPLING_STAGE: np.full(size, stage),
            MIXTURE_COMPONENT: component,
            DENSITY_RATIO: ratio,
            NORMAL_DISTANCE: np.sqrt((points**2).sum(axis=1)),
        },
    )
