"""Profile likelihood of a return level: generalised Pareto excesses, and how many there are."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.tails.generalised_pareto import log_likelihood

__all__ = ["FittedTail"]

# Steps of the search for an end of an interval, each further than the one before.
_STEPS = 60
# Of an end, relative to its excess or to the scale of all excesses.
_TOLERANCE = 1e-6
# Of parameters that the runs exclude: differences of it are numbers.
_IMPOSSIBLE = -1e300


@dataclass(frozen=True, eq=False)
class FittedTail:
    """Tail of a sample: runs beyond a threshold, and the distribution of their excesses.

    Parameters
    ----------
    ordered : ndarray, shape (run,)
        All runs, ascending, in the output's SI unit.
    threshold : float
        In the same unit.
    excesses : ndarray, shape (run,)
        Of the runs beyond it.
    shape, scale : float
        Of the fitted generalised Pareto distribution.
    p_value : float
        Of the fit.
    """

    ordered: FloatArray
    threshold: float
    excesses: FloatArray
    shape: float
    scale: float
    p_value: float

    @property
    def share(self) -> float:
        """Share of the runs that lie beyond the threshold."""
        return len(self.excesses) / len(self.ordered)

    def return_level(self, period: float) -> float:
        """Return the value that is exceeded once in a number of cases."""
        return self.threshold + self.scale * _growth(math.log(period * self.share), self.shape)

    def interval(self, period: float, level: float) -> tuple[float, float]:
        """Return the values that twice the logarithm of the likelihood ratio does not exclude.

        Parameters
        ----------
        period : float
            Number of cases.
        level : float
            Two-sided. The quantile is that of Student's t, squared, as the excesses are few.
        """
        found = self.return_level(period) - self.threshold
        profile = _Profile(self, period)
        limit = student_quantile(len(self.excesses) - 2, level) ** 2 / 2
        best = profile(found)

        def excluded(at: float) -> float:
            return best - profile(at) - limit

        highest = self.threshold + self._end(excluded, found, 1.1)
        if excluded(0.0) > 0:
            return self.threshold + self._end(excluded, found, 0.9), highest
        return self._end_below(period, limit), highest

    def _end(self, excluded: Callable[[float], float], start: float, factor: float) -> float:
        """Return where a likelihood is as small as the limit; infinite, or 0, without an end."""
        inner, step = start, factor
        for _ in range(_STEPS):
            outer = inner * step
            if excluded(outer) > 0:
                found = scipy.optimize.brentq(
                    excluded, inner, outer, xtol=_TOLERANCE * self.scale, rtol=_TOLERANCE
                )
                return float(found)
            inner, step = outer, step**1.1
        return math.inf if factor > 1 else 0.0

    def _end_below(self, period: float, limit: float) -> float:
        """Return the lower end where the threshold is not excluded as the level.

        The tail says nothing below its threshold. There the number of runs beyond a value decides,
        whose likelihood at the threshold is that of the tail.
        """
        runs = len(self.ordered)

        def is_excluded(beyond: int) -> bool:
            largest = _counted(beyond, runs, beyond / runs)
            return largest - _counted(beyond, runs, 1 / period) > limit

        counts = range(len(self.excesses), runs)
        return float(self.ordered[-counts[bisect_left(counts, True, key=is_excluded)]])


@dataclass(eq=False)
class _Profile:
    """The largest log-likelihood of a return level, over the shape and the share beyond."""

    tail: FittedTail
    period: float
    # A search for an end asks for a level again, and has to be told the same.
    _found: dict[float, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        # The second parameter is log(log(period · share)). A level close to the threshold has a
        # share close to 1/period, which the share itself does not resolve.
        at_fit = math.log(math.log(self.period * self.tail.share))
        self._start = np.array([self.tail.shape, at_fit])

    def __call__(self, excess: float) -> float:
        """Return it for a return level, given its excess over the threshold."""
        if excess not in self._found:
            self._found[excess] = self._largest(excess) if excess > 0 else self._at_threshold()
        return self._found[excess]

    def _at_threshold(self) -> float:
        """Return its limit as the level comes down to the threshold: the share is 1/period."""
        tail = self.tail
        counted = _counted(len(tail.excesses), len(tail.ordered), 1 / self.period)
        return log_likelihood(tail.excesses, tail.shape, tail.scale) + counted

    def _largest(self, excess: float) -> float:
        found = scipy.optimize.minimize(
            lambda at: -self._likelihood(excess, *at),
            self._start,
            method="Nelder-Mead",
            options={"xatol": 1e-5, "fatol": 1e-6, "initial_simplex": self._simplex()},
        )
        if found.fun < -_IMPOSSIBLE:
            self._start = found.x  # the next level is near
        return -float(found.fun)

    def _simplex(self) -> FloatArray:
        return self._start + np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]])

    def _likelihood(self, excess: float, shape: float, logarithm: float) -> float:
        # A shape below -1 has no largest likelihood, and a share is below 1.
        most = math.log(self.period)
        if not -1 < shape < 5 or not logarithm < math.log(most):
            return _IMPOSSIBLE
        growth = math.exp(logarithm)
        share = math.exp(growth - most)
        if not (growth > 0 and share < 1):
            return _IMPOSSIBLE
        counted = _counted(len(self.tail.excesses), len(self.tail.ordered), share)
        scale = excess / _growth(growth, shape)
        return max(log_likelihood(self.tail.excesses, shape, scale) + counted, _IMPOSSIBLE)


def _counted(beyond: int, runs: int, share: float) -> float:
    """Return the log-likelihood of a share, given how many of the runs lie beyond."""
    return beyond * math.log(share) + (runs - beyond) * math.log1p(-share)


def _growth(logarithm: float, shape: float) -> float:
    """Return the quantile of the standard distribution that one in a number exceeds.

    Parameters
    ----------
    logarithm : float
        Of the number.
    shape : float
        Of the distribution.
    """
    if abs(shape) <= 1e-8:
        return logarithm
    power = shape * logarithm
    return math.expm1(power) / shape if power < 700 else math.inf
