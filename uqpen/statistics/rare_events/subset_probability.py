"""Probability of a rare event from replicates of subset simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import (
    CHAIN_PARENT,
    CONTENT_LEVEL,
    LEVEL_THRESHOLD,
    LOWER_CONTENT,
    PROBABILITY,
    REPLICATE,
    RUN,
    SUBSET_LEVEL,
)
from uqpen.core.lookup import resolve
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState, NamedOutcome
from uqpen.designs.rare_events.subset_simulation import STEPS, ChainStates
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.intervals import runs_needed
from uqpen.statistics.quantity_of_interest import DEFAULT_QUANTILES, QuantityOfInterest
from uqpen.statistics.rare_events.rare_event_probability import (
    RareEventProbability,
    ReplicateProbability,
    half_width_of_logarithm,
    rare_event,
    replicate_interval,
)


def subset_probability(runs: xr.Dataset, event: LimitState, level: float) -> RareEventProbability:
    """Estimate the probability of an event: of a replicate, the product over all levels.

    A failed run counts as nearest to the event, so all of them are among the states of the last
    level, and their probability follows as that of the event does.
    """
    outcomes, replicate = event.outcomes(runs), runs[REPLICATE].values
    found = []
    for number in np.unique(replicate):
        members = np.flatnonzero(replicate == number)
        if not (levels := subset_levels(runs, outcomes, event, members)):
            nothing = Estimate.without_bounds(math.nan, texts.NO_ADMISSIBLE_REPLICATE)
            return RareEventProbability(nothing)
        probability, _, states = levels[-1]
        shares = float(states.occurs.mean()), float(states.missing.mean())
        found.append(ReplicateProbability(*(probability * share for share in shares)))
    plain = 3 / runs.sizes[RUN]  # the rule of three
    unmet = texts.UNMET_PART.format(probability=plain)
    estimate = replicate_interval(found, level)
    unled = "" if estimate.label == "none" else _unled(runs, event, outcomes)
    return RareEventProbability(estimate.with_note(unled, unmet))


# So many draws of an outcome in each replicate say by themselves how probable it is.
_ENOUGH_DRAWS = 10


def _unled(runs: xr.Dataset, event: LimitState, outcomes: EventOutcomes) -> str:
    """Return which outcomes a few independent draws have met alone; empty for none.

    A level leads to an outcome where a chain has moved there from a run without it.
    """
    level = runs[SUBSET_LEVEL].values
    moved, drawn = np.flatnonzero(level > 0), np.flatnonzero(level == 0)
    parents, replicates = runs[CHAIN_PARENT].values[moved], runs[REPLICATE].values
    found = []
    for limit, excess in zip(event.limits, outcomes.excess, strict=True):
        if isinstance(limit, NamedOutcome) and event.is_any:
            is_so = np.isposinf(excess)
            is_led = bool((is_so[moved] & ~is_so[parents]).any())
            counts = np.bincount(replicates[drawn], is_so[drawn])
            if is_so.any() and not is_led and counts.min() < _ENOUGH_DRAWS:
                found.append(f"“{limit}”")
    return texts.UNLED_OUTCOME.format(outcome=" and ".join(found)) if found else ""


class Level(NamedTuple):
    """Level of a replicate: a sample of the inputs, given that a run reaches the level."""

    probability: float  # probability of reaching it
    threshold: float  # the performance that reaches it; minus infinity for independent draws
    states: ChainStates  # the states of its chains


def subset_levels(
    runs: xr.Dataset, outcomes: EventOutcomes, event: LimitState, members: IntArray
) -> list[Level]:
    """Return the levels of a replicate, the independent draws first; none where no draw counts.

    Parameters
    ----------
    outcomes : EventOutcomes
        Of all runs.
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
        visited = [everything.at(seeds)]
        for candidates in made.reshape(STEPS, -1):
            visited.append(visited[-1].moved(everything.at(candidates), threshold))
        states = ChainStates.joined(visited)
        found.append(Level(probability, threshold, states))
    return found


# Probability beyond each value of an output, from the levels of subset simulation.


