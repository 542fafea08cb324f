"""Event that a design was made for, its method, and the probability that the method estimates."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.special import chdtri

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import QuantityError
from uqpen.core.labels import RARE_EVENT, RARE_EVENT_METHOD
from uqpen.designs.rare_events import RARE_EVENT_METHODS, RareEventMethod
from uqpen.designs.rare_events.limit_state import LimitState, parse_limit_state
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import student_quantile


@dataclass(frozen=True)
class RareEvent:
    """Event that a design was made for, and the method of the design."""

    event: LimitState
    method: RareEventMethod


@dataclass(frozen=True, eq=False)
class RareEventProbability:
    """Probability of a rare event, and what a method says besides.

    It is that of admissible inputs, as of every sample. A failed run widens the interval.
    """

    estimate: Estimate  # from all replicates of the design
    # Numbers that stand beside it, by the names that `uqpen.archive.estimates` knows.
    companions: Mapping[str, float] = field(default_factory=dict)
    # Further statistics, which have their names in the catalogue.
    statistics: Mapping[str, xr.DataArray] = field(default_factory=dict)


def rare_event(runs: xr.Dataset) -> RareEvent | None:
    """Return the event that a design was made for; None for any other design.

    A file of any origin may have a text that is no event, or of outputs that it lacks, and the name
    of an unknown method, or of one whose coordinates it lacks.
    """
    method = RARE_EVENT_METHODS.get(str(runs.attrs.get(RARE_EVENT_METHOD, "")))
    try:
        event = parse_limit_state(str(runs.attrs.get(RARE_EVENT, "")))
    except QuantityError:
        return None
    if method is None or not {*method.coordinates} <= set(map(str, runs.variables)):
        return None
    if not event.is_of(runs):
        return None
    return RareEvent(event, method)


# Probability of a rare event from one replicate.


class ReplicateProbability(NamedTuple):
    """Probabilities from one replicate, of admissible inputs."""

    event: float  # of a completed run that shows the event
    missing: float  # of a failed run, whose outcome is unknown

    @property
    def of_completed(self) -> float:
        """Probability of the event, given that a run completes; NaN if none does."""
        return self.event / (1 - self.missing) if self.missing < 1 else math.nan

    @property
    def largest(self) -> float:
        """Probability of the event if all failed runs have it."""
        return self.event + self.missing


# Interval of the probability of a rare event, from the scatter of whole replicates.

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


# Interval of a sum of weights over independent runs that show something rare.


class WeightedCount(NamedTuple):
    """Sum of weights over runs, with the interval of its expectation."""

    value: float
    lower: float
    upper: float

    @classmethod
    def of_runs(cls, weights: FloatArray, next_weight: float, level: float) -> WeightedCount:
        """Return the gamma interval of a sum of weighted Poisson counts (Fay and Feuer 1997).

        Parameters
        ----------
        weights : ndarray, shape (run,)
            Of the runs that show it.
        next_weight : float
            Of a further run that would show it; the interval covers where none is larger.
        """
        tail = (1 - level) / 2
        value, squares = float(weights.sum()), float((weights**2).sum())
        lower = squares / (2 * value) * _quantile(2 * value**2 / squares, tail) if value else 0.0
        heaviest = max(next_weight, float(weights.max(initial=0.0)))
        if not heaviest > 0:
            return cls(value, lower, value)
        more, squares = value + heaviest, squares + heaviest**2
        upper = squares / (2 * more) * _quantile(2 * more**2 / squares, 1 - tail)
        return cls(value, lower, upper)

    @property
    def above(self) -> float:
        """Distance of the upper end."""
        return self.upper - self.value

    @property
    def below(self) -> float:
        """Distance of the lower end."""
        return self.value - self.lower


def _quantile(freedom: float, probability: float) -> float:
    found = float(chdtri(freedom, 1 - probability))
    return found if math.isfinite(found) else 0.0
