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

from uqpen.core.labels import CONTENT_LEVEL, INTERVAL_CONTENT, LOWER_CONTENT
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import (
    has_enough_runs_around,
    order_statistic,
    sample_quantile,
)
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.intervals import (
    runs_needed,
    runs_needed_for_both,
    student_quantile,
    upper_rank,
)
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Column, ErrorModel, Sample
from uqpen.statistics.standard_errors import probability_error


class _Kind(NamedTuple):
    """Kind of tolerance limits: its name and dimension, and the words for it in an archive."""

    name: str
    dimension: str
    of_content: str
    of_runs: str
    of_values: str  # with a placeholder for the title of the output
    estimate: Callable[[Sample, float], Estimate]
    runs_needed: Callable[[float, float], int]

    def arrays(
        self, sample: Sample, quantity: QuantityOfInterest, contents: Sequence[float]
    ) -> NamedArrays:
        """Yield the limits of all contents as one estimate array."""
        if quantity.output.categories or not contents:
            return
        runs = [self.runs_needed(content, sample.level) for content in contents]
        along = {
            name: (self.dimension, values, {"units": "1", "long_name": long_name})
            for name, values, long_name in (
                (self.dimension, np.array(contents), self.of_content),
                (f"{self.dimension}_runs_needed", runs, self.of_runs),
            )
        }
        array = Estimate.stack(
            [self.estimate(sample, content) for content in contents],
            self.dimension,
            units=quantity.output.unit,
            long_name=self.of_values.format(title=quantity.output.title),
            coordinates=along,
            level=sample.level,
        )
        yield self.name, array


def tolerance_limits(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
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
    yield from _UPPER.arrays(sample, quantity, quantity.tolerance_contents)


def lower_tolerance_limits(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Estimate one-sided lower tolerance limits of an output for the requested contents.

    Yields
    ------
    name : str
        ``lower_tolerance_limit``.
    estimate : DataArray
        As of an upper one, along ``lower_content``: the lower bound is the tolerance limit.
    """
    yield from _LOWER.arrays(sample, quantity, quantity.lower_tolerance_contents)


def tolerance_intervals(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
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
    yield from _INTERVAL.arrays(sample, quantity, quantity.tolerance_interval_contents)


def _upper_limit(sample: Sample, content: float) -> Estimate:
    """Estimate a quantile with a one-sided upper bound."""
    value = float(sample_quantile(sample, content))
    inside = sample.event(operator.le, value), sample.event(operator.lt, value)
    for blocks, method, label in _blocks(sample, content, inside, content):
        if blocks <= sample.size:
            limit = float(order_statistic(sample, blocks))
            return Estimate(value, math.nan, limit, texts.ONE_SIDED.format(method=method), label)
    return _without_limit(sample, content, value, texts.UPPER_BOUND_NEEDS)


def _lower_limit(sample: Sample, content: float) -> Estimate:
    """Estimate a quantile with a one-sided lower bound."""
    value = float(sample_quantile(sample, 1 - content))
    inside = sample.event(operator.ge, value), sample.event(operator.gt, value)
    for blocks, method, label in _blocks(sample, content, inside, content):
        if blocks <= sample.size:
            limit = float(order_statistic(sample, sample.size + 1 - blocks))
            return Estimate(value, limit, math.nan, texts.ONE_SIDED.format(method=method), label)
    return _without_limit(sample, content, value, texts.LOWER_BOUND_NEEDS)


def _without_limit(sample: Sample, content: float, value: float, too_few_runs: str) -> Estimate:
    needed = too_few_runs.format(runs=runs_needed(content, sample.level))
    return Estimate.without_bounds(value, sample.reason_without_intervals or needed)


def _interval(sample: Sample, content: float) -> Estimate:
    """Estimate the ends of a tolerance interval."""
    tail = (1 - content) / 2
    low, high = sample_quantile(sample, [tail, 1 - tail])
    inside = (
        sample.event(operator.ge, low) & sample.event(operator.le, high),
        sample.event(operator.gt, low) & sample.event(operator.lt, high),
    )
    for blocks, method, label in _blocks(sample, content, inside, 1 - tail):
        if blocks < sample.size:
            # As many runs lie outside on either side, so an odd one stays inside.
            first = (sample.size - 1 - int(blocks)) // 2 + 1
            lower = float(order_statistic(sample, first))
            upper = float(order_statistic(sample, sample.size + 1 - first))
            return Estimate(math.nan, lower, upper, texts.TWO_SIDED.format(method=method), label)
    fewest = texts.BOTH_ENDS_NEED.format(runs=runs_needed_for_both(content, sample.level))
    return Estimate.without_bounds(math.nan, sample.reason_without_intervals or fewest)


def _blocks(
    sample: Sample, content: float, inside: Sequence[Column], furthest: float
) -> Iterator[tuple[float, str, str]]:
    """Yield how many blocks between runs have a content with confidence, by which method.

    The best method is first, then a safe one; there is none for a sample without intervals.

    Parameters
    ----------
    sample : Sample
        The runs.
    content : float
        The share of all cases.
    inside : sequence of Column
        The runs about inside the limits; with and without those at a limit, which may be an atom.
    furthest : float
        The probability below the outermost limit.

    Yields
    ------
    blocks : float
        NaN where there are too few.
    method, label : str
        Of the bounds.
    """
    if sample.reason_without_intervals:
        return
    is_replicated = sample.error_model is ErrorModel.REPLICATED
    if is_replicated and bool(has_enough_runs_around(sample, sample.size * furthest)):
        error, freedom, is_rounded = max(map(partial(probability_error, sample), inside))
        # A one-sided bound at 95 % is the upper end of a two-sided interval at 90 %.
        step = student_quantile(freedom, 2 * sample.level - 1) * error
        needed = math.floor(sample.size * (content + float(step))) + 1
        yield needed, texts.WOODRUFF, "discrete" if is_rounded else "nominal"
    label = "discrete" if sample.error_model is ErrorModel.INDEPENDENT else "conservative"
    yield float(upper_rank(sample.size, content, sample.level)), texts.ORDER_STATISTICS, label


_UPPER = _Kind(
    "tolerance_limit",
    CONTENT_LEVEL,
    "probability of not exceeding the value",
    texts.RUNS_NEEDED,
    "value that {title} does not exceed with a probability",
    _upper_limit,
    runs_needed,
)
_LOWER = _Kind(
    "lower_tolerance_limit",
    LOWER_CONTENT,
    "probability of not lying below the value",
    texts.RUNS_NEEDED_BELOW,
    "value that {title} does not lie below with a probability",
    _lower_limit,
    runs_needed,
)
_INTERVAL = _Kind(
    "tolerance_interval",
    INTERVAL_CONTENT,
    "probability of lying between the values",
    texts.RUNS_NEEDED_FOR_BOTH,
    "values between which {title} lies with a probability",
    _interval,
    runs_needed_for_both,
)
