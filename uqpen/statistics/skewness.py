"""Allowances for skewness and long tails: how far the ends of a mean's interval move out.

Student's t is for a mean whose error is normal. Where few replicates are skewed, or few runs decide
the mean, it misses the true value on the side of the longer tail.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics.intervals import student_quantile

__all__ = ["Margins", "extreme_margins", "skewness_margins"]


class Margins(NamedTuple):
    """Distances of the lower and the upper end of an interval from the estimate."""

    below: float
    above: float

    def plus(self, other: Margins) -> Margins:
        """Return the sum of two distances, at each end."""
        return Margins(self.below + other.below, self.above + other.above)

    def at_least(self, other: Margins) -> Margins:
        """Return the larger of two distances, at each end."""
        return Margins(max(self.below, other.below), max(self.above, other.above))


def extreme_margins(influence: FloatArray, weights: FloatArray | None = None) -> Margins:
    """Return how far the smallest and the largest run move a mean.

    A run further out than all others may well come as often as the largest one has. The mean would
    move by as much as that one has moved it.

    Parameters
    ----------
    influence : ndarray, shape (run,)
        Values whose mean is estimated.
    weights : ndarray, shape (run,), optional
        Relative weights.
    """
    shares = np.full(len(influence), 1 / len(influence)) if weights is None else weights
    shares = shares / shares.sum()
    parts = shares * (influence - float((shares * influence).sum()))
    return Margins(max(-float(parts.min()), 0.0), max(float(parts.max()), 0.0))


def skewness_margins(
    influence: FloatArray, replicate: IntArray, replicates: int, level: float
) -> tuple[Margins, Margins]:
    """Return how far the end moves out towards which the means of replicates are skewed.

    Parameters
    ----------
    influence : ndarray, shape (run,)
        Values whose mean is estimated.
    replicate : ndarray of int, shape (run,)
        The replicate of each run, from 0.
    replicates : int
        Number of replicates.
    level : float
        Two-sided.

    Returns
    -------
    skew, extreme : Margins
        By the skewness of the replicates, the first term of an Edgeworth expansion; by the furthest
        of them. Both are 0 at the end of the shorter tail, and for fewer than three replicates.

    References
    ----------
    Hall, P. (1992). J. R. Statist. Soc. B 54, 221-228.
    """
    sums = np.bincount(replicate, weights=influence - influence.mean(), minlength=replicates)
    means = replicates / len(influence) * sums
    deviations = means - means.mean()
    squares = float((deviations**2).sum())
    if replicates < 3 or not squares > 0:
        return Margins(0.0, 0.0), Margins(0.0, 0.0)
    std = math.sqrt(squares / (replicates - 1))
    skewness = float(((deviations / std) ** 3).sum()) * replicates
    skewness /= (replicates - 1) * (replicates - 2)
    t = student_quantile(replicates - 1, level)
    skew = std * abs(skewness) * (1 + 2 * t**2) / (6 * replicates)
    if skewness < 0:
        return Margins(skew, 0.0), Margins(-float(deviations.min()) / replicates, 0.0)
    return Margins(0.0, skew), Margins(0.0, float(deviations.max()) / replicates)
