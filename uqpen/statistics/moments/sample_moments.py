"""Mean, spread, skewness and kurtosis, with intervals as far as the tail permits."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import CONDITIONAL, QUADRATURE_WEIGHT, STATUS
from uqpen.core.status import Status
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around, sample_quantile
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.intervals import student_interval
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.reweighting import ENOUGH_SHARE
from uqpen.statistics.sample import ENOUGH_RUNS_FOR_MEANS, Column, ErrorModel, Sample, SampleShape
from uqpen.statistics.standard_errors import (
    cdf_error,
    mean_margins,
    standard_error,
    student_margins,
)
from uqpen.statistics.weights import effective_sizes

# Where still fewer effective runs than this decide the variance, there may be no mean.
_FEWEST_EFFECTIVE_RUNS_FOR_A_MEAN = 3
# Below this number of effective runs, intervals of the standard deviation of weighted draws
# covered in 70 to 90 %: few weights decided it.
_FEWEST_RUNS_FOR_A_WEIGHTED_STD = 20

# About one standard deviation on either side of the median, for a normal distribution.
_LOW, _HIGH = 0.16, 0.84

# Method and label of the interval of a mean.
_MEAN_METHODS = {
    ErrorModel.INDEPENDENT: (texts.STUDENT_WITH_EXTREMES, "nominal"),
    ErrorModel.REPLICATED: (texts.STUDENT_FOR_SKEWED_REPLICATES, "nominal"),
    ErrorModel.WEIGHTED: (texts.STUDENT_WEIGHTED_WITH_EXTREMES, "nominal"),
}

# A sum of as many runs as there ever are is exact to this, relative to the largest.
_ROUNDING = 1e-12
# Of the exponential function: a larger one is beyond all numbers.
_LARGEST_EXPONENT = 709.0


def sample_moments(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Moments of an output, with the tail's kurtosis and effective number of runs.

    Yields
    ------
    name : str
        ``mean``, ``std``, ``half_spread``, ``skewness``, ``kurtosis``, ``effective_runs``; for
        weighted runs also ``effective_size``.
    estimate : DataArray
        Along ``bound``.
    """
    if quantity.output.categories:
        return
    title = quantity.output.title
    shape = sample.shape
    # Each is computed on demand, since some callers need the mean alone.
    for statistic, estimated, long_name in (
        ("mean", partial(_mean, sample, shape), "mean"),
        ("std", partial(_std, sample, shape), "standard deviation"),
        ("half_spread", partial(_half_spread, sample), "half the 16 % to 84 % range"),
    ):
        long_name = f"{long_name} of {title}"
        units = quantity.output.unit
        array = estimated().to_array(units=units, long_name=long_name, level=sample.level)
        yield statistic, array
    for statistic, value, reason in (
        ("skewness", shape.skewness, texts.NO_INTERVAL),
        ("kurtosis", shape.kurtosis, texts.DIAGNOSTIC),
        ("effective_runs", shape.effective_runs, texts.DIAGNOSTIC),
    ):
        is_constant = bool(sample.is_constant) and sample.size > 1
        why = texts.CONSTANT_OUTPUT if is_constant else sample.reason_without_intervals or reason
        long_name = f"{statistic.replace('_', ' ')} of {title}"
        estimate = Estimate.without_bounds(float(value), why)
        yield statistic, estimate.to_array(units="1", long_name=long_name)
    if sample.weights is not None:
        estimate = Estimate.without_bounds(sample.effective_size, texts.DIAGNOSTIC_OF_WEIGHTS)
        long_name = f"effective sample size of {title}"
        yield "effective_size", estimate.to_array(units="1", long_name=long_name)


def mean_estimate(sample: Sample, quantity: QuantityOfInterest) -> Estimate:
    """Return the mean of an output that is a number."""
    return _mean(sample, sample.shape)


