"""Quantiles of an output, and the mean of an output beyond a quantile."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import PERCENT, PROBABILITY, SHORTFALL_LEVEL
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.intervals import (
    order_statistic_ranks,
    student_interval,
    student_quantile,
)
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.reweighting import ENOUGH_ON_A_SIDE
from uqpen.statistics.sample import ENOUGH_RUNS_FOR_MEANS, ErrorModel, Sample
from uqpen.statistics.standard_errors import cdf_error, extreme_margins, mean_margins
from uqpen.statistics.weights import effective_sizes, runs_on_a_side, weighted_quantile

# With fewer runs than this on one side of a value, replicates do not show the error there.
_FEWEST_BEYOND = 10

_PERCENTS = (1, 5, 10, 25, 50, 75, 90, 95, 99)


def quantile_estimates(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Estimate the requested quantiles of an output.

    Yields
    ------
    name : str
        ``quantile``.
    estimate : DataArray
        Along ``probability`` and ``bound``.
    """
    if quantity.output.categories:
        return
    described = {"units": "1", "long_name": "probability of lying below the quantile"}
    array = requested_quantiles(sample, quantity).to_array(
        PROBABILITY,
        units=quantity.output.unit,
        long_name=f"quantiles of {quantity.output.title}",
        coordinates={PROBABILITY: (PROBABILITY, np.array(quantity.quantiles), described)},
        level=sample.level,
    )
    yield "quantile", array


def requested_quantiles(sample: Sample, quantity: QuantityOfInterest) -> Estimate:
    """Return the requested quantiles of an output that is a number, along a last axis."""
    return quantiles_at(sample, quantity.quantiles)


