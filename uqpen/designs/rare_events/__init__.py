"""Methods for a rare event: designs whose runs lead to it, and what is estimated from the runs."""

from __future__ import annotations

from typing import NamedTuple

from uqpen.core.labels import (
    CHAIN_PARENT,
    CORRECTION_WEIGHT,
    DENSITY_RATIO,
    LEVEL_THRESHOLD,
    MIXTURE_COMPONENT,
    MOVED_AXIS,
    NORMAL_DISTANCE,
    PREDICTED_EVENT,
    PREDICTION_ERROR,
    REPLICATE,
    SAMPLING_STAGE,
    SEARCH_ORIGIN,
    SEARCH_START,
    SEARCH_WEIGHT,
    SUBSET_LEVEL,
    SURROGATE_PROBABILITY,
    SURROGATE_PROBABILITY_ERROR,
)

__all__ = ["RARE_EVENT_METHODS", "RareEventMethod"]


class RareEventMethod(NamedTuple):
    """References to the parts of a method; it has none to a statistic that it does not allow."""

    design: str  # the `RareEventDesign`
    coordinates: tuple[str, ...]  # coordinates of its runs, which the functions below read
    # Takes the runs, the `LimitState` and a confidence level, and returns a `RareEventProbability`.
    probability: str
    # Takes the runs and a `LimitState` with one limit, and returns a `TailFunction`.
    quantiles: str = ""
    sensitivities: str = ""  # takes what `probability` takes, and returns `EventScores`


# By the name of the design in a study, which the runs state.
RARE_EVENT_METHODS = {
    "subset-simulation": RareEventMethod(
        "uqpen.designs.rare_events.subset_simulation:SubsetSimulation",
        (REPLICATE, SUBSET_LEVEL, CHAIN_PARENT, LEVEL_THRESHOLD),
        "uqpen.statistics.rare_events.subset_probability:subset_probability",
        "uqpen.statistics.rare_events.subset_probability:TailFunction.of",
        "uqpen.statistics.event_sensitivity.sample_sensitivity:SubsetScores.of",
    ),
    "active-learning": RareEventMethod(
        "uqpen.surrogates.active_learning:ActiveLearning",
        (
            REPLICATE,
            CORRECTION_WEIGHT,
            SEARCH_WEIGHT,
            PREDICTED_EVENT,
            PREDICTION_ERROR,
            SURROGATE_PROBABILITY,
            SURROGATE_PROBABILITY_ERROR,
        ),
        "uqpen.statistics.rare_events.learned_probability:learned_probability",
    ),
    "form": RareEventMethod(
        "uqpen.designs.rare_events.form:Form",
        (REPLICATE, SEARCH_START, SEARCH_ORIGIN, MOVED_AXIS, NORMAL_DISTANCE),
        "uqpen.statistics.rare_events.form_probability:form_probability",
    ),
    "importance-sampling": RareEventMethod(
        "uqpen.designs.rare_events.importance_sampling:ImportanceSampling",
        (REPLICATE, SAMPLING_STAGE, MIXTURE_COMPONENT, DENSITY_RATIO, NORMAL_DISTANCE),
        "uqpen.statistics.rare_events.importance_probability:importance_probability",
    ),
}
