"""Intervals of a design whose runs decided their own number: those not certified get a note."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import scipy
import xarray as xr

from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.errors import QuantityError
from uqpen.core.labels import (
    BOUND,
    DECISION,
    DECISION_CLAIM,
    DECISION_LOWER,
    DECISION_PROBABILITY,
    DECISION_RUNS,
    DECISION_UPPER,
    INTERVAL_LABEL,
    NOTE,
    STOPPING_CLAIM,
    STOPPING_STATISTICS,
)
from uqpen.designs.stopping.acceptance_claim import ERROR, parse_claim
from uqpen.statistics import texts

_Statistics = dict[str, xr.DataArray]


def mark_uncertified(
    outputs: Mapping[str, _Statistics], attributes: Mapping[str, Any]
) -> dict[str, _Statistics]:
    """Add a note to each interval whose statistic did not decide the number of runs.

    Parameters
    ----------
    outputs : mapping
        By output, estimate arrays by statistic.
    attributes : mapping
        Of the runs. Without the statistics of a stopping rule, nothing is marked.
    """
    certified = _certified(attributes.get(STOPPING_STATISTICS))
    if certified is None:
        return dict(outputs)
    return {
        output: {
            name: _marked(array, [each[2] for each in certified if each[:2] == [output, name]])
            for name, array in statistics.items()
        }
        for output, statistics in outputs.items()
    }


def _marked(array: xr.DataArray, certified: list[Any]) -> xr.DataArray:
    """Return an estimate array with the note at its intervals, but for entries of some labels."""
    if BOUND not in array.dims or INTERVAL_LABEL not in array.coords:
        return array
    is_marked = array.coords[INTERVAL_LABEL].values != "none"
    if array.ndim == 1:
        is_marked = is_marked & (not certified)
    elif certified:
        labels = array.coords[array.dims[0]].values.tolist()
        is_marked = is_marked & [label not in certified for label in labels]
    own = array.coords[NOTE]
    notes = own.values.copy()
    marked = {
        note: "; ".join(filter(None, [note, texts.NUMBER_DECIDED_BY_RUNS]))
        for note in set(notes[is_marked].tolist())
    }
    notes[is_marked] = [marked[note] for note in notes[is_marked].tolist()]
    return array.assign_coords({NOTE: (own.dims, notes)})


def _certified(written: object) -> list[list[Any]] | None:
    """Return output, statistic and label of each certified estimate; None for a fixed number.

    The attribute may come from any file: what cannot be read certifies nothing.
    """
    if written is None:
        return None
    try:
        entries = json.loads(str(written))
    except ValueError:
        return []
    entries = entries if isinstance(entries, list) else []
    return [each for each in entries if isinstance(each, list) and len(each) == 3]


# Decision on a claim: the verdict of a design's runs, and the interval of the probability.


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
