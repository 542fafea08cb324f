"""The distribution function of an output, with a pointwise and a simultaneous band."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.labels import INTERVAL, INTERVAL_LABEL, INTERVAL_LEVEL, NOTE, RANK
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around, sample_quantile
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.intervals import clopper_pearson, dkw_half_width, student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.standard_errors import rounding_error

__all__ = ["RANKS", "cdf"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
# Estimate, lower and upper bound at each value, and their attributes.
Band = tuple[FloatArray, dict[str, str | float]]

# A distribution function is kept at this many equally spaced probabilities.
RANKS = 1001


def cdf(sample: Sample, quantity: QuantityOfInterest) -> Iterator[tuple[str, xr.DataArray]]:
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
        long_name = f"probability that {title} lies below a value, {which}"
        yield statistic, _band_array(band, RANK, long_name).assign_coords(coordinate)


def _band_array(band: Band, dimension: str, long_name: str) -> xr.DataArray:
    """Return a band as an estimate array along a dimension and ``bound``."""
    values, attributes = band
    texts = {name: str(attributes.get(name, "")) for name in INTERVAL_TEXTS}
    level = {key: value for key, value in attributes.items() if key == INTERVAL_LEVEL}
    return estimate_array(
        values, {dimension: len(values)}, texts, units="1", long_name=long_name, attributes=level
    )


def _bands(sample: Sample, values: FloatArray) -> tuple[Band, Band]:
    """Return the pointwise and the simultaneous band at some values."""
    if not sample.size:
        missing = np.full(values.shape, np.nan)
        return _without_bounds(sample, missing), _without_bounds(sample, missing)
    counts = _counts(sample, values)
    estimate: FloatArray = counts.sum(axis=0) / sample.size
    if sample.reason_without_intervals:
        return _without_bounds(sample, estimate), _without_bounds(sample, estimate)
    return _pointwise(sample, counts, estimate), _simultaneous(sample, estimate)


def _counts(sample: Sample, values: FloatArray) -> IntArray:
    """Count the runs at or below each value, a row for each replicate."""
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
        regular = has_enough_runs_around(sample, total)
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