@dataclass(frozen=True, eq=False)
class TailFunction:
    """Probabilities of all replicates beyond values of the output of an event with one limit.

    Values are those of the output, times -1 where the event lies below its limit. The probability
    beyond a value is that of the deepest level that the value reaches, times the share of the
    states of this level that lie beyond the value.
    """

    values: FloatArray  # (value,): those of all states, ascending
    # (replicate, value): probability beyond each value, given that a run completes.
    completed: FloatArray
    lowest: FloatArray  # (replicate, value): the same where no failed run lies beyond it
    largest: FloatArray  # (replicate, value): the same where all of them do

    @classmethod
    def of(cls, runs: xr.Dataset, event: LimitState) -> TailFunction | None:
        """Follow the chains of all replicates; None where a replicate has no draw that counts."""
        outcomes, replicate = event.outcomes(runs), runs[REPLICATE].values
        (limit,) = event.of_numbers
        sign = 1.0 if limit.is_above else -1.0
        values = sign * runs[limit.output].values
        by_replicate = []
        for number in np.unique(replicate):
            members = np.flatnonzero(replicate == number)
            if not (levels := subset_levels(runs, outcomes, event, members)):
                return None
            by_replicate.append(levels)
        every = [level.states for levels in by_replicate for level in levels]
        at = np.unique(np.concatenate([values[each.runs[~each.missing]] for each in every]))
        tables = [_probabilities(levels, values, at) for levels in by_replicate]
        beyond = np.array([each[0] for each in tables])
        missing = np.array([each[1] for each in tables])
        with np.errstate(divide="ignore", invalid="ignore"):
            completed = np.where(missing < 1, beyond / (1 - missing), np.nan)
        return cls(at, completed, beyond, beyond + missing)

    def quantile(self, probability: float) -> float:
        """Return the first value beyond which a probability or less lies; NaN if none is known."""
        return self._first(self.completed.mean(axis=0) <= probability)

    def bounds(self, probability: float, level: float) -> tuple[float, float, bool]:
        """Return the values whose probability beyond has a given one in its interval.

        Returns
        -------
        lower, upper : float
            NaN for an end that the runs do not show.
        is_met : bool
            Whether all replicates have states beyond both ends.
        """
        lower = self._first(_ends(self.lowest, level, -1) <= probability)
        upper = self._first(_ends(self.largest, level, +1) <= probability)
        furthest = np.nanmax([lower, upper, -math.inf])
        place = min(np.searchsorted(self.values, furthest), len(self.values) - 1)
        return lower, upper, bool((self.completed[:, place] > 0).all())

    def _first(self, condition: BoolArray) -> float:
        """Return the first value from which on a condition holds; NaN at the end of all states.

        Beyond the last states nothing is known of the probability.
        """
        holds = np.logical_and.accumulate(condition[::-1])[::-1]
        is_known = holds & (self.completed > 0).any(axis=0)
        return float(self.values[is_known.argmax()]) if is_known.any() else math.nan