def percentiles(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Estimate nine percentiles of an output, from 1 % to 99 %, whatever a study requests.

    Yields
    ------
    name : str
        ``percentile``.
    estimate : DataArray
        Along ``percent`` and ``bound``.
    """
    if quantity.output.categories:
        return
    described = {"units": "%", "long_name": "probability of lying below the percentile"}
    array = quantiles_at(sample, [percent / 100 for percent in _PERCENTS]).to_array(
        PERCENT,
        units=quantity.output.unit,
        long_name=f"percentiles of {quantity.output.title}",
        coordinates={PERCENT: (PERCENT, np.array(_PERCENTS), described)},
        level=sample.level,
    )
    yield "percentile", array


def sample_quantile(sample: Sample, probability: npt.ArrayLike) -> FloatArray:
    """Median-unbiased quantiles of a sample (Hyndman & Fan 1996, Am. Stat. 50, 361-365, no. 8).

    The shape is that of the probabilities, behind the number of places if there are any.
    """
    p = np.asarray(probability, dtype=np.float64)
    if not sample.size:
        return np.full((*sample.values.shape[:-1], *p.shape), np.nan)
    if sample.run_weights is not None:
        found = weighted_quantile(sample.values, sample.run_weights, p.ravel())
        return np.reshape(found, (*sample.values.shape[:-1], *p.shape))
    position = np.clip(p * (sample.size + 1 / 3) + 1 / 3, 1, sample.size) - 1
    below = np.floor(position).astype(np.int64)
    above = np.minimum(below + 1, sample.size - 1)
    low, high = sample.ordered(below), sample.ordered(above)
    # Weights rather than a difference, which overflows where both ends of the numbers are met.
    share = position - below
    return np.where(low == high, low, (1 - share) * low + share * high)


def has_enough_runs_around(sample: Sample, counts_below: npt.ArrayLike) -> BoolArray:
    """Check that enough runs lie on either side of values to estimate the error by their scatter.

    `counts_below` are the numbers of runs below each value; effective ones for weighted runs.
    """
    # A probability times a number of runs is a whole number but for rounding.
    beyond = np.minimum(counts_below, sample.effective_size - np.asarray(counts_below))
    return np.round(beyond, 6) >= _FEWEST_BEYOND


def order_statistic(sample: Sample, rank: npt.ArrayLike) -> FloatArray:
    """Return the value at a rank counted from 1; NaN where there is no such rank.

    At places, each may have its rank.
    """
    ranks = np.broadcast_to(np.asarray(rank, dtype=np.float64), sample.values.shape[:-1])
    exists = (ranks >= 1) & (ranks <= sample.size)
    if not exists.any():
        return np.full(ranks.shape, np.nan)
    positions = np.where(exists, ranks, 1).astype(np.int64)[..., np.newaxis] - 1
    return np.where(exists, sample.ordered(positions)[..., 0], np.nan)


def quantiles_at(sample: Sample, probabilities: Sequence[float]) -> Estimate:
    """Return quantiles along a last axis."""
    values = sample_quantile(sample, probabilities)
    return Estimate.stacked(
        [_quantile_estimate(sample, p, values[..., i]) for i, p in enumerate(probabilities)]
    )


def _quantile_estimate(sample: Sample, p: float, value: FloatArray) -> Estimate:
    if reason := sample.reason_without_intervals:
        return Estimate.without_bounds(value, reason)
    if sample.run_weights is not None:
        return _weighted_quantile_estimate(sample, sample.run_weights, p, value)
    found = _by_order_statistics(sample, p, value)
    is_replicated = sample.error_model is ErrorModel.REPLICATED
    if not is_replicated or not bool(has_enough_runs_around(sample, sample.size * p)):
        return found
    # Woodruff, R. S. (1952). J. Am. Stat. Assoc. 47, 635-646; with the scatter over replicates.
    error, freedom, is_rounded = cdf_error(sample, value)
    low, high = student_interval(p, error, freedom, sample.level)
    # Least and largest whole number of runs below the quantile.
    lower, upper = np.ceil(sample.size * low), np.floor(sample.size * high) + 1
    exist = (lower >= 1) & (upper <= sample.size)
    ends = order_statistic(sample, lower), order_statistic(sample, upper)
    label = np.where(is_rounded, "discrete", "nominal")
    return found.replace_at(exist, Estimate(value, *ends, texts.WOODRUFF, label))


def _by_order_statistics(sample: Sample, p: float, value: FloatArray) -> Estimate:
    low, high = order_statistic_ranks(sample.size, p, sample.level)
    ends = order_statistic(sample, low), order_statistic(sample, high)
    if np.isnan(low) and np.isnan(high):
        return Estimate.without_bounds(value, sample.too_few_runs)
    note = ""
    if np.isnan(low) or np.isnan(high):
        note = texts.NO_LOWER_BOUND if np.isnan(low) else texts.NO_UPPER_BOUND
        note = note.format(too_few=sample.too_few_runs)
    label = "discrete" if sample.error_model is ErrorModel.INDEPENDENT else "conservative"
    return Estimate(value, *ends, texts.ORDER_STATISTICS, label, note)


def _weighted_quantile_estimate(
    sample: Sample, weights: FloatArray, p: float, value: FloatArray
) -> Estimate:
    """Estimate a quantile of weighted runs: the distribution function's error, inverted."""
    error, freedom, _ = cdf_error(sample, value)
    ends = student_interval(p, error, freedom, sample.level, lowest=0.0, highest=1.0)
    levels = np.stack(ends, axis=-1)
    lower, upper = np.moveaxis(weighted_quantile(sample.values, weights, levels), -1, 0)
    runs = runs_on_a_side(weights, sample.values > value[..., np.newaxis])
    found = Estimate(value, lower, upper, texts.WOODRUFF_WEIGHTED, "nominal")
    if sample.is_reweighted:
        found = found.remove_bounds_at(runs < ENOUGH_ON_A_SIDE, texts.FEW_ON_A_SIDE)
    return found.remove_bounds_at(runs < _FEWEST_BEYOND, texts.FEW_WEIGHTED_BEYOND)


# Expected shortfall: the mean of an output beyond a quantile.


# Where fewer effective runs decide the scatter beyond the quantile, there may be no mean. It is
# judged, as that of all runs is, where there are many of them.
_FEWEST_EFFECTIVE_RUNS = 3


def expected_shortfalls(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Estimate the mean of an output beyond its quantiles at the requested levels.

    Yields
    ------
    name : str
        ``expected_shortfall``.
    estimate : DataArray
        Along ``shortfall_level``, the probability below the quantile, and ``bound``.
    """
    asked = quantity.requested(CATALOGUE["expected_shortfall"])
    if quantity.output.categories or not asked:
        return
    described = {"units": "1", "long_name": "probability of lying below the quantile"}
    levels = np.array(asked)
    array = Estimate.stack(
        [_shortfall(sample, level) for level in asked],
        SHORTFALL_LEVEL,
        units=quantity.output.unit,
        long_name=f"mean of {quantity.output.title} beyond a quantile",
        coordinates={SHORTFALL_LEVEL: (SHORTFALL_LEVEL, levels, described)},
        level=sample.level,
    )
    yield "expected_shortfall", array


def _shortfall(sample: Sample, probability: float) -> Estimate:
    """Estimate q + E(y - q)⁺/(1 - p), which is stationary in the quantile q.

    So the error of the quantile has no part in its error (Rockafellar, R. T. and Uryasev, S.
    (2000). J. Risk 2, 21-41).
    """
    if not sample.size:
        reason = sample.reason_without_intervals or texts.NO_RUN
        return Estimate.without_bounds(np.nan, reason)
    quantile = float(sample_quantile(sample, probability))
    beyond = np.maximum(sample.values - quantile, 0.0)
    excess = beyond / (1 - probability)
    value = quantile + float(excess.mean())
    if reason := _reason_without_bounds(sample, probability):
        return Estimate.without_bounds(value, reason)
    margins = mean_margins(sample, excess, is_heavy=np.asarray(True))
    # The largest runs beyond a quantile are few, so the upper end allows for one more of them.
    upper = float(margins.above + extreme_margins(excess).above)
    # A mean over replicates has their degrees of freedom, one over runs those beyond the quantile.
    factor = 1.0
    if sample.error_model is not ErrorModel.REPLICATED:
        few = student_quantile(sample.size * (1 - probability) - 1, sample.level)
        factor = few / student_quantile(sample.degrees_of_freedom, sample.level)
    # Over replicates the coverage was 95 to 100 % (`benchmarks/tail_coverage.py`).
    is_stratified = sample.error_model is not ErrorModel.INDEPENDENT
    runs_beyond = sample.size * (1 - probability)
    note = texts.DOUBTFUL_TAIL if runs_beyond < ENOUGH_RUNS_FOR_MEANS else ""
    found = Estimate(
        value,
        value - factor * float(margins.below),
        value + factor * upper,
        texts.SHORTFALL_OVER_REPLICATES
        if sample.error_model is ErrorModel.REPLICATED
        else texts.SHORTFALL,
        "conservative" if is_stratified else "nominal",
        note,
    )
    effective = float(effective_sizes(beyond**2))
    if not note and effective < _FEWEST_EFFECTIVE_RUNS:
        reason = texts.SHORTFALL_MAY_NOT_EXIST.format(runs=effective)
        return Estimate.without_bounds(value, reason)
    return found


def _reason_without_bounds(sample: Sample, probability: float) -> str:
    if reason := sample.reason_without_intervals:
        return reason
    if bool(sample.is_constant):
        return texts.CONSTANT_OUTPUT
    beyond = sample.size * probability
    return "" if bool(has_enough_runs_around(sample, beyond)) else texts.FEW_BEYOND_QUANTILE
