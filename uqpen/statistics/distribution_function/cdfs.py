"""The distribution function of an output, with a pointwise and a simultaneous band."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.labels import BOUND, BOUNDS, INTERVAL, INTERVAL_LABEL, INTERVAL_LEVEL, NOTE, RANK
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_beside, sample_quantile
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.intervals import clopper_pearson, dkw_half_width, student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.standard_errors import rounding_error

__all__ = ["RANKS", "cdf", "cdf_at_values"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
# Estimate, lower and upper bound at each value, and what to say of them.
Band = tuple[FloatArray, dict[str, str | float]]

# A distribution function is kept at this many equally spaced probabilities.
RANKS = 1001


def cdf(sample: Sample, quantity: QuantityOfInterest) -> Iterator[tuple[str, xr.DataArray]]:
    """The distribution function at equally spaced ranks, with two bands.

    The pointwise band is for a value fixed beforehand; the simultaneous one covers the whole
    function at once, so it is right for a value chosen after looking.

    Yields
    ------
    name : str
        ``<output>``: the values along ``rank``; ``<output>_probability`` and ``<output>_band``:
        the function there, with pointwise and with simultaneous bounds.
    estimate : DataArray
    """
    if quantity.output.categories:
        return
    name, title = quantity.output.name, quantity.output.title
    ranks = np.linspace(0.0, 1.0, RANKS)
    coordinate = {RANK: (RANK, ranks, {"units": "1", "long_name": "probability of lying below"})}
    values = sample_quantile(sample, ranks)
    described = {"units": quantity.output.unit, "long_name": f"values of {title}"}
    yield name, xr.DataArray(values, coordinate, (RANK,), attrs=described)
    for suffix, which, (estimate, attributes) in zip(
        ("probability", "band"), ("pointwise", "simultaneous"), _bands(sample, values), strict=True
    ):
        attributes |= {"units": "1"}
        attributes["long_name"] = f"probability that {title} lies below a value, {which}"
        array = xr.DataArray(estimate, {BOUND: list(BOUNDS)}, (RANK, BOUND), attrs=attributes)
        yield f"{name}_{suffix}", array.assign_coords(coordinate)


def cdf_at_values(sample: Sample, values: FloatArray) -> xr.DataArray:
    """The distribution function at values of one's own, with the simultaneous band there.

    Parameters
    ----------
    sample : Sample
    values : ndarray, shape (value,)
        In SI units.

    Returns
    -------
    DataArray
        Along ``value`` and ``bound``: what the archive's function is at those of its ranks.
    """
    _, (estimate, attributes) = _bands(sample, values)
    return xr.DataArray(estimate, {BOUND: list(BOUNDS)}, ("value", BOUND), attrs=attributes)


def _bands(sample: Sample, values: FloatArray) -> tuple[Band, Band]:
    """The pointwise and the simultaneous band at some values."""
    if not sample.size:
        missing = np.full(values.shape, np.nan)
        return _without_bounds(sample, missing), _without_bounds(sample, missing)
    counts = _counts(sample, values)
    estimate: FloatArray = counts.sum(axis=0) / sample.size
    if sample.reason_without_intervals:
        return _without_bounds(sample, estimate), _without_bounds(sample, estimate)
    return _pointwise(sample, counts, estimate), _simultaneous(sample, estimate)


def _counts(sample: Sample, values: FloatArray) -> IntArray:
    """How many runs lie at or below each value, a row for each replicate."""
    parts = [
        np.sort(sample.values[sample.replicate == number])
        for number in range(sample.replicate_count)
    ]
    return np.array([np.searchsorted(part, values, side="right") for part in parts])


def _pointwise(sample: Sample, counts: IntArray, estimate: FloatArray) -> Band:
    total = counts.sum(axis=0)
    lower, upper = clopper_pearson(total, sample.size, LEVEL)
    method, label = "Clopper-Pearson", "conservative"
    if sample.error_model is ErrorModel.INDEPENDENT:
        label = "discrete"
    elif sample.error_model is ErrorModel.REPLICATED:
        half = student_quantile(sample.degrees_of_freedom, LEVEL) * _errors(sample, counts)
        regular = has_enough_runs_beside(sample, total)
        lower = np.where(regular, np.maximum(estimate - half, 0.0), lower)
        upper = np.where(regular, np.minimum(estimate + half, 1.0), upper)
        method = "Student t over replicates; Clopper-Pearson with fewer than 10 runs on a side"
        label = "discrete"
    return np.stack([estimate, lower, upper], axis=-1), _interval_attributes(method, label)


def _errors(sample: Sample, counts: IntArray) -> FloatArray:
    """Standard errors over replicates at all values at once, as `ratio_error` has them at one."""
    sizes = np.bincount(sample.replicate)
    excess = counts - np.outer(sizes, counts.sum(axis=0) / sample.size)
    replicates = len(sizes)
    variance = (excess**2).sum(axis=0) * replicates / (replicates - 1) / sample.size**2
    errors: FloatArray = np.maximum(np.sqrt(variance), rounding_error(sample))
    return errors


def _simultaneous(sample: Sample, estimate: FloatArray) -> Band:
    half = dkw_half_width(sample.size, LEVEL)
    # On stratified points the band is wider than need be: the function scatters less than it does
    # over independent draws.
    label = "nominal" if sample.error_model is ErrorModel.INDEPENDENT else "conservative"
    lower, upper = np.maximum(estimate - half, 0.0), np.minimum(estimate + half, 1.0)
    attributes = _interval_attributes("Dvoretzky-Kiefer-Wolfowitz-Massart", label)
    return np.stack([estimate, lower, upper], axis=-1), attributes


def _interval_attributes(method: str, label: str) -> dict[str, str | float]:
    return {INTERVAL: method, INTERVAL_LABEL: label, INTERVAL_LEVEL: LEVEL}


def _without_bounds(sample: Sample, estimate: FloatArray) -> Band:
    none = np.full(estimate.shape, np.nan)
    attributes: dict[str, str | float] = {INTERVAL: "none", INTERVAL_LABEL: "none"}
    attributes[NOTE] = sample.reason_without_intervals
    return np.stack([estimate, none, none], axis=-1), attributes
