"""Probabilities: of exceeding a value, of each kind, and the whole distribution function."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.analyses.estimate import LEVEL, Interval, bounded, reason_for_none
from uqpen.analyses.quantiles import FEWEST_BEYOND, quantile
from uqpen.analyses.question import Question
from uqpen.analyses.sample import Plan, Sample
from uqpen.intervals import (
    clopper_pearson,
    dkw_half_width,
    student_quantile,
)
from uqpen.labels import RANK, STATUS, STATUS_TEXT, Status

__all__ = ["RANKS", "cdf", "exceedance", "shares", "statuses"]

FloatArray = npt.NDArray[np.float64]

# A distribution function is kept at this many equally spaced probabilities.
RANKS = 1001

_BINOMIAL = "Clopper-Pearson"
_FEW = f"Clopper-Pearson with fewer than {FEWEST_BEYOND} runs on a side"


class _Probabilities(NamedTuple):
    """Estimates with bounds, and how they were made."""

    estimate: FloatArray
    lower: FloatArray
    upper: FloatArray
    interval: Interval


def exceedance(sample: Sample, question: Question) -> Iterator[tuple[str, xr.DataArray]]:
    """Probability that an output exceeds each of the values asked.

    Yields
    ------
    name : str
        The output's.
    estimate : DataArray
        Along ``<output>_threshold`` (as written; ``<output>_threshold_value`` in SI) and
        ``bound``.
    """
    if not question.exceeds:
        return
    name = question.output.name
    dimension = f"{name}_threshold"
    values = np.array([threshold.value for threshold in question.exceeds])
    array = bounded(
        *_probabilities(sample, sample.values[:, np.newaxis] > values),
        dims=(dimension,),
        units="1",
        long_name=f"probability that {question.output.title} exceeds a value",
    )
    written = np.array([threshold.text for threshold in question.exceeds], dtype=object)
    described = {"units": question.output.unit, "long_name": "value exceeded"}
    yield (
        name,
        array.assign_coords(
            {
                dimension: (dimension, written, {"long_name": "value exceeded, as written"}),
                f"{dimension}_value": (dimension, values, described),
            }
        ),
    )


def shares(sample: Sample, question: Question) -> Iterator[tuple[str, xr.DataArray]]:
    """Probability of each kind of an output that has kinds.

    Yields
    ------
    name : str
        The output's.
    estimate : DataArray
        Along ``<output>_category`` and ``bound``.
    """
    categories = question.output.categories
    if not categories:
        return
    name = question.output.name
    dimension = f"{name}_category"
    array = bounded(
        *_probabilities(sample, sample.values[:, np.newaxis] == np.arange(len(categories))),
        dims=(dimension,),
        units="1",
        long_name=f"share of {question.output.title}",
    )
    flags = np.array([category.flag for category in categories], dtype=object)
    labels = np.array([category.label for category in categories], dtype=object)
    yield (
        name,
        array.assign_coords(
            {
                dimension: (dimension, flags, {"long_name": "kind"}),
                f"{dimension}_label": (dimension, labels, {"long_name": "kind, to be read"}),
            }
        ),
    )


def statuses(runs: xr.Dataset) -> Iterator[tuple[str, xr.DataArray]]:
    """Probability of each way in which runs of a design were lost.

    Parameters
    ----------
    runs : Dataset
        With ``status(run)``.

    Yields
    ------
    name : str
        The status.
    estimate : DataArray
        Along ``bound``.
    """
    sample = Sample.of(runs, STATUS, with_lost=True)
    found = [status for status in Status if status and (sample.values == status).any()]
    estimates = _probabilities(sample, sample.values[:, np.newaxis] == np.array(found))
    for position, status in enumerate(found):
        yield (
            status.meaning,
            bounded(
                estimates.estimate[position],
                estimates.lower[position],
                estimates.upper[position],
                estimates.interval,
                units="1",
                long_name=f"probability that a run is {STATUS_TEXT[status]}",
            ),
        )


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

    pointwise = _below(sample, values)
    yield (
        f"{name}_probability",
        bounded(
            *pointwise,
            dims=(RANK,),
            units="1",
            long_name=f"probability that {title} lies below a value, pointwise",
        ).assign_coords(coordinate),
    )
    half = np.nan if reason_for_none(sample) else dkw_half_width(sample.size, LEVEL)
    yield (
        f"{name}_band",
        bounded(
            pointwise.estimate,
            np.maximum(pointwise.estimate - half, 0.0),
            np.minimum(pointwise.estimate + half, 1.0),
            _band_interval(sample),
            dims=(RANK,),
            units="1",
            long_name=f"probability that {title} lies below a value, simultaneous",
        ).assign_coords(coordinate),
    )


def _band_interval(sample: Sample) -> Interval:
    if reason := reason_for_none(sample):
        return Interval.none(reason)
    # On stratified points the band is wider than need be: the function scatters less than it does
    # over independent draws.
    label = "nominal" if sample.plan is Plan.INDEPENDENT else "conservative"
    return Interval("simultaneous, Dvoretzky-Kiefer-Wolfowitz-Massart", label)


def _probabilities(sample: Sample, events: npt.NDArray[np.bool_]) -> _Probabilities:
    """Probabilities of events, each a column over the runs."""
    told = [
        sample.standard_error(column.astype(np.float64)) if sample.size > 1 else (np.nan, 0)
        for column in events.T
    ]
    errors, freedoms = np.array(told).reshape(-1, 2).T
    freedom = freedoms[0] if freedoms.size else 0
    return _from_counts(sample, events.sum(axis=0), errors, freedom)


def _below(sample: Sample, values: FloatArray) -> _Probabilities:
    """The distribution function at many values at once."""
    if not sample.size:
        return _from_counts(sample, np.zeros(values.shape), np.full(values.shape, np.nan), 0)
    counts = sample.counts(values)
    total = counts.sum(axis=0)
    errors = np.full(values.shape, np.nan)
    if sample.plan is Plan.REPLICATED:
        # The same ratio error as of any mean, from counts in place of a column of events a value.
        excess = counts - np.outer(sample.replicate_sizes(), total / sample.size)
        replicates = sample.replicates
        variance = (excess**2).sum(axis=0) * replicates / (replicates - 1) / sample.size**2
        errors = np.sqrt(variance)
    return _from_counts(sample, total, errors, sample.replicates - 1)


def _from_counts(
    sample: Sample, events: npt.ArrayLike, errors: FloatArray, freedom: float
) -> _Probabilities:
    """Estimates from counts, with the t interval where its condition holds, else the binomial."""
    counted = np.asarray(events, dtype=np.float64)
    missing = np.full(counted.shape, np.nan)
    if not sample.size:
        return _Probabilities(missing, missing, missing, Interval.none(reason_for_none(sample)))
    estimate = counted / sample.size
    if reason := reason_for_none(sample):
        return _Probabilities(estimate, missing, missing, Interval.none(reason))
    lower, upper = clopper_pearson(counted, sample.size, LEVEL)
    if sample.plan is Plan.INDEPENDENT:
        return _Probabilities(estimate, lower, upper, Interval(_BINOMIAL, "discrete"))
    regular = np.minimum(counted, sample.size - counted) >= FEWEST_BEYOND
    regular &= np.isfinite(errors)
    halves = student_quantile(freedom, LEVEL) * np.maximum(errors, sample.rounding_error)
    lower = np.where(regular, np.maximum(estimate - halves, 0.0), lower)
    upper = np.where(regular, np.minimum(estimate + halves, 1.0), upper)
    is_rounded = bool((errors < sample.rounding_error)[regular].any())
    interval = _t_interval(sample, regular, is_rounded=is_rounded)
    return _Probabilities(estimate, lower, upper, interval)


def _t_interval(sample: Sample, regular: npt.NDArray[np.bool_], *, is_rounded: bool) -> Interval:
    over = "over replicates" if sample.plan is Plan.REPLICATED else "on additive residuals"
    if not regular.any():
        return Interval(_BINOMIAL, "conservative")
    method = f"Student t {over}" if regular.all() else f"Student t {over}; {_FEW}"
    if sample.plan is Plan.SINGLE:
        return Interval(method, "conservative")
    return Interval(method, "discrete" if is_rounded or not regular.all() else "nominal")
