"""Event that a design was made for, its method, and the probability that the method estimates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import xarray as xr

from uqpen.core.errors import QuantityError
from uqpen.core.labels import RARE_EVENT, RARE_EVENT_METHOD
from uqpen.designs.rare_events import RARE_EVENT_METHODS, RareEventMethod
from uqpen.designs.rare_events.limit_state import LimitState, parse_limit_state
from uqpen.statistics.estimate import Estimate

__all__ = ["RareEvent", "RareEventProbability", "rare_event"]


@dataclass(frozen=True)
class RareEvent:
    """Event that a design was made for, and the method of the design."""

    event: LimitState
    method: RareEventMethod


@dataclass(frozen=True, eq=False)
class RareEventProbability:
    """Probability of a rare event, and what a method says besides.

    It is that of admissible inputs, as of every sample. A failed run widens the interval.

    Parameters
    ----------
    estimate : Estimate
        From all replicates of the design.
    companions : mapping of str to float
        Numbers that stand beside it, by the names that `uqpen.archive.estimates` knows.
    statistics : mapping of str to DataArray
        Further statistics, which have their names in the catalogue.
    """

    estimate: Estimate
    companions: Mapping[str, float] = field(default_factory=dict)
    statistics: Mapping[str, xr.DataArray] = field(default_factory=dict)


def rare_event(runs: xr.Dataset) -> RareEvent | None:
    """Return the event that a design was made for; None for any other design.

    A file of any origin may have a text that is no event, or of outputs that it lacks, and the name
    of an unknown method, or of one whose coordinates it lacks.
    """
    method = RARE_EVENT_METHODS.get(str(runs.attrs.get(RARE_EVENT_METHOD, "")))
    try:
        event = parse_limit_state(str(runs.attrs.get(RARE_EVENT, "")))
    except QuantityError:
        return None
    if method is None or not {*event.outputs, *method.coordinates} <= set(map(str, runs.variables)):
        return None
    return RareEvent(event, method)
