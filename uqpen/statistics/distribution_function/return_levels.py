"""Return levels: values that an output exceeds once in a number of cases, from a fitted tail."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from uqpen.core.catalogue import CATALOGUE
from uqpen.core.statistic_dimensions import RETURN_PERIOD
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.tails.profile_likelihood import FittedTail
from uqpen.statistics.tails.threshold_choice import FEWEST_BEYOND, FEWEST_RUNS, fitting_tails

__all__ = ["return_levels"]

# The likelihood of a tail that ends more abruptly is not regular.
_SMALLEST_SHAPE = -0.5


def return_levels(
    sample: Sample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Estimate return levels of an output, by a generalised Pareto distribution of its tail.

    Yields
    ------
    name : str
        ``return_level``; of the tail ``tail_threshold``, ``tail_shape``, ``tail_scale``,
        ``tail_runs`` and ``tail_p_value``.
    estimate : DataArray
        ``return_level`` along ``return_period``, a number of cases, and ``bound``; the others along
        ``bound``.

    References
    ----------
    Coles, S. (2001). An Introduction to Statistical Modeling of Extreme Values. Springer.
    """
    asked = quantity.requested(CATALOGUE["return_level"])
    if quantity.output.categories or not asked:
        return
    reason = _reason_of_sample(sample)
    tails = [] if reason else list(fitting_tails(sample.sorted_values))
    reason = reason or _reason_of_tails(tails)
    unit, title = quantity.output.unit, quantity.output.title
    described = {"units": "1", "long_name": "number of cases"}
    periods = np.array(asked)
    yield (
        "return_level",
        Estimate.stack(
            [_return_level(sample, tails, reason, each) for each in asked],
            RETURN_PERIOD,
            units=unit,
            long_name=f"value that {title} exceeds once in a number of cases",
            coordinates={RETURN_PERIOD: (RETURN_PERIOD, periods, described)},
            level=sample.level,
        ),
    )
    for name, units, value in _described(tails[0] if tails else None, unit):
        estimate = Estimate.without_bounds(value, reason or texts.PART_OF_FIT)
        long_name = f"{name.replace('_', ' ')} of {title}"
        yield name, estimate.to_array(units=units, long_name=long_name)


def _described(tail: FittedTail | None, unit: str) -> Iterator[tuple[str, str, float]]:
    """Yield the numbers that describe a tail, with their units; NaN without a tail."""
    if tail is None:
        numbers = [math.nan] * 5
    else:
        count = float(len(tail.excesses))
        numbers = [tail.threshold, tail.shape, tail.scale, count, tail.p_value]
    names = ("tail_threshold", "tail_shape", "tail_scale", "tail_runs", "tail_p_value")
    yield from zip(names, (unit, "1", unit, "1", "1"), numbers, strict=True)


def _reason_of_sample(sample: Sample) -> str:
    """Return the reason why no tail is fitted to a sample; empty where one is."""
    if reason := sample.reason_without_intervals:
        return reason
    if sample.weights is not None:
        return texts.NOT_WEIGHTED
    if bool(sample.is_constant):
        return texts.CONSTANT_OUTPUT
    if sample.size < FEWEST_RUNS:
        return texts.FEW_RUNS_FOR_A_TAIL.format(runs=FEWEST_RUNS)
    return ""


def _reason_of_tails(tails: Sequence[FittedTail]) -> str:
    """Return the reason why fitted tails give no return level; empty where they do."""
    if not tails:
        return texts.NO_TAIL_FITS.format(runs=FEWEST_BEYOND)
    if tails[0].shape < _SMALLEST_SHAPE:
        return texts.TAIL_ENDS.format(shape=tails[0].shape)
    return ""


def _return_level(
    sample: Sample, tails: Sequence[FittedTail], reason: str, period: float
) -> Estimate:
    """Estimate the level of a period; the interval is that of all tails that fit."""
    if reason:
        return Estimate.without_bounds(math.nan, reason)
    first = tails[0]
    if period * first.share <= 1:
        return Estimate.without_bounds(math.nan, texts.BELOW_THE_TAIL)
    regular = [
        each for each in tails if each.shape >= _SMALLEST_SHAPE and period * each.share > 1 + 1e-9
    ]
    ends = np.array([each.interval(period, sample.level) for each in regular])
    notes = [texts.TAIL_OF_RUNS.format(runs=len(first.excesses), p_value=first.p_value)]
    if period > sample.size:
        notes.append(texts.BEYOND_ALL_RUNS)
    if sample.missing.size:
        notes.append(texts.MISSING_FROM_TAIL.format(runs=sample.missing.size))
    is_independent = sample.error_model is ErrorModel.INDEPENDENT
    label = "nominal" if is_independent else "conservative"
    lower, upper = float(ends[:, 0].min()), float(ends[:, 1].max())
    found = Estimate(first.return_level(period), lower, upper, texts.PROFILE_LIKELIHOOD, label)
    if not math.isfinite(upper):
        return Estimate.without_bounds(found.value, texts.TAIL_WITHOUT_BOUND)
    return found.with_note(*notes)
