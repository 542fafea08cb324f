"""Subset simulation: a rare event as a chain of events that are not rare."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.errors import Problem
from uqpen.core.labels import CHAIN_PARENT, LEVEL_THRESHOLD, SUBSET_LEVEL
from uqpen.core.limits import MOST_REPLICATES
from uqpen.core.settings import count
from uqpen.core.streams import Stream
from uqpen.designs.rare_events.chain_states import STEPS, ChainStates
from uqpen.designs.rare_events.conditional_sampling import ConditionalSampling
from uqpen.designs.rare_events.limit_state import LimitState
from uqpen.designs.rare_events.rare_event_design import RareEventDesign
from uqpen.designs.rare_events.replicates import Replicate, RequestedPoints
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["SubsetSimulation"]


@dataclass(frozen=True)
class SubsetSimulation(RareEventDesign):
    """Subset simulation by conditional sampling, in independent replicates.

    Independent draws give the nearest tenth of all cases. Markov chains from there stay within it
    and give the nearest tenth of those, and so on until a tenth of the cases show the event.

    Parameters
    ----------
    event : str
        The event: ``"depth > 3 m"``, or limits joined by ``and``, or by ``or``.
    samples : int
        Number of states at each level of a replicate, a multiple of 10.
    replicates : int
        Number of independent repetitions of the whole method. Their scatter gives the interval. At
        most 10 000.
    levels : int
        Largest number of levels of a replicate: ten reach a probability of 1e-10.

    References
    ----------
    Au, S. K. & Beck, J. L. (2001). Probabilistic Engineering Mechanics 16, 263-277;
    Papaioannou, I. et al. (2015). Probabilistic Engineering Mechanics 41, 89-103.
    """

    samples: int = count(minimum=100, default=1000)
    replicates: int = count(minimum=3, maximum=MOST_REPLICATES, default=5)
    levels: int = count(default=10, maximum=15)

    def check_settings(self) -> Iterator[Problem]:
        if self.samples % (STEPS + 1):
            yield Problem(("samples",), str(self.samples), f"a multiple of {STEPS + 1}")

    @property
    def replicate_count(self) -> int:
        return self.replicates

    @property
    def ends_early(self) -> bool:
        return True

    def run_count(self, joint: JointDistribution) -> int:
        further = (self.levels - 1) * self._chains * STEPS
        return self.replicates * (self.samples + further)

    def replicate(self, joint: JointDistribution, event: LimitState, stream: Stream) -> Replicate:
        dimension = len(joint.random)
        points = stream.generator("level", 0).standard_normal((self.samples, dimension))
        threshold = -math.inf
        made = yield _request(points, 0, np.full(self.samples, -1), threshold)
        scales = event.scales(made.outcomes)
        drawn = ChainStates.of(made.runs, made.outcomes, event, scales)
        states, points = drawn.at(made.outcomes.belongs), points[made.outcomes.belongs]
        sampling = ConditionalSampling()
        for level in range(1, self.levels):
            if not len(points) or states.is_last:
                return
            higher = states.next_threshold(threshold)
            if higher is None:
                return
            threshold = higher
            rng = stream.generator("level", level)
            seeds = _choose(np.flatnonzero(states.at_or_above(threshold)), self._chains, rng)
            chain, at = states.at(seeds), points[seeds]
            visited, places, accepted_moves = [chain], [at], 0
            for _ in range(STEPS):
                candidates = sampling.candidates(at, rng)
                made = yield _request(candidates, level, chain.runs, threshold)
                new = ChainStates.of(made.runs, made.outcomes, event, scales)
                accepted = new.at_or_above(threshold)
                chain = chain.moved(new, threshold)
                at = np.where(accepted[:, np.newaxis], candidates, at)
                accepted_moves += int(accepted.sum())
                visited.append(chain)
                places.append(at)
            sampling = sampling.following(accepted_moves / (STEPS * self._chains))
            states, points = ChainStates.joined(visited), np.concatenate(places)

    @property
    def _chains(self) -> int:
        return self.samples // (STEPS + 1)


def _request(
    points: FloatArray, level: int, parents: IntArray, threshold: float
) -> RequestedPoints:
    """Return points with what the analysis needs: level, threshold, and the state moved from."""
    size = len(points)
    return RequestedPoints(
        points,
        {
            SUBSET_LEVEL: np.full(size, level),
            CHAIN_PARENT: parents,
            LEVEL_THRESHOLD: np.full(size, threshold),
        },
    )


def _choose(candidates: IntArray, number: int, rng: np.random.Generator) -> IntArray:
    """Return as many seeds as there are chains; each state as often as others, or once more."""
    repeats = -(-number // len(candidates))
    shuffled = [rng.permutation(candidates) for _ in range(repeats)]
    return np.concatenate(shuffled)[:number]
