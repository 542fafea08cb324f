"""The distribution function of an output, with a pointwise and a simultaneous band."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.analyses.estimate import LEVEL
from uqpen.analyses.quantiles import is_regular, quantile
from uqpen.analyses.question import Question
from uqpen.analyses.sample import Plan, Sample
from uqpen.intervals import clopper_pearson, dkw_half_width, student_quantile
from uqpen.labels import BOUND, BOUNDS, RANK

__all__ = ["RANKS", "cdf"]

FloatArray = npt.NDArray[np.float64]

# A distribution function is kept at this many equally spaced probabilities.
RANKS = 1001


def cdf(sample: Sample, question: Question) -> Iterator[tuple[str, xr.DataArray]]:
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
    if question.output.categories:
        return
    name, title = question.output.name, question.output.title
    ranks = np.linspace(0.0, 1.0, RANKS)
    coordinate = {RANK: (RANK, ranks, {"units": "1", "long_name": "probability of lying below"})}
    values = quantile(sample, ranks)
    described = {"units": question.output.unit, "long_name": f"values of {title}"}
    yield name, xr.DataArray(values, coordinate, (RANK,), attrs=described)
    counts = sample.counts(values) if sample.size else np.zeros((1, RANKS), dtype=np.int64)
    for suffix, (estimate, attributes), which in (
        ("probability", _pointwise(sample, counts), "pointwise"),
        ("band", _simultaneous(sample, counts), "simultaneous"),
    ):
        attributes |= {"units": "1"}
        attributes["long_name"] = f"probability that {title} lies below a value, {which}"
        array = xr.DataArray(estimate, {BOUND: list(BOUNDS)}, (RANK, BOUND), attrs=attributes)
        yield f"{name}_{suffix}", array.assign_coords(coordinate)


def _pointwise(
    sample: Sample, counts: npt.NDArray[np.int64]
) -> tuple[FloatArray, dict[str, str | float]]:
    total = counts.sum(axis=0)
    if reason := sample.reason_for_none:
        return _without_bounds(sample, total, reason)
    estimate = total / sample.size
    lower, upper = clopper_pearson(total, sample.size, LEVEL)
    attributes = _told("Clopper-Pearson", "conservative")
    if sample.plan is Plan.INDEPENDENT:
        attributes = _told("Clopper-Pearson", "discrete")
    elif sample.plan is Plan.REPLICATED:
        half = student_quantile(sample.freedom, LEVEL) * _errors(sample, counts)
        regular = is_regular(sample, total)
        lower = np.where(regular, np.maximum(estimate - half, 0.0), lower)
        upper = np.where(regular, np.minimum(estimate + half, 1.0), upper)
        method = "Student t over replicates; Clopper-Pearson with fewer than 10 runs on a side"
        attributes = _told(method, "discrete")
    return np.stack([estimate, lower, upper], axis=-1), attributes


def _errors(sample: Sample, counts: npt.NDArray[np.int64]) -> FloatArray:
    """Standard errors over replicates at all values at once, as `ratio_error` has them at one."""
    sizes = np.bincount(sample.replicate)
    excess = counts - np.outer(sizes, counts.sum(axis=0) / sample.size)
    replicates = len(sizes)
    variance = (excess**2).sum(axis=0) * replicates / (replicates - 1) / sample.size**2
    errors: FloatArray = np.maximum(np.sqrt(variance), sample.rounding_error)
    return errors


def _simultaneous(
    sample: Sample, counts: npt.NDArray[np.int64]
) -> tuple[FloatArray, dict[str, str | float]]:
    total = counts.sum(axis=0)
    if reason := sample.reason_for_none:
        return _without_bounds(sample, total, reason)
    estimate = total / sample.size
    half = dkw_half_width(sample.size, LEVEL)
    # On stratified points the band is wider than need be: the function scatters less than it does
    # over independent draws.
    label = "nominal" if sample.plan is Plan.INDEPENDENT else "conservative"
    lower, upper = np.maximum(estimate - half, 0.0), np.minimum(estimate + half, 1.0)
    attributes = _told("Dvoretzky-Kiefer-Wolfowitz-Massart", label)
    return np.stack([estimate, lower, upper], axis=-1), attributes


def _told(method: str, label: str) -> dict[str, str | float]:
    return {"interval": method, "interval_label": label, "interval_level": LEVEL}


def _without_bounds(
    sample: Sample, total: npt.NDArray[np.int64], reason: str
) -> tuple[FloatArray, dict[str, str | float]]:
    estimate = np.full((len(total), len(BOUNDS)), np.nan)
    if sample.size:
        estimate[:, 0] = total / sample.size
    return estimate, {"interval": "none", "interval_label": "none", "note": reason}