@np.errstate(over="ignore", invalid="ignore")
def _mean(sample: Sample, shape: SampleShape) -> Estimate:
    if reason := sample.reason_without_intervals:
        return Estimate.without_bounds(shape.mean, reason)
    error, _ = standard_error(sample, shape.powers(1))
    is_small = sample.effective_size < ENOUGH_RUNS_FOR_MEANS
    margins = mean_margins(sample, shape.powers(1), is_heavy=shape.is_heavy)
    ends = shape.mean - margins.below * shape.scale, shape.mean + margins.above * shape.scale
    # The note depends on the number of runs alone: a note on samples that look heavy would leave
    # those without it that have missed the tail.
    note = np.where(sample.is_constant, "", texts.DOUBTFUL_TAIL if is_small else "")
    if sample.effective_share < ENOUGH_SHARE:
        note = np.full(note.shape, texts.APPROXIMATE.format(share=100 * sample.effective_share))
    residuals = sample.residual_method, "conservative"
    method = _MEAN_METHODS.get(sample.error_model, residuals)
    found = Estimate(shape.mean, *ends, *method, note)
    # Of small samples, those without an interval would be the ones that have met the tail.
    if not is_small:
        reason = texts.MEAN_MAY_NOT_EXIST.format(heavy_tail=shape.tail_note)
        few = shape.effective_runs < _FEWEST_EFFECTIVE_RUNS_FOR_A_MEAN
        found = found.remove_bounds_at(few, reason)
    return found.remove_bounds_at(_is_falsely_exact(sample, error), texts.NO_SCATTER_OF_STRATA)


def _std(sample: Sample, shape: SampleShape) -> Estimate:
    if sample.size < 2:
        reason = sample.reason_without_intervals or texts.CONSTANT_OUTPUT
        return Estimate.without_bounds(np.full(shape.mean.shape, np.nan), reason)
    if reason := sample.reason_without_intervals:
        return Estimate.without_bounds(_unbiased_std(sample, shape) * shape.scale, reason)
    # The squares about the sample's mean are too small by the variance of that mean. Independent
    # draws correct for it by a divisor of one run less. Over strata the variance is smaller.
    error, _ = standard_error(sample, shape.powers(1))
    std = _elementwise(math.hypot, _biased_std(sample, shape), error)
    value = std * shape.scale
    if shape.hidden_tail:
        found = Estimate.without_bounds(value, shape.hidden_tail)
    else:
        found = _std_with_bounds(sample, shape, std)
    return found.remove_bounds_at(sample.is_constant, texts.CONSTANT_OUTPUT)


@np.errstate(over="ignore", invalid="ignore")
def _std_with_bounds(sample: Sample, shape: SampleShape, std: FloatArray) -> Estimate:
    """Estimate the standard deviation, given that over the largest deviation, with its bounds."""
    # The delta method on log(std), whose distribution is closer to normal than that of std itself.
    error, _ = standard_error(sample, shape.powers(2))
    margins = student_margins(sample, shape.powers(2))
    below, above = (_elementwise(_factor, margin, std) for margin in margins)
    value = std * shape.scale
    label = "conservative" if sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET else "nominal"
    is_replicated = sample.error_model is ErrorModel.REPLICATED
    method = texts.DELTA_FOR_SKEWED if is_replicated else texts.DELTA_ON_LOGARITHM
    method = method.format(error_model=sample.error_model)
    note = texts.DOUBTFUL_TAIL if shape.is_small else ""
    if sample.effective_share < ENOUGH_SHARE:
        note = texts.APPROXIMATE.format(share=100 * sample.effective_share)
    found = Estimate(value, value / below, value * above, method, label, note)
    found = found.remove_bounds_at(_is_falsely_exact(sample, error), texts.NO_SCATTER_OF_STRATA)
    see = "" if sample.is_at_places else texts.SEE_HALF_SPREAD
    few, reason = _few_weights_decide(sample, shape, std)
    found = found.remove_bounds_at(few, texts.NO_INTERVAL_AS.format(reason=reason), see)
    reason = texts.NO_INTERVAL_AS.format(reason=shape.tail_note)
    return found.remove_bounds_at(shape.may_be_heavy, reason, see)


