"""Tolerance limits: values that bound a share of all cases, with confidence.

Wilks, S. S. (1941). Ann. Math. Statist. 12, 91-96. The runs split the probability into blocks, one
more than there are runs. How much of the probability some of the blocks contain does not depend
on which they are: an upper limit takes those below it, a lower limit those above it, and an
interval those in the middle.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.labels import CONTENT_LEVEL, INTERVAL_CONTENT, LOWER_CONTENT
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import (
    has_enough_runs_around,
    order_statistic,
    sample_quantile,
)
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import (
    runs_needed,
    runs_needed_for_both,
    student_quantile,
    upper_rank,
)
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Column, ErrorModel, Sample
from uqpen.statistics.standard_errors import probability_error

__all__ = ["lower_tolerance_limits", "tolerance_intervals", "tolerance_limits"]

Estimator = Callable[[Sample, float], Estimate]


def tolerance_limits(
    sample: Sample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Estimate one-sided upper tolerance limits of an output for the requested contents.

    Yields
    ------
    name : str
        ``tolerance_limit``.
    estimate : DataArray
        Along ``content`` and ``bound``. The upper bound is the tolerance limit, and the lower
        bound is NaN. The coordinate ``content_runs_needed`` is the least number of independent
        runs with an upper bound.
    """
    request = _Request(
        quantity.tolerance_contents,
        CONTENT_LEVEL,
        "probability of not exceeding the value",
        texts.RUNS_NEEDED,
        "value that {title} does not exceed with a probability",
    )
    yield from _stacked("tolerance_limit", sample, quantity, request, _upper_limit, runs_needed)


