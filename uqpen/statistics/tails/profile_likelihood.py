"""Profile likelihood of a return level: generalised Pareto excesses, and how many there are."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.tails.generalised_pareto import log_likelihood

__all__ = ["FittedTail"]

# Steps of the search for an end of an interval, each further than the one before.
_STEPS = 60
# Of parameters that the runs exclude: differences of it are numbers.
_IMPOSSIBLE = -1e300


@dataclass(frozen=True, eq=False)
class FittedTail:
    """Tail of a sample: runs beyond a threshold, and the distribution of their excesses.

    Parameters
    ----------
    threshold : float
        In the output's SI unit.
    excesses : ndarray, shape (run,)
        Of the runs beyond it.
    runs : int
        Number of all runs.
    shape, scale : float
        Of the fitted generalised Pareto distribution.
    p_value : float
        Of the fit.
    """

    threshold: float
    excesses: FloatArray
    runs: int
    shape: float
    scale: float
    p_value: float

    @property
    def share(self) -> float:
        """Share of the runs that lie beyond the threshold."""
        return len(self.excesses) / self.runs

    def return_level(self, period: float) -> float:
        """Return the value that is exceeded once in a number of cases."""
        return self.threshold + self.scale * _growth(period * self.share, self.shape)

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

        lowest = _end(excluded, found, 0.9)
        highest = _end(excluded, found, 1.1)
        return self.threshold + lowest, self.threshold + highest


def _end(excluded: Callable[[float], float], start: float, factor: float) -> float:
    """Return where a likelihood is as small as the limit; infinite, or 0, where it stays larger."""
    inner, step = start, factor
    for _ in range(_STEPS):
        outer = inner * step
        if excluded(outer) > 0:
            return float(scipy.optimize.brentq(excluded, inner, outer, rtol=1e-6))
        inner, step = outer, step**1.1
    return math.inf if factor > 1 else 0.0


@dataclass(eq=False)
class _Profile:
    """The largest log-likelihood of a return level, over the shape and the share beyond."""

    tail: FittedTail
    period: float

    def __post_init__(self) -> None:
        share = self.tail.share
        self._start = np.array([self.tail.shape, math.log(share / (1 - share))])

    def __call__(self, excess: float) -> float:
        """Return it for a return level, given its excess over the threshold."""
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

    def _likelihood(self, excess: float, shape: float, logit: float) -> float:
        # A shape below -1 has no largest likelihood.
        share = 1 / (1 + math.exp(-logit)) if logit > -700 else 0.0
        if not -1 < shape < 5 or not self.period * share > 1:
            return _IMPOSSIBLE
        scale = excess / _growth(self.period * share, shape)
        beyond = len(self.tail.excesses)
        counted = beyond * math.log(share) + (self.tail.runs - beyond) * math.log1p(-share)
        return max(log_likelihood(self.tail.excesses, shape, scale) + counted, _IMPOSSIBLE)


def _growth(number: float, shape: float) -> float:
    """Return the quantile of the standard distribution that one in a number exceeds."""
    logarithm = math.log(number)
    return math.expm1(shape * logarithm) / shape if abs(shape) > 1e-8 else logarithm
