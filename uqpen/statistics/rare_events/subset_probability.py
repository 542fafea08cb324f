"""Probability of a rare event from a replicate of subset simulation."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqpen.core.arrays import IntArray
from uqpen.core.labels import CHAIN_PARENT, LEVEL_THRESHOLD, RUN, SUBSET_LEVEL
from uqpen.designs.rare_events.chain_states import STEPS, ChainStates
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState
from uqpen.statistics.rare_events.replicate_probability import ReplicateProbability

__all__ = ["subset_probability"]


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
    levels = runs[SUBSET_LEVEL].values[members]
    drawn = members[levels == 0]
    everything = ChainStates.of(
        np.arange(runs.sizes[RUN]), outcomes, event, event.scales(outcomes.of(drawn))
    )
    states = everything.at(drawn[outcomes.belongs[drawn]])
    if not len(states.runs):
        return None
    probability = 1.0
    for level in range(1, int(levels.max()) + 1):
        made = members[levels == level]
        threshold = float(runs[LEVEL_THRESHOLD].values[made[0]])
        probability *= float(states.at_or_above(threshold).mean())
        seeds = runs[CHAIN_PARENT].values[made].reshape(STEPS, -1)[0]
        states = _visited(everything, seeds, made.reshape(STEPS, -1), threshold)
    return ReplicateProbability(
        probability * float(states.occurs.mean()), probability * float(states.missing.mean())
    )


def _visited(
    everything: ChainStates, seeds: IntArray, candidates: IntArray, threshold: float
) -> ChainStates:
    """Return all states of the chains of a level, given the candidates of each step."""
    visited = [everything.at(seeds)]
    for step in candidates:
        visited.append(visited[-1].moved(everything.at(step), threshold))
    return ChainStates.joined(visited)
