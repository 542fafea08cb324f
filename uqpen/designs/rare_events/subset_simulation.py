"""Subset simulation: a rare event as a chain of events that are not rare."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.errors import Problem, toml_text
from uqpen.core.labels import CHAIN_PARENT, LEVEL_THRESHOLD, SUBSET_LEVEL
from uqpen.core.limits import MOST_REPLICATES
from uqpen.core.settings import count
from uqpen.core.streams import Stream
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState, parse_limit_state
from uqpen.designs.rare_events.rare_event_design import RareEventDesign, Replicate, RequestedPoints
from uqpen.designs.stopping.stopping_rule import RequestedOutput
from uqpen.distributions.joint_distribution import JointDistribution

# States of the Markov chains of subset simulation, and the levels that they have reached.

CONDITIONAL_PROBABILITY = 0.1
"""Probability of a level given the one before. Zuev et al. (2012) find 0.1 to 0.3 near the best."""

STEPS = round(1 / CONDITIONAL_PROBABILITY) - 1
"""Steps of a chain: with its seed, the chains of a level are as many states as the one before."""

# The event occurs above 0; this is the lowest number there.
_EVENT = math.ulp(0.0)


class ChainStates(NamedTuple):
    """States at one level: a sample of the inputs, given that a run reaches the level."""

    runs: IntArray  # (state,): number of the run that each state is
    # (state,): how near it comes to the event; infinite for a failed run, and for an outcome that
    # is the event.
    performance: FloatArray
    occurs: BoolArray  # (state,): whether the event occurs
    missing: BoolArray  # (state,): whether that is unknown

    @classmethod
    def of(
        cls, runs: IntArray, outcomes: EventOutcomes, event: LimitState, scales: FloatArray
    ) -> ChainStates:
        """Return runs as states."""
        performance = event.performance(outcomes, scales)
        return cls(runs, performance, outcomes.occurs, outcomes.missing)

    def at(self, part: Any) -> ChainStates:
        """Return some of the states, given by an index."""
        return ChainStates(*(each[part] for each in self))

    def moved(self, candidates: ChainStates, threshold: float) -> ChainStates:
        """Return the states after a step: candidates where they reach the level."""
        is_accepted = candidates.at_or_above(threshold)
        both = zip(candidates, self, strict=True)
        return ChainStates(*(np.where(is_accepted, new, old) for new, old in both))

    @staticmethod
    def joined(parts: list[ChainStates]) -> ChainStates:
        """Return the states of several steps as one sample."""
        return ChainStates(*map(np.concatenate, zip(*parts, strict=True)))

    def at_or_above(self, threshold: float) -> BoolArray:
        """Return which states reach a level."""
        return self.performance >= threshold

    @property
    def is_last(self) -> bool:
        """True if the event is no longer rare here, with every failed run counted as an event."""
        return bool((self.occurs | self.missing).mean() >= CONDITIONAL_PROBABILITY)

    def next_threshold(self, threshold: float) -> float | None:
        """Return the threshold that a tenth of the states reach; None if it is no higher.

        It lies directly above the largest of the other states: at the smallest of the tenth, the
        probability of the level would be too large by one part in the number of its seeds (a beta
        distribution). States that are equal to that one do not reach it either, or the threshold
        would depend on what lies above it. Only where none would be left, as of an output with few
        values, more than a tenth reach it. It is never higher than that of all states with the
        event.
        """
        number = max(1, round(len(self.runs) * CONDITIONAL_PROBABILITY))
        place = min(number + 1, len(self.runs))
        excluded = float(np.partition(self.performance, -place)[-place])
        if excluded == self.performance.max():
            below = self.performance[self.performance < excluded]
            excluded = float(below.max()) if len(below) else excluded
        higher = min(math.nextafter(excluded, math.inf), _EVENT)
        return higher if higher > threshold and self.at_or_above(higher).any() else None


# Conditional sampling: moves of Markov chains in standard normal space.

# Share of moves to accept. The variance of an estimate hardly depends on it from 0.4 to 0.5.
_TARGET = 0.5

# Limits of the standard deviation, and of the factor by which it changes between levels.
_SMALLEST, _LARGEST = 1e-3, 1.0
_SMALLEST_FACTOR = 0.05


@dataclass(frozen=True)
class ConditionalSampling:
    """Moves ``sqrt(1 - sigma²) u + sigma z`` with standard normal z.

    They keep the normal distribution. A move is accepted where it stays in the level, so no density
    is needed. All inputs have the same sigma, and a level keeps it: a scale that followed the
    states that it moves would not keep their distribution.
    """

    sigma: float = 0.6  # standard deviation of a move

    def candidates(self, states: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return a candidate for each state, shape (chain, random input)."""
        moved: FloatArray = rng.standard_normal(states.shape)
        moved *= self.sigma
        moved += math.sqrt(1 - self.sigma**2) * states
        return moved

    def following(self, accepted: float) -> ConditionalSampling:
        """Return the moves of the next level, given the share that was accepted at this one."""
        factor = max(accepted / _TARGET, _SMALLEST_FACTOR)
        return ConditionalSampling(min(max(factor * self.sigma, _SMALLEST), _LARGEST))


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

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        problems = list(super().check_outputs(requested))
        yield from problems
        if not problems and not parse_limit_state(self.event).of_numbers:
            expected = "a limit of a number beside it, or importance-sampling: no run comes nearer"
            yield Problem(("event",), toml_text(self.event), expected)

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
            # Each state that reaches the level is a seed as often as others, or once more.
            reached = np.flatnonzero(states.at_or_above(threshold))
            shuffled = [rng.permutation(reached) for _ in range(-(-self._chains // len(reached)))]
            seeds = np.concatenate(shuffled)[: self._chains]
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