def _factor(margin: float, std: float) -> float:
    """Return the factor of a standard deviation to the end of its interval."""
    exponent = margin / (2 * std**2) if std > 0 else math.inf
    return math.exp(exponent) if exponent < _LARGEST_EXPONENT else math.inf


def _elementwise(function: Callable[..., float], *values: FloatArray) -> FloatArray:
    """Apply a function of the C library, whose digits do not depend on the shape of an array."""
    return np.asarray(np.frompyfunc(function, len(values), 1)(*values), dtype=np.float64)


def _few_weights_decide(
    sample: Sample, shape: SampleShape, std: FloatArray
) -> tuple[BoolArray, str]:
    """Find where the error of a weighted standard deviation is not known, and the reason."""
    if sample.run_weights is None:
        return np.zeros(std.shape, dtype=np.bool_), ""
    influence = shape.deviations**2 - (std**2)[..., np.newaxis]
    runs = effective_sizes((sample.run_weights * influence) ** 2)
    if sample.is_at_places:
        reason = texts.FEW_WEIGHTS_DECIDE_AT_PLACES
    else:
        reason = texts.FEW_WEIGHTS_DECIDE.format(runs=runs)
    return runs < _FEWEST_RUNS_FOR_A_WEIGHTED_STD, reason


def _biased_std(sample: Sample, shape: SampleShape) -> FloatArray:
    """Standard deviation over the runs, relative to the largest deviation."""
    if sample.weights is None:
        return np.asarray(shape.powers(1).std(axis=-1))
    return np.sqrt(sample.mean(shape.deviations**2))


def _unbiased_std(sample: Sample, shape: SampleShape) -> FloatArray:
    """Standard deviation with the divisor of independent draws; NaN for a single one."""
    if sample.weights is None:
        return np.asarray(shape.powers(1).std(axis=-1, ddof=1))
    size = sample.effective_size
    return _biased_std(sample, shape) * (math.sqrt(size / (size - 1)) if size > 1 else math.nan)


def _is_falsely_exact(sample: Sample, error: FloatArray) -> BoolArray:
    """Find zero errors of a varying output, as one with few values over strata may have."""
    return ~sample.is_constant & (error < _ROUNDING)


def _half_spread(sample: Sample) -> Estimate:
    """Half the distance from the 16 % to the 84 % quantile.

    For a normal distribution it agrees with the standard deviation to half a per cent. Unlike the
    standard deviation, it has an interval on a heavy tail too. The interval combines Woodruff's
    intervals of both quantiles with the correlation of their errors (Zou, G. Y. (2007). Psychol.
    Methods 12, 399-413).
    """
    probabilities = np.array([_LOW, _HIGH])
    ends = sample_quantile(sample, probabilities)
    value = float(ends[1] / 2 - ends[0] / 2) if sample.size > 1 else math.nan
    reason = sample.reason_without_intervals
    if not reason and not has_enough_runs_around(sample, sample.effective_size * _LOW):
        reason = sample.too_few_runs
    if reason:
        return Estimate.without_bounds(np.asarray(value), reason)
    errors, freedoms, _ = zip(*(cdf_error(sample, end) for end in ends), strict=True)
    correlation = correlation_of_shares(sample, *(sample.event(operator.le, end) for end in ends))
    low, high = student_interval(
        probabilities, errors, freedoms[0], sample.level, lowest=0.0, highest=1.0
    )
    down = (ends - sample_quantile(sample, low)) / 2
    up = (sample_quantile(sample, high) - ends) / 2
    return Estimate(
        np.asarray(value),
        np.asarray(value - combined_error(up[0], down[1], correlation)),
        np.asarray(value + combined_error(down[0], up[1], correlation)),
        texts.TWO_WOODRUFF.format(error_model=sample.error_model),
        "conservative" if sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET else "discrete",
    )


def correlation_of_shares(sample: Sample, one: Column, other: Column) -> float:
    """Correlation of the errors of two shares, estimated from their scatter; else 0."""
    first_events: Any = one.astype(np.float64)
    second_events: Any = other.astype(np.float64)
    first, second, between = (
        float(standard_error(sample, each)[0])
        for each in (first_events, second_events, second_events - first_events)
    )
    if not first * second > 0:
        return 0.0
    correlation = (first**2 + second**2 - between**2) / (2 * first * second)
    return min(max(correlation, -1.0), 1.0)


