"""Methods for a rare event: designs whose runs lead to it, and what is estimated from the runs."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["RARE_EVENT_METHODS", "RareEventMethod"]


class RareEventMethod(NamedTuple):
    """References to the parts of a method; it has none to a statistic that it does not allow.

    Parameters
    ----------
    design : str
        The `RareEventDesign`.
    probability : str
        Takes the runs, the `LimitState` and a confidence level, and returns a
        `RareEventProbability`.
    quantiles : str
        Takes the runs and a `LimitState` with one limit, and returns a `TailFunction`.
    sensitivities : str
        Takes what `probability` takes, and returns `EventScores`.
    """

    design: str
    probability: str
    quantiles: str = ""
    sensitivities: str = ""


# By the name of the design in a study, which the runs state.
RARE_EVENT_METHODS = {
    "subset-simulation": RareEventMethod(
        "uqpen.designs.rare_events.subset_simulation:SubsetSimulation",
        "uqpen.statistics.rare_events.subset_probability:subset_probability",
        "uqpen.statistics.rare_events.tail_function:TailFunction.of",
        "uqpen.statistics.event_sensitivity.subset_sensitivity:SubsetScores.of",
    ),
    "active-learning": RareEventMethod(
        "uqpen.surrogates.active_learning.active_learning:ActiveLearning",
        "uqpen.statistics.rare_events.learned_probability:learned_probability",
    ),
    "form": RareEventMethod(
        "uqpen.designs.rare_events.form:Form",
        "uqpen.statistics.rare_events.form_probability:form_probability",
    ),
    "importance-sampling": RareEventMethod(
        "uqpen.designs.rare_events.importance_sampling:ImportanceSampling",
        "uqpen.statistics.rare_events.importance_probability:importance_probability",
    ),
}
