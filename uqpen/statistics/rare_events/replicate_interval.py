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

__all__ = ["replicate_interval"]


def replicate_interval(found: Sequence[ReplicateProbability], level: float) -> Estimate:
    """Return the mean of replicates with the interval m·exp(±t·s/(√n·m)).

    The scatter of replicates holds all errors of a method but what every replicate misses. The
    interval lies on the logarithm, as the estimates of a small probability are skewed. Its ends are
    those of the smallest and of the largest probability that the failed runs leave possible.

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
    lower = _end(lowest, level, -1)
    upper = _end(highest, level, +1)
    method = texts.STUDENT_ON_LOGARITHM
    if (highest > lowest).any():
        method = texts.FOR_ANY_OUTCOME.format(method=method)
    unreliable = texts.SEEN_IN_SOME if not lowest.all() else ""
    return Estimate(estimate, lower, min(upper, 1.0), method, "nominal").with_note(unreliable)


def _end(values: FloatArray, level: float, sign: int) -> float:
    """Return an end of the interval; the mean itself where all values are equal."""
    mean = float(values.mean())
    if mean <= 0:
        return 0.0
    half = student_quantile(len(values) - 1, level) * values.std(ddof=1) / math.sqrt(len(values))
    return float(mean * math.exp(sign * half / mean))