def combined_error(low: float, high: float, correlation: float) -> float:
    """Error of a difference from the errors of its terms and their correlation."""
    largest = max(abs(low), abs(high))
    if not largest > 0:
        return 0.0
    # Over the larger, as squares of what is far from one overflow or vanish.
    one, other = low / largest, high / largest
    return largest * math.sqrt(max(one**2 + other**2 - 2 * correlation * one * other, 0.0))


# Moments by an integration rule: sums over its nodes with their weights.


# Rounding error of a sum of weighted terms, relative to their size.
_SUM_ROUNDING = 1e-12


def quadrature_moments(runs: xr.Dataset, quantity: QuantityOfInterest) -> NamedArrays:
    """Moments of an output by the weights of its runs.

    Yields
    ------
    name : str
        ``mean``, ``std``, ``skewness``, ``kurtosis``.
    estimate : DataArray
        Along ``bound``, without bounds: a quadrature rule gives no estimate of its error.
    """
    if quantity.output.categories:
        return
    title, unit = quantity.output.title, quantity.output.unit
    weights, used = runs[QUADRATURE_WEIGHT].values, runs[STATUS].values == Status.OK
    note = ""
    if not used.all():
        share = float(np.abs(weights[~used]).sum() / np.abs(weights).sum())
        note = (texts.ABSENT_NODES if CONDITIONAL in runs.attrs else texts.MISSING_NODES).format(
            failed=np.count_nonzero(~used), nodes=len(used), share=100 * share
        )
    values = runs[quantity.output.name].values[used].astype(np.float64)
    found = _integrals(values, weights[used])
    for statistic, (value, reason) in zip(
        ("mean", "std", "skewness", "kurtosis"), found, strict=True
    ):
        long_name = "standard deviation" if statistic == "std" else statistic
        estimate = Estimate.without_bounds(value, reason, note)
        units = unit if statistic in ("mean", "std") else "1"
        yield statistic, estimate.to_array(units=units, long_name=f"{long_name} of {title}")


def _integrals(values: FloatArray, weights: FloatArray) -> Iterator[tuple[float, str]]:
    """Yield the moments, each with the reason why it has no interval, or is NaN."""
    total = float(weights.sum())
    if not values.size or not total > _SUM_ROUNDING:
        yield from [(math.nan, texts.NO_WEIGHT if values.size else texts.NO_RUN)] * 4
        return
    weights = weights / total
    # About a value of its own a constant comes out exactly; over the largest no sum overflows.
    first, largest = float(values[0]), float(np.abs(values).max()) or 1.0
    mean = first + float(((values / largest - first / largest) * weights).sum()) * largest
    yield mean, texts.NO_SCATTER_OF_RULE
    scale = float(np.abs(values - mean).max())
    if not scale > 0:
        yield 0.0, texts.CONSTANT_OUTPUT
        yield from [(math.nan, texts.CONSTANT_OUTPUT)] * 2
        return
    # Powers of the deviations over the largest of them neither overflow nor vanish.
    deviations = (values - mean) / scale
    second, third, fourth = (float((deviations**power * weights).sum()) for power in (2, 3, 4))
    if not second > _SUM_ROUNDING:
        yield from [(math.nan, texts.IMPOSSIBLE_MOMENT.format(moment="variance"))] * 3
        return
    skewness, kurtosis = float(third / second**1.5), fourth / second**2
    yield math.sqrt(second) * scale, texts.NO_SCATTER_OF_RULE
    yield skewness, texts.NO_SCATTER_OF_RULE
    # No distribution has less (Pearson 1916, Phil. Trans. R. Soc. A 216, 429-457).
    if kurtosis < (1 + skewness**2) * (1 - _SUM_ROUNDING):
        yield math.nan, texts.IMPOSSIBLE_MOMENT.format(moment="kurtosis")
    else:
        yield kurtosis, texts.NO_SCATTER_OF_RULE
