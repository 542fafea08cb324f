"""Importance sampling: draws around the design points of an event, with weights."""

from __future__ import annotations

import math
import sys
from collections.abc import Generator
from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import (
    DENSITY_RATIO,
    MIXTURE_COMPONENT,
    NORMAL_DISTANCE,
    SAMPLING_STAGE,
)
from uqpen.core.limits import MOST_REPLICATES
from uqpen.core.processors import one_blas_thread
from uqpen.core.settings import choice, count
from uqpen.core.streams import Stream
from uqpen.designs.rare_events.form import (
    distinct_points,
    search_design_points,
    starting_points,
)
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState
from uqpen.designs.rare_events.rare_event_design import (
    RareEventDesign,
    Replicate,
    RequestedPoints,
    RunOutcomes,
)
from uqpen.distributions.joint_distribution import JointDistribution

# Mixture of normal distributions that the runs of importance sampling are drawn from.

# Numbers of the first components of every mixture: the distribution of the inputs, and the same
# inflated. Those that are fitted follow.
NOMINAL, INFLATED = 0, 1


@dataclass(frozen=True, eq=False)
class GaussianComponent:
    """Normal distribution in standard normal space."""

    mean: FloatArray  # (random input,): its mean
    covariance: FloatArray  # (random input, random input): positive definite


def inflation(dimension: int) -> float:
    """Return the standard deviation of the inflated component.

    The squared radius of its draws reaches far beyond that of the inputs, while the ratio of the
    densities stays bounded. In many dimensions only a small inflation leaves that bound useful.
    """
    return 1 + 1.2 / math.sqrt(dimension / 2)


def log_normal_density(points: FloatArray) -> FloatArray:
    """Return the logarithm of the standard normal density, shape (run,)."""
    dimension = points.shape[1]
    squared: FloatArray = (points**2).sum(axis=1)
    return -0.5 * (squared + dimension * math.log(2 * math.pi))


