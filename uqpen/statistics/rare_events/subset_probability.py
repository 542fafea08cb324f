"""Probability of a rare event from replicates of subset simulation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.arrays import IntArray
from uqpen.core.labels import CHAIN_PARENT, LEVEL_THRESHOLD, REPLICATE, RUN, SUBSET_LEVEL
from uqpen.designs.rare_events.chain_states import STEPS, ChainStates
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.rare_events.rare_event_probability import RareEventProbability
from uqpen.statistics.rare_events.replicate_interval import replicate_interval
from uqpen.statistics.rare_events.replicate_probability import ReplicateProbability

__all__ = ["Level", "subset_levels", "subset_probability"]


def subset_probability(runs: xr.Dataset, event: LimitState, level: float) -> RareEventProbability:
    """Estimate the probability of an event: of a replicate, the product over all levels.

    A failed run counts as nearest to the event, so all of them are among the states of the last
    level, and their probability follows as that of the event does.

    Parameters
    ----------
    runs : Dataset
        All runs of the design.
    event : LimitState
        The event.
    level : float
        Confidence level of the interval.
    """
    outcomes, replicate = event.outcomes(runs), runs[REPLICATE].values
    found = []
    for number in np.unique(replicate):
        members = np.flatnonzero(replicate == number)
        if not (levels := subset_levels(runs, outcomes, event, members)):
            nothing = Estimate.without_bounds(math.nan, texts.NO_ADMISSIBLE_REPLICATE)
            return RareEventProbability(nothing)
        probability, states = levels[-1].probability, levels[-1].states
        found.append(
            ReplicateProbability(
                probability * float(states.occurs.mean()),
                probability * float(states.missing.mean()),
            )
        )
    plain = 3 / runs.sizes[RUN]  # the rule of three
    unmet = texts.UNMET_PART.format(probability=plain)
    estimate = replicate_interval(found, level)
    return RareEventProbability(estimate.with_note(estimate.note, unmet))


class Level(NamedTuple):
    """Level of a replicate: a sample of the inputs, given that a run reaches the level.

    Parameters
    ----------
    probability : float
        Probability of reaching it.
    threshold : float
        The performance that reaches it; minus infinity for independent draws.
    states : ChainStates
        The states of its chains.
    """

    probability: float
    threshold: float
    states: ChainStates


def subset_levels(
    runs: xr.Dataset, outcomes: EventOutcomes, event: LimitState, members: IntArray
) -> list[Level]:
    """Return the levels of a replicate, the independent draws first; none where no draw counts.

    Parameters
    ----------
    runs : Dataset
        All runs of the design.
    outcomes : EventOutcomes
        Of all runs.
    event : LimitState
        The event.
    members : ndarray of int, shape (run,)
        Positions of the runs of the replicate.
    """
    levels = runs[SUBSET_LEVEL].values[members]
    drawn = members[levels == 0]
    everything = ChainStates.of(
        np.arange(runs.sizes[RUN]), outcomes, event, event.scales(outcomes.of(drawn))
    )
    states = everything.at(drawn[outcomes.belongs[drawn]])
    if not len(states.runs):
        return []
    found = [Level(1.0, -math.inf, states)]
    for level in range(1, int(levels.max()) + 1):
        made = members[levels == level]
        threshold = float(runs[LEVEL_THRESHOLD].values[made[0]])
        probability = found[-1].probability * float(states.at_or_above(threshold).mean())
        seeds = runs[CHAIN_PARENT].values[made].reshape(STEPS, -1)[0]
        states = _visited(everything, seeds, made.reshape(STEPS, -1), threshold)
        found.append(Level(probability, threshold, states))
    return found


def _visited(
    everything: ChainStates, seeds: IntArray, candidates: IntArray, threshold: float
) -> ChainStates:
    """Return all states of the chains of a level, given the candidates of each step."""
    visited = [everything.at(seeds)]
    for step in candidates:
        visited.append(visited[-1].moved(everything.at(step), threshold))
    return ChainStates.joined(visited)
