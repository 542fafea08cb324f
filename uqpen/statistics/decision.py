"""Decision on a claim: the verdict of a design's runs, and the interval of the probability."""

from __future__ import annotations

import math

import scipy
import xarray as xr

from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.errors import QuantityError
from uqpen.core.labels import (
    DECISION,
    DECISION_CLAIM,
    DECISION_LOWER,
    DECISION_PROBABILITY,
    DECISION_RUNS,
    DECISION_UPPER,
    STOPPING_CLAIM,
)
from uqpen.designs.stopping.acceptance_claim import parse_claim
from uqpen.designs.stopping.likelihood_ratio import ERROR

__all__ = ["anytime_interval", "decision_attributes"]


def decision_attributes(runs: xr.Dataset | BlockedRuns) -> dict[str, str | int | float]:
    """Return the decision on the claim of a design as attributes of its source.

    Returns
    -------
    dict
        The claim, the verdict, the number of runs after which it was reached, the probability among
        the completed runs (NaN without one) and its interval from all of them. Empty for a design
        without a claim, or for runs that do not have its output.
    """
    handle = LoadedDataset.of(runs)
    try:
        claim = parse_claim(str(handle.attrs.get(STOPPING_CLAIM, "")))
    except QuantityError:  # no claim, or, in a file of any origin, none that can be read
        return {}
    if claim.output not in handle.template:
        return {}
    verdict, made = claim.decide(handle)
    outcomes = claim.outcomes(handle)
    events, missing = int(outcomes.events.sum()), int(outcomes.missing.sum())
    completed = len(outcomes.events) - missing
    lower, upper = anytime_interval(events, missing, completed + missing)
    return {
        DECISION: str(verdict),
        DECISION_CLAIM: str(claim),
        DECISION_RUNS: made,
        DECISION_PROBABILITY: events / completed if completed else math.nan,
        DECISION_LOWER: lower,
        DECISION_UPPER: upper,
    }


def anytime_interval(events: int, missing: int, runs: int) -> tuple[float, float]:
    """Return an interval of a probability that covers at 1 - `ERROR` whenever one stops.

    It has the limits that a mixture of likelihoods, weighted by Jeffreys' prior, does not exclude,
    for any outcome of the missing runs.

    Parameters
    ----------
    events, missing, runs : int
        Number of events, of runs whose outcome is unknown, and of all runs.
    """
    if not runs:
        return 0.0, 1.0
    return _end(events, runs, is_lower=True), _end(events + missing, runs, is_lower=False)


def _end(events: int, runs: int, *, is_lower: bool) -> float:
    """Return an end of the interval where no run is missing."""
    others = runs - events
    mixture = scipy.special.betaln(events + 0.5, others + 0.5) - scipy.special.betaln(0.5, 0.5)

    def excess(p: float) -> float:
        likelihood = scipy.special.xlogy(events, p) + scipy.special.xlog1py(others, -p)
        return float(mixture - likelihood + math.log(ERROR))

    share = events / runs
    outer = 0.0 if is_lower else 1.0
    if share == outer:
        return outer
    return float(scipy.optimize.brentq(excess, *sorted((abs(outer - 1e-300), share)), xtol=1e-12))
