"""Quantiles and tolerance limits far out, from a design that moves towards an event."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.lookup import resolve
from uqpen.core.statistic_dimensions import CONTENT_LEVEL, LOWER_CONTENT, PROBABILITY
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import runs_needed
from uqpen.statistics.quantity_of_interest import DEFAULT_QUANTILES, QuantityOfInterest
from uqpen.statistics.rare_events.rare_event_probability import rare_event
from uqpen.statistics.rare_events.tail_function import TailFunction

__all__ = ["rare_quantiles"]


def rare_quantiles(
    runs: xr.Dataset, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
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
    limits = rare.event.limits
    is_above = limits[0].is_above
    contents = quantity.tolerance_contents if is_above else quantity.lower_tolerance_contents
    if quantity.quantiles == DEFAULT_QUANTILES and not contents:
        return
    reason = texts.SEVERAL_LIMITS
    tail: TailFunction | None = None
    if len(limits) == 1:
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
    if found.label == "none":
        return found
    method = texts.ONE_SIDED.format(method=found.method)
    return Estimate(*found.bounds, method, found.label, found.note)


def _estimate(value: float, ends: tuple[float, float], is_above: bool, is_met: bool) -> Estimate:
    """Return a quantile with its bounds, which change places where the event lies below."""
    if math.isnan(value):
        return Estimate.without_bounds(math.nan, texts.BEYOND_ALL_LEVELS)
    shown = value if is_above else -value
    if math.isnan(ends[1]) or not is_met:
        return Estimate.without_bounds(shown, texts.BEYOND_ALL_LEVELS)
    lower, upper = ends if is_above else (-ends[1], -ends[0])
    return Estimate(shown, lower, upper, texts.INVERTED_OVER_REPLICATES, "nominal")
