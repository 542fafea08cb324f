"""States on the way to the event, by subset simulation of a surrogate of the limit state."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.designs.rare_events.conditional_sampling import ConditionalSampling
from uqpen.surrogates.active_learning.limit_state_surrogate import LimitStateSurrogate

__all__ = ["SurrogateStates", "surrogate_states"]

# States at each level, chains of each, and the largest number of levels: 1e-12 is as small as
# standard normal distributions have room for beyond the runs.
_STATES, _CHAINS, _LEVELS = 1000, 100, 12


@dataclass(frozen=True, eq=False)
class SurrogateStates:
    """States of all levels.

    Parameters
    ----------
    points : ndarray, shape (state, input)
        In standard normal space.
    weights : ndarray, shape (state,)
        Probability that each stands for; that of the states before the last level without those
        that have reached the next one.
    """

    points: FloatArray
    weights: FloatArray


def surrogate_states(
    surrogate: LimitStateSurrogate, dimension: int, rng: np.random.Generator
) -> SurrogateStates:
    """Move states towards the event of a surrogate, until it is no longer rare among them."""
    points = rng.standard_normal((_STATES, dimension))
    performance = surrogate.predict_performance(points)
    sampling = ConditionalSampling()
    probability, visited, weights = 1.0, [], []
    for level in range(_LEVELS):
        excluded = performance < np.partition(performance, -_CHAINS)[-_CHAINS]
        threshold = min(float(performance.max(where=excluded, initial=-math.inf)), 0.0)
        reached = performance > threshold
        is_last = threshold == 0 or level == _LEVELS - 1 or not excluded.any()
        visited.append(points)
        weights.append(np.where(reached & (not is_last), 0.0, probability / _STATES))
        if is_last:
            break
        probability *= float(reached.mean())
        seeds = rng.permutation(np.flatnonzero(reached))[:_CHAINS]
        points, performance, accepted = _chains(
            surrogate, points[seeds], performance[seeds], threshold, sampling, rng
        )
        sampling = sampling.following(accepted)
    return SurrogateStates(np.concatenate(visited), np.concatenate(weights))


def _chains(
    surrogate: LimitStateSurrogate,
    at: FloatArray,
    performance: FloatArray,
    threshold: float,
    sampling: ConditionalSampling,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray, float]:
    """Return states of chains above a threshold, their performance, and the share of moves."""
    points, found, shares = [at], [performance], []
    for _ in range(math.ceil(_STATES / _CHAINS) - 1):
        candidates = sampling.candidates(at, rng)
        new = surrogate.predict_performance(candidates)
        accepted = new > threshold
        at = np.where(accepted[:, np.newaxis], candidates, at)
        performance = np.where(accepted, new, performance)
        shares.append(float(accepted.mean()))
        points.append(at)
        found.append(performance)
    return np.concatenate(points), np.concatenate(found), float(np.mean(shares))
