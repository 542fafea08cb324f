"""Probability of the event that a design was made for."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from uqpen.core.errors import QuantityError
from uqpen.core.labels import (
    CORRECTION_WEIGHT,
    RARE_EVENT,
    REPLICATE,
    RUN,
    SAMPLING_STAGE,
    SEARCH_START,
)
from uqpen.designs.rare_events.limit_state import LimitState, parse_limit_state
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.rare_events.form_probability import form_estimate
from uqpen.statistics.rare_events.importance_probability import importance_estimate
from uqpen.statistics.rare_events.learned_probability import learned_probability
from uqpen.statistics.rare_events.replicate_interval import replicate_interval
from uqpen.statistics.rare_events.subset_probability import subset_probability

__all__ = ["rare_event", "rare_event_probability"]


def rare_event(runs: xr.Dataset) -> LimitState | None:
    """Return the event that a design was made for; None for any other design.

    A file of any origin may have a text that is no event, or of outputs that it lacks.
    """
    try:
        event = parse_limit_state(str(runs.attrs.get(RARE_EVENT, "")))
    except QuantityError:
        return None
    return event if event.outputs <= set(map(str, runs.data_vars)) else None


def rare_event_probability(runs: xr.Dataset, event: LimitState, level: float) -> Estimate:
    """Estimate the probability of an event from all replicates of a design.

    It is that of admissible inputs, as of every sample. A failed run widens the interval.

    Parameters
    ----------
    runs : Dataset
        All runs of the design, with what its method says of each.
    event : LimitState
        The event.
    level : float
        Confidence level of the interval.
    """
    outcomes = event.outcomes(runs)
    if CORRECTION_WEIGHT in runs.coords:
        return learned_probability(runs, outcomes, level).estimate
    if SEARCH_START in runs.coords:
        return form_estimate(runs, event, outcomes)
    if SAMPLING_STAGE in runs.coords:
        return importance_estimate(runs, outcomes, level)
    replicate = runs[REPLICATE].values
    found = []
    for number in np.unique(replicate):
        members = np.flatnonzero(replicate == number)
        probability = subset_probability(runs, outcomes, event, members)
        if probability is None:
            return Estimate.without_bounds(math.nan, texts.NO_ADMISSIBLE_REPLICATE)
        found.append(probability)
    plain = 3 / runs.sizes[RUN]  # the rule of three
    unmet = texts.UNMET_PART.format(probability=plain)
    estimate = replicate_interval(found, level)
    return estimate.with_note(estimate.note, unmet)
