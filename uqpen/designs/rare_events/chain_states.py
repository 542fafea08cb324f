"""States of the Markov chains of subset simulation, and the levels that they have reached."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState

__all__ = ["CONDITIONAL_PROBABILITY", "STEPS", "ChainStates"]

CONDITIONAL_PROBABILITY = 0.1
"""Probability of a level given the one before. Zuev et al. (2012) find 0.1 to 0.3 near the best."""

STEPS = round(1 / CONDITIONAL_PROBABILITY) - 1
"""Steps of a chain: with its seed, the chains of a level are as many states as the one before."""

# The event occurs above 0; this is the lowest number there.
_EVENT = math.ulp(0.0)


@dataclass(frozen=True, eq=False)
class ChainStates:
    """States at one level: a sample of the inputs, given that a run reaches the level.

    Parameters
    ----------
    runs : ndarray of int, shape (state,)
        Number of the run that each state is.
    performance : ndarray, shape (state,)
        How near it comes to the event; infinite for a failed run.
    occurs, missing : ndarray of bool, shape (state,)
        Whether the event occurs, and whether that is unknown.
    """

    runs: IntArray
    performance: FloatArray
    occurs: BoolArray
    missing: BoolArray

    @classmethod
    def of(
        cls, runs: IntArray, outcomes: EventOutcomes, event: LimitState, scales: FloatArray
    ) -> ChainStates:
        """Return runs as states."""
        performance = event.performance(outcomes, scales)
        return cls(runs, performance, outcomes.occurs, outcomes.missing)

    def at(self, part: Any) -> ChainStates:
        """Return some of the states, given by an index."""
        return ChainStates(
            self.runs[part], self.performance[part], self.occurs[part], self.missing[part]
        )

    def moved(self, candidates: ChainStates, threshold: float) -> ChainStates:
        """Return the states after a step: candidates where they reach the level."""
        is_accepted = candidates.at_or_above(threshold)
        return ChainStates(
            *(
                np.where(is_accepted, new, old)
                for new, old in (
                    (candidates.runs, self.runs),
                    (candidates.performance, self.performance),
                    (candidates.occurs, self.occurs),
                    (candidates.missing, self.missing),
                )
            )
        )

    @staticmethod
    def joined(parts: list[ChainStates]) -> ChainStates:
        """Return the states of several steps as one sample."""
        return ChainStates(
            np.concatenate([each.runs for each in parts]),
            np.concatenate([each.performance for each in parts]),
            np.concatenate([each.occurs for each in parts]),
            np.concatenate([each.missing for each in parts]),
        )

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
