"""A distribution cut off at one end or both."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.settings import limit
from uqpen.distributions.distribution import Distribution, order_problem

__all__ = ["Truncated"]


@dataclass(frozen=True)
class Truncated(Distribution):
    """Truncated distribution: its parent, conditional on lying between two values.

    The parent keeps its parameters.

    Parameters
    ----------
    parent : Distribution
        The distribution before truncation.
    lower, upper : float
        Ends of the truncated support; infinite for an open end.
    """

    parent: Distribution
    lower: float = limit(default=-math.inf)
    upper: float = limit(default=math.inf)

    def check_settings(self) -> Iterator[Problem]:
        if self.parent.is_discrete:
            yield Problem((), "limits of a discrete distribution", "its values within them alone")
            return
        yield from order_problem(self.lower, self.upper)
        if self.lower < self.upper and not self._has_mass():
            found = f"{self.lower:g} to {self.upper:g}, where the distribution has no probability"
            yield Problem((), found, "limits that leave some of the distribution")

    def logarithm(self) -> Truncated | None:
        parent = self.parent.logarithm()
        if parent is None:
            return None
        lower = math.log(self.lower) if self.lower > 0 else -math.inf
        return Truncated(parent, lower, math.log(self.upper))

    def ppf(self, probability: FloatArray) -> FloatArray:
        return self._inverse(probability, 1 - probability)

    def isf(self, probability: FloatArray) -> FloatArray:
        return self._inverse(1 - probability, probability)

    def cdf(self, value: FloatArray) -> FloatArray:
        x = np.clip(value, self.lower, self.upper)
        return self._probability(np.array(self.lower), x) / self._mass()

    def sf(self, value: FloatArray) -> FloatArray:
        x = np.clip(value, self.lower, self.upper)
        return self._probability(x, np.array(self.upper)) / self._mass()

    def scores(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self.parent.scores(value)

    def _is_upper_tail(self) -> bool:
        """Check that the support lies in the parent's upper half, where 1 - F is accurate."""
        return bool(self.parent.cdf(np.array(self.lower)) > 0.5)

    def _probability(self, lower: FloatArray, upper: FloatArray) -> FloatArray:
        """Return the parent's probability between two values."""
        if self._is_upper_tail():
            return self.parent.sf(lower) - self.parent.sf(upper)
        return self.parent.cdf(upper) - self.parent.cdf(lower)

    def _mass(self) -> float:
        return float(self._probability(np.array(self.lower), np.array(self.upper)))

    def _has_mass(self) -> bool:
        try:
            return self._mass() > 0
        except ArithmeticError:
            return False  # parameters so large or small that the formulas overflow

    def _inverse(self, probability: FloatArray, complement: FloatArray) -> FloatArray:
        parent = self.parent
        tail, inverse = (
            (parent.sf, parent.isf) if self._is_upper_tail() else (parent.cdf, parent.ppf)
        )
        lower, upper = tail(np.array(self.lower)), tail(np.array(self.upper))
        return np.clip(inverse(complement * lower + probability * upper), self.lower, self.upper)
