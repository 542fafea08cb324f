"""Probability of a rare event from replicates of importance sampling."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.special import chdtri

from uqpen.core.arrays import IntArray
from uqpen.core.labels import (
    DENSITY_RATIO,
    MIXTURE_COMPONENT,
    NORMAL_DISTANCE,
    REPLICATE,
    ROLE,
    RUN,
    SAMPLING_STAGE,
)
from uqpen.designs.rare_events.importance_sampling import INFLATED, effective_size, inflation
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.rare_events.rare_event_probability import (
    RareEventProbability,
    ReplicateProbability,
    replicate_interval,
)

# Fewer effective draws in a replicate hardly say how much it scatters.
_FEW_EFFECTIVE = 10

# With as few runs in a replicate as the second number, intervals cover less often than they say.
_ENOUGH_RUNS, _FEW_RUNS = 1000, 400

# Replicates whose estimates differ with less than this probability differ by more than chance.
_SIGNIFICANT = 0.001


class _Replicate(NamedTuple):
    """Estimate of one replicate, with what its weights say of it."""

    probability: ReplicateProbability  # the estimate
    standard_error: float  # of the probability of the event, by the weights of the draws
    effective_size: float  # effective number of draws with the event


def importance_probability(
    runs: xr.Dataset, event: LimitState, level: float
) -> RareEventProbability:
    """Estimate the probability of an event from all replicates."""
    outcomes, replicate = event.outcomes(runs), runs[REPLICATE].values
    found = []
    for number in np.unique(replicate):
        each = _replicate(runs, outcomes, np.flatnonzero(replicate == number))
        if each is None:
            nothing = Estimate.without_bounds(math.nan, texts.NO_ADMISSIBLE_REPLICATE)
            return RareEventProbability(nothing)
        found.append(each)
    estimate = replicate_interval([each.probability for each in found], level)
    unmet = _unmet(runs, outcomes)
    if estimate.label == "none":
        return RareEventProbability(estimate.with_note(unmet))
    few = texts.FEW_RUNS_IN_REPLICATES.format(runs=_ENOUGH_RUNS, few=_FEW_RUNS)
    is_few = len(replicate) < _ENOUGH_RUNS * len(found)
    noted = estimate.with_note(*_warnings(found), few if is_few else "", unmet)
    return RareEventProbability(noted)


def _replicate(runs: xr.Dataset, outcomes: EventOutcomes, members: IntArray) -> _Replicate | None:
    """Return the weighted shares of the draws of the last stage; None where none counts.

    The mixture of that stage is fixed before its points are drawn, so the mean is unbiased.
    Inadmissible draws make the probability that of admissible inputs.
    """
    stages = runs[SAMPLING_STAGE].values[members]
    last = members[stages == stages.max()]
    weights, shown = runs[DENSITY_RATIO].values[last], outcomes.of(last)
    # The weights of all draws have the mean 1, so what does not count is taken from that.
    admissible = 1 - float(np.mean(weights * ~shown.belongs))
    if not shown.belongs.any() or admissible <= 0:
        return None
    of_event = weights * shown.occurs
    event, missing = float(of_event.mean()), float(np.mean(weights * shown.missing))
    # Draws of a component have a mean of their own; so this is rather too large than too small.
    error = float(of_event.std()) / math.sqrt(len(last))
    return _Replicate(
        ReplicateProbability(event / admissible, missing / admissible),
        error / admissible,
        effective_size(weights[shown.occurs]),
    )


def _warnings(found: Sequence[_Replicate]) -> Iterator[str]:
    """Yield what the weights within the replicates say against the interval from their scatter."""
    smallest = min(each.effective_size for each in found)
    if 0 < smallest < _FEW_EFFECTIVE:
        yield texts.FEW_DRAWS_DECIDE.format(size=smallest)
    event, error = np.array([(each.probability.event, each.standard_error) for each in found]).T
    if (error > 0).all() and len(found) > 1:
        mean = np.average(event, weights=error**-2)
        if np.sum(((event - mean) / error) ** 2) > chdtri(len(found) - 1, _SIGNIFICANT):
            yield texts.REPLICATES_DIFFER


def _unmet(runs: xr.Dataset, outcomes: EventOutcomes) -> str:
    """Return how probable a part of the event may be that no draw has met.

    The inflated components alone would have met it, by the rule of three, if it were likelier. The
    ratio of the densities is largest at the shortest distance from the median, which is taken as
    that of the nearest run with the event.
    """
    draws = int(np.count_nonzero(runs[MIXTURE_COMPONENT].values == INFLATED))
    distance = runs[NORMAL_DISTANCE].values
    nearest = float(distance[outcomes.occurs].min()) if outcomes.occurs.any() else 0.0
    varied = [each for each in runs.data_vars.values() if each.attrs.get(ROLE) == "input"]
    dimension = sum(each.dims == (RUN,) for each in varied)
    spread = inflation(dimension)
    ratio = spread**dimension * math.exp(-0.5 * nearest**2 * (1 - spread**-2))
    probability = 3 * ratio / max(draws, 1)
    if probability >= 1:
        return texts.UNMET_UNBOUNDED.format(distance=nearest)
    return texts.UNMET_BY_DRAWS.format(distance=nearest, probability=probability)