def lower_tolerance_limits(
    sample: Sample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Estimate one-sided lower tolerance limits of an output for the requested contents.

    Yields
    ------
    name : str
        ``lower_tolerance_limit``.
    estimate : DataArray
        Along ``lower_content`` and ``bound``. The lower bound is the tolerance limit, and the
        upper bound is NaN. The coordinate ``lower_content_runs_needed`` is the least number of
        independent runs with a lower bound.
    """
    request = _Request(
        quantity.lower_tolerance_contents,
        LOWER_CONTENT,
        "probability of not lying below the value",
        texts.RUNS_NEEDED_BELOW,
        "value that {title} does not lie below with a probability",
    )
    name = "lower_tolerance_limit"
    yield from _stacked(name, sample, quantity, request, _lower_limit, runs_needed)


def tolerance_intervals(
    sample: Sample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Estimate two-sided tolerance intervals of an output for the requested contents.

    As many runs are left out below an interval as above it. It contains its share of all cases as
    a whole; the shares below and above it may differ.

    Yields
    ------
    name : str
        ``tolerance_interval``.
    estimate : DataArray
        Along ``interval_content`` and ``bound``. The bounds are the ends of the interval, and
        there is no estimate between them. The coordinate ``interval_content_runs_needed`` is the
        least number of independent runs with both ends.
    """
    request = _Request(
        quantity.tolerance_interval_contents,
        INTERVAL_CONTENT,
        "probability of lying between the values",
        texts.RUNS_NEEDED_FOR_BOTH,
        "values between which {title} lies with a probability",
    )
    name, estimated, needed = "tolerance_interval", _interval, runs_needed_for_both
    yield from _stacked(name, sample, quantity, request, estimated, needed)


class _Request(NamedTuple):
    """Contents of tolerance limits, and the words for them in an archive."""

    contents: Sequence[float]
    dimension: str
    of_content: str
    of_runs: str
    of_values: str  # with a placeholder for the title of the output


def _stacked(
    name: str,
    sample: Sample,
    quantity: QuantityOfInterest,
    request: _Request,
    estimated: Estimator,
    needed: Callable[[float, float], int],
) -> Iterator[tuple[str, xr.DataArray]]:
    """Yield the tolerance limits of all requested contents as one estimate array."""
    dimension, contents = request.dimension, request.contents
    if quantity.output.categories or not contents:
        return
    runs = [needed(content, sample.level) for content in contents]
    coordinates = {
        dimension: (
            dimension,
            np.array(contents),
            {"units": "1", "long_name": request.of_content},
        ),
        f"{dimension}_runs_needed": (
            dimension,
            runs,
            {"units": "1", "long_name": request.of_runs},
        ),
    }
    array = Estimate.stack(
        [estimated(sample, content) for content in contents],
        dimension,
        units=quantity.output.unit,
        long_name=request.of_values.format(title=quantity.output.title),
        coordinates=coordinates,
        level=sample.level,
    )
    yield name, array


class _Limit(NamedTuple):
    """One-sided tolerance limit of a sample: the quantile it bounds, and which runs are inside it.

    The bounds follow from the number of blocks that the limit takes.
    """

    quantile: float
    inside: tuple[Column, Column]
    bounds: Callable[[float], tuple[float, float]]
    too_few_runs: str  # with a placeholder for the fewest


def _upper_limit(sample: Sample, content: float) -> Estimate:
    """Estimate a quantile with a one-sided upper bound."""
    value = float(sample_quantile(sample, content))
    inside = sample.event(operator.le, value), sample.event(operator.lt, value)

    def bounds(blocks: float) -> tuple[float, float]:
        return math.nan, float(order_statistic(sample, blocks))

    limit = _Limit(value, inside, bounds, texts.UPPER_BOUND_NEEDS)
    return _one_sided(sample, content, limit)


def _lower_limit(sample: Sample, content: float) -> Estimate:
    """Estimate a quantile with a one-sided lower bound."""
    value = float(sample_quantile(sample, 1 - content))
    inside = sample.event(operator.ge, value), sample.event(operator.gt, value)

    def bounds(blocks: float) -> tuple[float, float]:
        return float(order_statistic(sample, sample.size + 1 - blocks)), math.nan

    limit = _Limit(value, inside, bounds, texts.LOWER_BOUND_NEEDS)
    return _one_sided(sample, content, limit)


def _one_sided(sample: Sample, content: float, limit: _Limit) -> Estimate:
    """Estimate the quantile of a limit, with its bound if there are enough runs."""
    if reason := sample.reason_without_intervals:
        return Estimate.without_bounds(limit.quantile, reason)
    for needed in _blocks(sample, content, limit.inside, content):
        if needed.blocks <= sample.size:
            lower, upper = limit.bounds(needed.blocks)
            method = texts.ONE_SIDED.format(method=needed.method)
            return Estimate(limit.quantile, lower, upper, method, needed.label)
    fewest = runs_needed(content, sample.level)
    return Estimate.without_bounds(limit.quantile, limit.too_few_runs.format(runs=fewest))


def _interval(sample: Sample, content: float) -> Estimate:
    """Estimate the ends of a tolerance interval."""
    if reason := sample.reason_without_intervals:
        return Estimate.without_bounds(math.nan, reason)
    tail = (1 - content) / 2
    low, high = sample_quantile(sample, [tail, 1 - tail])
    inside = (
        sample.event(operator.ge, low) & sample.event(operator.le, high),
        sample.event(operator.gt, low) & sample.event(operator.lt, high),
    )
    for needed in _blocks(sample, content, inside, 1 - tail):
        if needed.blocks < sample.size:
            # As many runs lie outside on either side, so an odd one stays inside.
            first = (sample.size - 1 - int(needed.blocks)) // 2 + 1
            lower = float(order_statistic(sample, first))
            upper = float(order_statistic(sample, sample.size + 1 - first))
            method = texts.TWO_SIDED.format(method=needed.method)
            return Estimate(math.nan, lower, upper, method, needed.label)
    fewest = runs_needed_for_both(content, sample.level)
    return Estimate.without_bounds(math.nan, texts.BOTH_ENDS_NEED.format(runs=fewest))


class _Blocks(NamedTuple):
    """Number of blocks between runs that have a content with confidence, and how it is known."""

    blocks: float
    method: str
    label: str


def _blocks(
    sample: Sample, content: float, inside: Sequence[Column], furthest: float
) -> Iterator[_Blocks]:
    """Yield the number of blocks that have a content, by the best method and by a safe one.

    Parameters
    ----------
    sample : Sample
        The runs.
    content : float
        The share of all cases.
    inside : sequence of ndarray of bool, shape (run,)
        The runs about inside the limits; with and without those at a limit, which may be an atom.
    furthest : float
        The probability below the outermost limit.
    """
    is_replicated = sample.error_model is ErrorModel.REPLICATED
    if is_replicated and bool(has_enough_runs_around(sample, sample.size * furthest)):
        error, freedom, is_rounded = max(map(partial(probability_error, sample), inside))
        # A one-sided bound at 95 % is the upper end of a two-sided interval at 90 %.
        step = student_quantile(freedom, 2 * sample.level - 1) * error
        needed = math.floor(sample.size * (content + float(step))) + 1
        yield _Blocks(needed, texts.WOODRUFF, "discrete" if is_rounded else "nominal")
    label = "discrete" if sample.error_model is ErrorModel.INDEPENDENT else "conservative"
    blocks = float(upper_rank(sample.size, content, sample.level))
    yield _Blocks(blocks, texts.ORDER_STATISTICS, label)
