"""Quantiles, the values that hold with a given probability, and a spread made of quantiles."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.analyses.estimate import LEVEL, Interval, bounded, reason_for_none
from uqpen.analyses.question import Question
from uqpen.analyses.sample import Plan, Sample
from uqpen.intervals import order_statistic_ranks, runs_needed, student_quantile, upper_rank

__all__ = ["FEWEST_BEYOND", "half_spread", "holds", "quantiles"]

FloatArray = npt.NDArray[np.float64]

# Fewer runs than this beyond a value tell too little of how replicates scatter there.
FEWEST_BEYOND = 10

# About one standard deviation either side of the median, for a normal law.
_LOW, _HIGH = 0.16, 0.84

_PROBABILITY_OF_HOLDING = {"units": "1", "long_name": "probability of not exceeding the value"}

_ORDER_STATISTICS = "order statistics (binomial)"
_WOODRUFF = "Woodruff, over replicates"
_MIXED = f"{_WOODRUFF}; {_ORDER_STATISTICS} with fewer than {FEWEST_BEYOND} runs beyond"


def quantiles(sample: Sample, question: Question) -> Iterator[tuple[str, xr.DataArray]]:
    """The quantiles asked of an output.

    Yields
    ------
    name : str
        The output's.
    estimate : DataArray
        Along ``<output>_probability`` and ``bound``.
    """
    if question.output.categories:
        return
    name, asked = question.output.name, np.array(question.quantiles)
    dimension = f"{name}_probability"
    estimate = quantile(sample, asked)
    if reason := reason_for_none(sample):
        lower = upper = np.full(asked.shape, np.nan)
        interval = Interval.none(reason)
    else:
        lower, upper = _two_sided(sample, asked)
        interval = _interval(sample, asked)
    array = bounded(
        estimate,
        lower,
        upper,
        interval,
        dims=(dimension,),
        units=question.output.unit,
        long_name=f"quantiles of {question.output.title}",
    )
    described = {"units": "1", "long_name": "probability of lying below the quantile"}
    yield name, array.assign_coords({dimension: (dimension, asked, described)})


def holds(sample: Sample, question: Question) -> Iterator[tuple[str, xr.DataArray]]:
    """The values not exceeded with the probabilities asked, with one-sided upper bounds.

    Yields
    ------
    name : str
        The output's.
    estimate : DataArray
        Along ``<output>_hold`` and ``bound``, the lower bound being NaN; the coordinate
        ``<output>_runs_needed`` says how many independent runs an upper bound takes.
    """
    if question.output.categories or not question.hold:
        return
    name, asked = question.output.name, np.array(question.hold)
    dimension = f"{name}_hold"
    if reason := reason_for_none(sample):
        upper = np.full(asked.shape, np.nan)
        interval = Interval.none(reason)
    else:
        upper = _one_sided(sample, asked)
        method = _MIXED if sample.plan is Plan.REPLICATED else _ORDER_STATISTICS
        label = "conservative" if sample.plan is Plan.SINGLE else "discrete"
        interval = Interval(f"one-sided, {method}", label)
    array = bounded(
        quantile(sample, asked),
        np.nan,
        upper,
        interval,
        dims=(dimension,),
        units=question.output.unit,
        long_name=f"value that {question.output.title} does not exceed with a probability",
    )
    needed = [runs_needed(p, LEVEL) for p in question.hold]
    described = {"units": "1", "long_name": "independent runs that an upper bound takes at least"}
    yield (
        name,
        array.assign_coords(
            {
                dimension: (dimension, asked, _PROBABILITY_OF_HOLDING),
                f"{name}_runs_needed": (dimension, needed, described),
            }
        ),
    )


def half_spread(sample: Sample, units: str, title: str) -> xr.DataArray:
    """Half the distance from the 16 % to the 84 % quantile.

    For a normal law it is the standard deviation all but for half a per cent; unlike that, it has
    an interval on a heavy tail too. Its ends are as far off as Woodruff's of both quantiles, by the
    correlation of their errors (Zou, G. Y. (2007). Psychol. Methods 12, 399-413).
    """
    long_name = f"half the distance from the 16 % to the 84 % quantile of {title}"
    asked = np.array([_LOW, _HIGH])
    low, high = quantile(sample, asked).tolist()
    estimate = (high - low) / 2
    reason = reason_for_none(sample)
    if not reason and sample.size * _LOW < FEWEST_BEYOND:
        reason = f"{sample.size} runs are too few"
    if reason:
        none = Interval.none(reason)
        return bounded(estimate, math.nan, math.nan, none, units=units, long_name=long_name)
    below = [(sample.values <= value).astype(np.float64) for value in (low, high)]
    told = [sample.standard_error(column) for column in (*below, below[1] - below[0])]
    (error_low, freedom), (error_high, _), (error_between, _) = told
    together = error_low**2 + error_high**2 - error_between**2
    product = 2 * error_low * error_high
    correlation = min(max(together / product, -1.0), 1.0) if product else 0.0
    errors = np.maximum([error_low, error_high], sample.rounding_error)
    step = student_quantile(freedom, LEVEL) * errors
    down = np.array([low, high]) - quantile(sample, np.clip(asked - step, 0.0, 1.0))
    up = quantile(sample, np.clip(asked + step, 0.0, 1.0)) - np.array([low, high])
    lower = estimate - _combined(up[0], down[1], correlation) / 2
    upper = estimate + _combined(down[0], up[1], correlation) / 2
    interval = Interval(
        f"two Woodruff intervals combined, {sample.plan}",
        "conservative" if sample.plan is Plan.SINGLE else "discrete",
    )
    return bounded(estimate, lower, upper, interval, units=units, long_name=long_name)


def _combined(low: float, high: float, correlation: float) -> float:
    """How far off a difference may be whose terms may be off so far."""
    return math.sqrt(max(low**2 + high**2 - 2 * correlation * low * high, 0.0))


def quantile(sample: Sample, probability: npt.ArrayLike) -> FloatArray:
    """Median-unbiased quantiles of a sample (Hyndman & Fan 1996, Am. Stat. 50, 361-365, no. 8)."""
    p = np.asarray(probability, dtype=np.float64)
    if not sample.size:
        return np.full(p.shape, np.nan)
    position = np.clip(p * (sample.size + 1 / 3) + 1 / 3, 1, sample.size) - 1
    below = np.floor(position).astype(np.int64)
    above = np.minimum(below + 1, sample.size - 1)
    low, high = sample.ordered[below], sample.ordered[above]
    between: FloatArray = low + (position - below) * (high - low)
    return between


def _interval(sample: Sample, asked: FloatArray) -> Interval:
    if sample.plan is Plan.REPLICATED:
        if not _is_regular(sample, asked).all():
            return Interval(_MIXED, "discrete")
        is_rounded = (_errors_of_cdf(sample, asked) <= sample.rounding_error).any()
        return Interval(_WOODRUFF, "discrete" if is_rounded else "nominal")
    return Interval(_ORDER_STATISTICS, "conservative" if sample.plan is Plan.SINGLE else "discrete")


def _two_sided(sample: Sample, asked: FloatArray) -> tuple[FloatArray, FloatArray]:
    lower, upper = order_statistic_ranks(sample.size, asked, LEVEL)
    low, high = _at_rank(sample, lower), _at_rank(sample, upper)
    if sample.plan is not Plan.REPLICATED:
        return low, high
    step = student_quantile(sample.replicates - 1, LEVEL) * _errors_of_cdf(sample, asked)
    regular = _is_regular(sample, asked)
    # So many runs, a whole number, lie below the quantile at least, and at most.
    fewest, most = np.ceil(sample.size * (asked - step)), np.floor(sample.size * (asked + step))
    return (
        np.where(regular & (fewest >= 1), _at_rank(sample, fewest), low),
        np.where(regular & (most < sample.size), _at_rank(sample, most + 1), high),
    )


def _one_sided(sample: Sample, asked: FloatArray) -> FloatArray:
    high = _at_rank(sample, upper_rank(sample.size, asked, LEVEL))
    if sample.plan is not Plan.REPLICATED:
        return high
    # A one-sided bound at 95 % is the upper end of a two-sided interval at 90 %.
    step = student_quantile(sample.replicates - 1, 2 * LEVEL - 1) * _errors_of_cdf(sample, asked)
    most = np.floor(sample.size * (asked + step))
    regular = _is_regular(sample, asked) & (most < sample.size)
    return np.where(regular, _at_rank(sample, most + 1), high)


def _is_regular(sample: Sample, asked: FloatArray) -> npt.NDArray[np.bool_]:
    """Where enough runs lie on either side for replicates to tell the error."""
    fewest: npt.NDArray[np.bool_] = sample.size * np.minimum(asked, 1 - asked) >= FEWEST_BEYOND
    return fewest


def _errors_of_cdf(sample: Sample, asked: FloatArray) -> FloatArray:
    """Standard error of the empirical distribution function at each quantile.

    Woodruff, R. S. (1952). J. Am. Stat. Assoc. 47, 635-646; from the scatter over replicates, and
    at least what counting whole runs may make it.
    """
    values = quantile(sample, asked)
    errors = [sample.standard_error((sample.values <= value) * 1.0)[0] for value in values]
    return np.maximum(errors, sample.rounding_error)


def _at_rank(sample: Sample, rank: FloatArray) -> FloatArray:
    """Values at ranks counted from 1; NaN where there is no such rank."""
    exists = (rank >= 1) & (rank <= sample.size)
    index = np.where(exists, rank, 1).astype(np.int64) - 1
    return np.where(exists, sample.ordered[index], np.nan)
