"""The distribution function of an output, with a pointwise and a simultaneous band."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.labels import RANK
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around, sample_quantile
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.intervals import ascending, clopper_pearson, dkw_half_width, student_interval
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.reweighting import ENOUGH_ON_A_SIDE
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.standard_errors import rounding_error
from uqpen.statistics.weights import (
    fewest_on_a_side,
    weighted_cdf,
    weighted_probability_interval,
)

# A distribution function is kept at this many equally spaced probabilities.
RANKS = 1001


def cdf(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Estimate the distribution function at equally spaced ranks, with two bands.

    The pointwise band is for a value fixed beforehand. The simultaneous band covers the whole
    function at once, so it is valid for a value chosen after looking at the data.

    Yields
    ------
    name : str
        ``cdf_value``: values of the output; ``cdf`` and ``cdf_band``: the distribution function
        at these values, with pointwise and with simultaneous bounds.
    estimate : DataArray
        Along ``rank``; ``cdf`` and ``cdf_band`` also along ``bound``.
    """
    if quantity.output.categories:
        return
    title = quantity.output.title
    ranks = np.linspace(0.0, 1.0, RANKS)
    coordinate = {RANK: (RANK, ranks, {"units": "1", "long_name": "probability of lying below"})}
    values = sample_quantile(sample, ranks)
    described = {"units": quantity.output.unit, "long_name": f"values of {title}"}
    yield "cdf_value", xr.DataArray(values, coordinate, (RANK,), attrs=described)
    pointwise, simultaneous = _bands(sample, values)
    for statistic, which, band in (
        ("cdf", "pointwise", pointwise),
        ("cdf_band", "simultaneous", simultaneous),
    ):
        yield (
            statistic,
            band.to_array(
                RANK,
                units="1",
                long_name=f"probability that {title} lies below a value, {which}",
                coordinates=coordinate,
                level=sample.level,
            ),
        )


def _bands(sample: Sample, values: FloatArray) -> tuple[Estimate, Estimate]:
    """Return the pointwise and the simultaneous band at some values; none is known with weights."""
    if sample.run_weights is not None and sample.size:
        estimate, errors = weighted_cdf(sample.values, sample.run_weights, values)
    else:
        counts = sample.count_up_to(values)
        estimate = counts / sample.size if sample.size else np.full(values.shape, np.nan)
    if reason := sample.reason_without_intervals:
        without = Estimate.without_bounds(estimate, reason)
        return without, without
    if sample.run_weights is None:
        return _pointwise(sample, values, counts), _simultaneous(sample, estimate)
    ends = weighted_probability_interval(estimate, errors, sample.run_weights, sample.level)
    lower, upper = map(ascending, ends)
    pointwise = Estimate(estimate, lower, upper, texts.CLOPPER_PEARSON_WEIGHTED, "nominal")
    if sample.is_reweighted:
        runs = fewest_on_a_side(sample.values, sample.run_weights, values)
        pointwise = pointwise.remove_bounds_at(runs < ENOUGH_ON_A_SIDE, texts.FEW_ON_A_SIDE)
    return pointwise, Estimate.without_bounds(estimate, texts.NO_WEIGHTED_BAND)


def _pointwise(sample: Sample, values: FloatArray, total: IntArray) -> Estimate:
    estimate = total / sample.size
    lower, upper = clopper_pearson(total, sample.size, sample.level)
    method, label = texts.CLOPPER_PEARSON, "conservative"
    if sample.error_model is ErrorModel.INDEPENDENT:
        label = "discrete"
    elif sample.error_model is ErrorModel.REPLICATED:
        errors = _errors(sample, values, estimate)
        freedom, level = sample.degrees_of_freedom, sample.level
        low, high = student_interval(estimate, errors, freedom, level, lowest=0.0, highest=1.0)
        regular = has_enough_runs_around(sample, total)
        # The scatter is another one at each value, and the next bound may be lower.
        lower = ascending(np.where(regular, low, lower))
        upper = ascending(np.where(regular, high, upper))
        method = texts.STUDENT_OR_CLOPPER_PEARSON
        label = "discrete"
    return Estimate(estimate, lower, upper, method, label)


def _errors(sample: Sample, values: FloatArray, estimate: FloatArray) -> FloatArray:
    """Standard errors over replicates at all values at once; `ratio_error` gives them at one."""
    squares, replicates = np.zeros((1, values.size)), 0
    for counts in sample.counts_by_replicate(values):
        sizes = sample.replicate_sizes[replicates : replicates + len(counts)]
        excess = counts - np.outer(sizes, estimate)
        squares = np.concatenate([squares, excess**2]).sum(axis=0, keepdims=True)
        replicates += len(counts)
    variance = squares[0] * replicates / (replicates - 1) / sample.size**2
    return np.maximum(np.sqrt(variance), rounding_error(sample))


def _simultaneous(sample: Sample, estimate: FloatArray) -> Estimate:
    half = dkw_half_width(sample.size, sample.level)
    # On stratified points the band is wider than need be: the function scatters less than it does
    # over independent draws.
    label = "nominal" if sample.error_model is ErrorModel.INDEPENDENT else "conservative"
    lower, upper = np.maximum(estimate - half, 0.0), np.minimum(estimate + half, 1.0)
    return Estimate(estimate, lower, upper, texts.SIMULTANEOUS_BAND, label)
