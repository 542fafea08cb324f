"""Interval of a sum of weights over independent runs that show something rare."""

from __future__ import annotations

import math
from typing import NamedTuple

from scipy.special import chdtri

from uqpen.core.arrays import FloatArray

__all__ = ["WeightedCount"]


class WeightedCount(NamedTuple):
    """Sum of weights over runs, with the interval of its expectation.

    Parameters
    ----------
    value, lower, upper : float
    """

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
        level : float
            Two-sided.
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