@dataclass(frozen=True, eq=False)
class GaussianMixture:
    """Normal distributions with the number of draws of each.

    The numbers are fixed and not drawn, which makes an estimate narrower and leaves it unbiased.
    """

    components: tuple[GaussianComponent, ...]  # at least one
    counts: IntArray  # (component,): number of draws of each

    @classmethod
    def of_shares(
        cls, components: tuple[GaussianComponent, ...], shares: FloatArray, number: int
    ) -> GaussianMixture:
        """Return a mixture for a number of draws, given the share of each component.

        Numbers are rounded so that their sum is right: the largest remainders are rounded up.
        """
        exact = number * shares / shares.sum()
        counts = np.floor(exact).astype(np.int64)
        last = np.argsort(counts - exact, kind="stable")[: number - counts.sum()]
        counts[last] += 1
        return cls(components, counts)

    @property
    def number(self) -> int:
        """Number of draws."""
        return int(self.counts.sum())

    @property
    def component(self) -> IntArray:
        """Number of the component of each draw, shape (draw,)."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @one_blas_thread()
    def draw(self, rng: np.random.Generator) -> FloatArray:
        """Return draws in the order of the components, shape (draw, random input)."""
        dimension = len(self.components[0].mean)
        normal = rng.standard_normal((self.number, dimension))
        parts = np.split(normal, np.cumsum(self.counts)[:-1])
        return np.concatenate(
            [
                each.mean + part @ np.linalg.cholesky(each.covariance).T
                for each, part in zip(self.components, parts, strict=True)
            ]
        )

    @one_blas_thread()
    def log_density(self, points: FloatArray) -> FloatArray:
        """Return the logarithm of the density of the mixture, shape (run,)."""
        used = [k for k, count in enumerate(self.counts) if count]
        logarithms = np.empty((len(used), len(points)))
        for row, k in enumerate(used):
            factor = np.linalg.cholesky(self.components[k].covariance)
            standard = np.linalg.solve(factor, (points - self.components[k].mean).T).T
            logarithms[row] = log_normal_density(standard) - np.log(np.diag(factor)).sum()
        shares = self.counts[used] / self.number
        total: FloatArray = logsumexp(logarithms, axis=0, b=shares[:, np.newaxis])
        return total


# Normal distributions fitted to the parts of an event that weighted draws have met.

# Most parts of an event that are told apart.
_MOST = 8

# Draws of one standard normal distribution are about the square root of 2 d apart.
_SEPARATION = 1.3

# Draws whose square of the radius is larger than that of the nearest by this have a density lower
# by a factor of e**-8: no part of the event begins there that matters.
_BEYOND = 16.0

# Iterations that assign draws to the nearest mean; few suffice from separated starts.
_FIT_ITERATIONS = 3

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
    for _ in range(_FIT_ITERATIONS):
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


# Stages of importance sampling: each draws from a mixture fitted to all draws before.

# Shares of the nominal and of the inflated component. The inflated one looks for parts of the event
# that the others miss. The nominal one measures what is common: failed runs, inadmissible draws.
_FIRST_SHARES = 0.1, 0.4
_LATER_SHARES = 0.1, 0.1

# Share of the fitted components that go where runs fail, and the number of effective draws in the
# event that are enough for a fit, for one input and each further one.
_FAILED_SHARE = 0.2
_ENOUGH, _ENOUGH_EACH = 30, 4

# Where too few draws show the event, the nearest tenth of them lead on. Where more are as near as
# that, as by an output with few values, none of them says where the event lies.
_NEAREST, _USELESS = 0.1, 0.5


@dataclass(frozen=True, eq=False)
class ImportanceStages:
    """Draws of all stages so far, and the mixtures that follow from them."""

    event: LimitState  # the event
    # (point, random input): design points that are known before any draw; may be none.
    centres: FloatArray
    _points: list[FloatArray] = field(default_factory=list)
    _mixtures: list[GaussianMixture] = field(default_factory=list)
    _outcomes: list[EventOutcomes] = field(default_factory=list)

    def add(self, mixture: GaussianMixture, points: FloatArray, outcomes: EventOutcomes) -> None:
        """Add the draws of a stage."""
        self._points.append(points)
        self._mixtures.append(mixture)
        self._outcomes.append(outcomes)

    def first(self, number: int) -> GaussianMixture:
        """Return the mixture of the first stage, around the design points."""
        dimension = self.centres.shape[1]
        around = tuple(GaussianComponent(each, np.eye(dimension)) for each in self.centres)
        density = np.exp(-0.5 * ((self.centres**2).sum(axis=1)))
        shares = np.maximum(density / density.max(initial=1e-300), 0.3) if around else density
        return self._mixture(around, shares, _FIRST_SHARES, number)

    def following(self, number: int) -> GaussianMixture:
        """Return a mixture that is fitted to the draws so far."""
        points, weights = np.concatenate(self._points), self._weights()
        occurs, missing = self._joined("occurs"), self._joined("missing")
        scales = self.event.scales(self._outcomes[0])
        performance = np.concatenate(
            [self.event.performance(each, scales) for each in self._outcomes]
        )
        leading = self._leading(performance, occurs, missing, weights)
        if not leading.any():
            return self.first(number)
        components, shares = fitted_components(points[leading], weights[leading], self.centres)
        if missing.any():
            none = np.empty((0, points.shape[1]))
            failed, parts = fitted_components(points[missing], weights[missing], none)
            components += failed
            shares = np.concatenate(
                [(1 - _FAILED_SHARE) * shares / shares.sum(), _FAILED_SHARE * parts / parts.sum()]
            )
        nominal, inflated = _LATER_SHARES
        is_common = missing.any() or not self._joined("belongs").all()
        return self._mixture(components, shares, (nominal * is_common, inflated), number)

    @property
    def are_enough(self) -> bool:
        """True if enough draws show the event for a fit to it."""
        dimension = self.centres.shape[1]
        size = effective_size(self._weights()[self._joined("occurs")])
        return size >= _ENOUGH + _ENOUGH_EACH * (dimension - 1)

    def _leading(
        self, performance: FloatArray, occurs: BoolArray, missing: BoolArray, weights: FloatArray
    ) -> BoolArray:
        """Return the draws to fit to: those with the event, or the nearest to it; may be none."""
        # An outcome that is the event lies in it, and one that is not is nowhere near.
        known = (performance > -np.inf) & ~missing
        if effective_size(weights[occurs]) >= _ENOUGH / 3 or not known.any():
            return occurs
        last = np.zeros(len(performance), dtype=np.bool_)
        last[-self._mixtures[-1].number :] = True
        among = known & last if (known & last).any() else known
        finite = np.minimum(performance[among], sys.float_info.max)
        threshold = min(0.0, float(np.quantile(finite, 1 - _NEAREST)))
        nearest = known & (performance >= threshold)
        return nearest if nearest.sum() <= _USELESS * known.sum() else occurs

    def _weights(self) -> FloatArray:
        """Return the ratio of the inputs' density to that of all stages together."""
        points = np.concatenate(self._points)
        numbers = np.array([each.number for each in self._mixtures], dtype=np.float64)
        densities = np.array([each.log_density(points) for each in self._mixtures])
        together = logsumexp(densities, axis=0, b=(numbers / numbers.sum())[:, np.newaxis])
        ratio: FloatArray = np.exp(log_normal_density(points) - together)
        return ratio

    def _joined(self, name: str) -> BoolArray:
        return np.concatenate([getattr(each, name) for each in self._outcomes])

    def _mixture(
        self,
        fitted: tuple[GaussianComponent, ...],
        shares: FloatArray,
        general: tuple[float, float],
        number: int,
    ) -> GaussianMixture:
        """Return the two general components, and the fitted ones behind them, if there are any."""
        dimension = self.centres.shape[1]
        centre, identity = np.zeros(dimension), np.eye(dimension)
        components = (
            GaussianComponent(centre, identity),
            GaussianComponent(centre, inflation(dimension) ** 2 * identity),
            *fitted,
        )
        rest = (1 - sum(general)) * shares / shares.sum() if fitted else shares
        return GaussianMixture.of_shares(components, np.array([*general, *rest]), number)


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
