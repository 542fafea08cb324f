"""Interval of the probability of a rare event, from the scatter of whole replicates."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.rare_events.replicate_probability import ReplicateProbability

__all__ = ["half_width_of_logarithm", "replicate_interval"]

# Replicates that differ by a larger factor say nothing. Those of an interval that is of any use
# differ by less than 100.
_LARGEST_FACTOR = 1000

# The exponential of a half-width is finite.
_WIDEST = 700.0


def replicate_interval(found: Sequence[ReplicateProbability], level: float) -> Estimate:
    """Return the mean m of replicates with the interval m·exp(±h).

    The scatter of replicates holds all errors of a method but what every replicate misses. Its ends
    are those of the smallest and of the largest probability that the failed runs leave possible.
    Where a replicate has not met the event, the scatter says nothing of the error. Where the
    replicates differ by orders of magnitude, as of importance sampling in many inputs, there is no
    value either: most estimates are then far too small.

    Parameters
    ----------
    found : sequence of ReplicateProbability
        One of each replicate.
    level : float
        Two-sided.
    """
    estimate = float(np.mean([each.of_completed for each in found]))
    lowest = np.array([each.event for each in found])
    highest = np.array([each.largest for each in found])
    if not highest.any():
        return Estimate.without_bounds(math.nan, texts.EVENT_NEVER_SEEN)
    if len(found) < 2:
        return Estimate.without_bounds(estimate, texts.SINGLE_REPLICATE)
    if not highest.all():
        return Estimate.without_bounds(estimate, texts.SEEN_IN_SOME)
    if highest.max() > _LARGEST_FACTOR * highest.min():
        reason = texts.REPLICATES_SAY_NOTHING.format(factor=_LARGEST_FACTOR)
        return Estimate.without_bounds(math.nan, reason)
    lower = 0.0  # a replicate may have failed runs alone
    if lowest.all():
        lower = lowest.mean() * math.exp(-half_width_of_logarithm(lowest, level))
    upper = min(highest.mean() * math.exp(half_width_of_logarithm(highest, level)), 1.0)
    method = texts.STUDENT_ON_LOGARITHM
    if (highest > lowest).any():
        method = texts.FOR_ANY_OUTCOME.format(method=method)
    return Estimate(estimate, float(lower), float(upper), method, "nominal")


def half_width_of_logarithm(values: FloatArray, level: float) -> FloatArray:
    """Return the half-width of the interval of a mean of log-normal values, on its logarithm.

    It is t·√(s²/n + s⁴/(2(n − 1))) with the standard deviation s of the logarithms: the logarithm
    of the mean is that of the median and s²/2, and both have errors (Cox's method). The logarithms
    of estimates of a small probability have no skewness, as they are sums over many levels.

    Parameters
    ----------
    values : ndarray, shape (replicate, ...)
        Above 0.
    level : float
        Two-sided.

    References
    ----------
    Zhou, X.-H. & Gao, S. (1997). Statistics in Medicine 16, 783-790; Olsson, U. (2005). Journal of
    Statistics Education 13(1).
    """
    number = len(values)
    variance = np.log(values).var(axis=0, ddof=1)
    error = np.sqrt(variance / number + variance**2 / (2 * (number - 1)))
    half_width: FloatArray = np.minimum(student_quantile(number - 1, level) * error, _WIDEST)
    return half_width
