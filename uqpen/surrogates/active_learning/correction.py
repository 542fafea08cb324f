"""Runs that correct a surrogate of a limit state: weighted draws around and far from its limit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.streams import Stream
from uqpen.core.threads import one_blas_thread
from uqpen.designs.rare_events.gaussian_mixture import inflation
from uqpen.surrogates.active_learning.limit_state_surrogate import LimitStateSurrogate
from uqpen.surrogates.active_learning.normal_mixture import NormalMixture
from uqpen.surrogates.active_learning.surrogate_states import SurrogateStates

__all__ = ["CorrectionPoints", "draw_correction"]

# Draws from the importance density, at which the surrogate alone is evaluated.
_DRAWS = 50_000
# Share of the inflated normal distribution in that density.
_INFLATED = 0.2
# Number of points that a density is fitted to, at least.
_LEAST_STATES = 20
# Times that it is fitted again, and draws that each takes.
_REFITS, _FITTED = 2, 5000


@dataclass(frozen=True, eq=False)
class CorrectionPoints:
    """Points of runs that correct a surrogate, with what it predicts there.

    Parameters
    ----------
    points : ndarray, shape (run, random input)
        In standard normal space.
    weights : ndarray, shape (run,)
        Density of the inputs, over that of all these runs together: a sum of them over the runs
        that are in a set estimates its probability without bias.
    search_weights : ndarray, shape (run,)
        The same by the draws alone which look for what the surrogate does not know.
    occurs : ndarray of bool, shape (run,)
        Where the surrogate predicts the event.
    error_probability : ndarray, shape (run,)
        That of the other outcome, by the surrogate.
    probability, error : float
        Probability of the event by the surrogate alone, and the standard error of its sampling.
    """

    points: FloatArray
    weights: FloatArray
    search_weights: FloatArray
    occurs: BoolArray
    error_probability: FloatArray
    probability: float
    error: float


@one_blas_thread()
def draw_correction(
    surrogate: LimitStateSurrogate | None,
    states: SurrogateStates | None,
    size: int,
    dimension: int,
    stream: Stream,
) -> CorrectionPoints:
    """Draw the points of the runs that correct a surrogate.

    A third are draws from where it predicts the event. A third are draws in proportion to the root
    of the probability that it errs: so the variance of the correction is the least if those
    probabilities are right. A third look for what it does not know, half of them by the inputs' own
    distribution and half by an inflated one. Each run is weighted by all three densities together.

    Parameters
    ----------
    surrogate : LimitStateSurrogate or None
        None where nothing could be fitted: all runs are of the last kind.
    states : SurrogateStates or None
        On the way to its event.
    size : int
        Number of runs.
    dimension : int
        Number of random inputs.
    stream : Stream

    References
    ----------
    Veach, E. & Guibas, L. J. (1995). SIGGRAPH '95, 419-428 (the weights).
    """
    inflated = NormalMixture.of_scales([1.0], [inflation(dimension)], dimension)
    nominal = NormalMixture.of_scales([1.0], [1.0], dimension)
    if surrogate is None or states is None:
        rng = stream.generator("far")
        points = _draw_far(nominal, inflated, size, rng)
        weights = 1 / (size * _far_ratio(points, nominal, inflated))
        nothing = np.zeros(size, dtype=np.bool_)
        return CorrectionPoints(
            points, weights, weights, nothing, np.full(size, np.nan), math.nan, math.nan
        )
    density = _importance_density(surrogate, states, inflated, nominal, stream)
    drawn = density.draw(_DRAWS, stream.generator("draws"))
    ratio = np.exp(nominal.log_density(drawn) - density.log_density(drawn))
    predicted = surrogate.predict(drawn)
    in_event = ratio * predicted.occurs
    doubtful = ratio * np.sqrt(predicted.error_probability)
    counts = _counts(size, has_event=bool(in_event.any()), has_doubt=bool(doubtful.any()))
    chosen = np.concatenate(
        [
            _chosen(in_event, counts[0], stream.generator("event")),
            _chosen(doubtful, counts[1], stream.generator("doubtful")),
        ]
    )
    far = _draw_far(nominal, inflated, counts[2], stream.generator("far"))
    points = np.concatenate([drawn[chosen], far])
    at = surrogate.predict(points)
    by_search = counts[2] * _far_ratio(points, nominal, inflated)
    total = by_search.copy()
    if counts[0]:
        total += counts[0] * at.occurs / in_event.mean()
    if counts[1]:
        total += counts[1] * np.sqrt(at.error_probability) / doubtful.mean()
    return CorrectionPoints(
        points=points,
        weights=1 / total,
        search_weights=1 / by_search,
        occurs=at.occurs,
        error_probability=at.error_probability,
        probability=float(in_event.mean()),
        error=float(in_event.std(ddof=1) / math.sqrt(_DRAWS)),
    )


def _importance_density(
    surrogate: LimitStateSurrogate,
    states: SurrogateStates,
    inflated: NormalMixture,
    nominal: NormalMixture,
    stream: Stream,
) -> NormalMixture:
    """Return a density that is high where the event is predicted or doubtful.

    It is fitted to the states, and then to weighted draws of that, which are independent.
    """
    points, weights = states.points, states.weights
    density = inflated
    for stage in range(1 + _REFITS):
        if stage:
            points = density.draw(_FITTED, stream.generator("fitted", stage))
            weights = np.exp(nominal.log_density(points) - density.log_density(points))
        predicted = surrogate.predict(points)
        wanted = weights * np.maximum(predicted.occurs, np.sqrt(predicted.error_probability))
        used = wanted > 0
        if used.sum() < _LEAST_STATES:
            break
        rng = stream.generator("mixture", stage)
        fitted = NormalMixture.fit(points[used], wanted[used] / wanted[used].max(), rng)
        density = NormalMixture.joined([fitted, inflated], [1 - _INFLATED, _INFLATED])
    return density


def _counts(size: int, *, has_event: bool, has_doubt: bool) -> tuple[int, int, int]:
    third = size // 3
    event, doubtful = third * has_event, third * has_doubt
    return event, doubtful, size - event - doubtful


def _chosen(weights: FloatArray, count: int, rng: np.random.Generator) -> IntArray:
    """Return draws in proportion to weights."""
    if not count:
        return np.empty(0, dtype=np.int64)
    return rng.choice(len(weights), size=count, p=weights / weights.sum())


def _draw_far(
    nominal: NormalMixture, inflated: NormalMixture, count: int, rng: np.random.Generator
) -> FloatArray:
    plain = count // 2
    return np.concatenate([nominal.draw(plain, rng), inflated.draw(count - plain, rng)])


def _far_ratio(points: FloatArray, nominal: NormalMixture, inflated: NormalMixture) -> FloatArray:
    """Return the density of far draws over that of the inputs."""
    ratio: FloatArray = np.exp(inflated.log_density(points) - nominal.log_density(points))
    return 0.5 + 0.5 * ratio