def _probabilities(
    levels: list[Level], values: FloatArray, at: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the probability beyond each value, and that of a failed run, in one replicate."""
    beyond, missing = np.empty(len(at)), np.empty(len(at))
    start = 0
    for number, level in enumerate(levels):
        states = level.states
        own = np.sort(values[states.runs[~states.missing]])
        # The next level begins at the least of its states.
        stop = len(at)
        if number + 1 < len(levels):
            following = levels[number + 1].states
            reached = values[following.runs[~following.missing]]
            if reached.size:
                stop = int(np.searchsorted(at, reached.min()))
        stop = max(stop, start)
        count = own.size - np.searchsorted(own, at[start:stop], side="right")
        beyond[start:stop] = level.probability * count / len(states.runs)
        missing[start:stop] = level.probability * states.missing.mean()
        start = stop
    return beyond, missing


def _ends(table: FloatArray, level: float, sign: int) -> FloatArray:
    """Return an end of the interval of the probability beyond each value.

    It is 0 where a replicate has no state beyond a value: what is found there has no interval.
    """
    is_met = (table > 0).all(axis=0)
    met = table[:, is_met]
    ends = np.zeros(table.shape[1])
    ends[is_met] = met.mean(axis=0) * np.exp(sign * half_width_of_logarithm(met, level))
    return ends


# Quantiles and tolerance limits far out, from a design that moves towards an event.


def rare_quantiles(runs: xr.Dataset, quantity: QuantityOfInterest) -> NamedArrays:
    """Estimate the requested quantiles and tolerance limits of the output of an event.

    The levels of each replicate give the probability beyond every value. A quantile is where their
    mean has the requested probability, and its interval has the values whose interval contains it.
    Only quantiles beside those of every sample are a request.

    Yields
    ------
    name : str
        ``quantile``, ``tolerance_limit`` of an event above its limit, ``lower_tolerance_limit`` of
        one below.
    estimate : DataArray
        As of a sample.
    """
    rare = rare_event(runs)
    if rare is None or not rare.method.quantiles or quantity.output.name not in rare.event.outputs:
        return
    is_above = rare.event.of_numbers[0].is_above
    contents = quantity.tolerance_contents if is_above else quantity.lower_tolerance_contents
    if quantity.quantiles == DEFAULT_QUANTILES and not contents:
        return
    reason = texts.SEVERAL_LIMITS
    tail: TailFunction | None = None
    if len(rare.event.limits) == 1:
        tail = resolve(rare.method.quantiles)(runs, rare.event)
        reason = texts.NO_ADMISSIBLE_REPLICATE
    level, title = quantity.confidence_level, quantity.output.title
    if quantity.quantiles != DEFAULT_QUANTILES:
        estimate = partial(_quantile, tail, reason, is_above, level)
        along = {PROBABILITY: _coordinate(PROBABILITY, quantity.quantiles, "below the quantile")}
        long_name = f"quantiles of {title}"
        yield "quantile", _stacked(quantity, estimate, PROBABILITY, long_name, along)
    if contents:
        name, dimension = (
            ("tolerance_limit", CONTENT_LEVEL)
            if is_above
            else ("lower_tolerance_limit", LOWER_CONTENT)
        )
        of_runs = texts.RUNS_NEEDED if is_above else texts.RUNS_NEEDED_BELOW
        needed = [runs_needed(content, level) for content in contents]
        side = "not exceeding" if is_above else "not lying below"
        along = {
            dimension: _coordinate(dimension, contents, side),
            f"{dimension}_runs_needed": (dimension, needed, {"units": "1", "long_name": of_runs}),
        }
        verb = "exceed" if is_above else "lie below"
        long_name = f"value that {title} does not {verb} with a probability"
        estimate = partial(_tolerance_limit, tail, reason, is_above, level)
        yield name, _stacked(quantity, estimate, dimension, long_name, along)


def _stacked(
    quantity: QuantityOfInterest,
    estimate: Callable[[float], Estimate],
    dimension: str,
    long_name: str,
    along: dict[str, Any],
) -> xr.DataArray:
    return Estimate.stack(
        [estimate(each) for each in along[dimension][1].tolist()],
        dimension,
        units=quantity.output.unit,
        long_name=long_name,
        coordinates=along,
        level=quantity.confidence_level,
    )


def _coordinate(dimension: str, values: Sequence[float], side: str) -> tuple[str, Any, Any]:
    described = {"units": "1", "long_name": f"probability of lying {side}"}
    if side.startswith("not"):
        described["long_name"] = f"probability of {side} the value"
    return dimension, np.array(values), described


def _quantile(
    tail: TailFunction | None, reason: str, is_above: bool, level: float, probability: float
) -> Estimate:
    beyond = 1 - probability if is_above else probability
    if tail is None:
        return Estimate.without_bounds(math.nan, reason)
    lower, upper, is_met = tail.bounds(beyond, level)
    return _estimate(tail.quantile(beyond), (lower, upper), is_above, is_met)


def _tolerance_limit(
    tail: TailFunction | None, reason: str, is_above: bool, level: float, content: float
) -> Estimate:
    if tail is None:
        return Estimate.without_bounds(math.nan, reason)
    # A one-sided bound at 95 % is the upper end of a two-sided interval at 90 %.
    _, upper, is_met = tail.bounds(1 - content, 2 * level - 1)
    found = _estimate(tail.quantile(1 - content), (math.nan, upper), is_above, is_met)
    return found if found.label == "none" else found.with_method(texts.ONE_SIDED)


def _estimate(value: float, ends: tuple[float, float], is_above: bool, is_met: bool) -> Estimate:
    """Return a quantile with its bounds, which change places where the event lies below."""
    if math.isnan(value):
        return Estimate.without_bounds(math.nan, texts.BEYOND_ALL_LEVELS)
    shown = value if is_above else -value
    if math.isnan(ends[1]) or not is_met:
        return Estimate.without_bounds(shown, texts.BEYOND_ALL_LEVELS)
    lower, upper = ends if is_above else (-ends[1], -ends[0])
    return Estimate(shown, lower, upper, texts.INVERTED_OVER_REPLICATES, "nominal")
