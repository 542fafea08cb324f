"""Probability of a rare event from a replicate of subset simulation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.arrays import IntArray
from uqpen.core.labels import CHAIN_PARENT, LEVEL_THRESHOLD, RUN, SUBSET_LEVEL
from uqpen.designs.rare_events.chain_states import STEPS, ChainStates
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState
from uqpen.statistics.rare_events.replicate_probability import ReplicateProbability

__all__ = ["Level", "last_level", "subset_levels", "subset_probability"]


def subset_probability(
    runs: xr.Dataset, outcomes: EventOutcomes, event: LimitState, members: IntArray
) -> ReplicateProbability | None:
    """Return the product of the conditional probabilities of all levels.

    A failed run counts as nearest to the event, so all of them are among the states of the last
    level, and their probability follows as that of the event does.

    Parameters
    ----------
    runs : Dataset
        All runs of the design.
    outcomes : EventOutcomes
        Of all runs.
    event : LimitState
        The event.
    members : ndarray of int, shape (run,)
        Positions of the runs of one replicate.

    Returns
    -------
    ReplicateProbability or None
        None where no draw counts.
    """
    last = last_level(runs, outcomes, event, members)
    if last is None:
        return None
    return ReplicateProbability(
        last.probability * float(last.states.occurs.mean()),
        last.probability * float(last.states.missing.mean()),
    )


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


def last_level(
    runs: xr.Dataset, outcomes: EventOutcomes, event: LimitState, members: IntArray
) -> Level | None:
    """Return the last level of a replicate; None where no draw counts."""
    return next(iter(reversed(subset_levels(runs, outcomes, event, members))), None)


def subset_levels(
    runs: xr.Dataset, outcomes: EventOutcomes, event: LimitState, members: IntArray
) -> list[Level]:
    """Return the levels of a replicate, the independent draws first; none where no draw counts.

    Parameters are those of `subset_probability`.
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
