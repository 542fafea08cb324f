"""Allowances for skewness and long tails: how far the ends of a mean's interval move out.

Student's t is for a mean whose error is normal. Where few replicates are skewed, or few runs decide
the mean, it misses the true value on the side of the longer tail.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.statistics.intervals import group_sums, student_quantile
from uqpen.statistics.tally import Tally

__all__ = ["Margins", "extreme_margins", "skewness_margins", "skewness_margins_of_sums"]


class Margins(NamedTuple):
    """Distances of the lower and the upper end of an interval from the estimate, at any places."""

    below: FloatArray
    above: FloatArray

    @classmethod
    def zero(cls, shape: tuple[int, ...]) -> Margins:
        """Return distances of 0 at places of a shape."""
        return cls(np.zeros(shape), np.zeros(shape))

    def plus(self, other: Margins) -> Margins:
        """Return the sum of two distances, at each end."""
        return Margins(self.below + other.below, self.above + other.above)

    def at_least(self, other: Margins) -> Margins:
        """Return the larger of two distances, at each end."""
        return Margins(np.maximum(self.below, other.below), np.maximum(self.above, other.above))

    def zero_except(self, condition: BoolArray) -> Margins:
        """Return the distances at some places, and 0 at the others."""
        return Margins(*(np.where(condition, margin, 0.0) for margin in self))


def extreme_margins(influence: FloatArray | Tally, weights: FloatArray | None = None) -> Margins:
    """Return how far the smallest and the largest run move a mean.

    A run further out than all others may well come as often as the largest one has. The mean would
    move by as much as that one has moved it.

    Parameters
    ----------
    influence : ndarray, shape (..., run), or Tally
        Values whose mean is estimated, at any places.
    weights : ndarray, shape (run,), optional
        Relative weights.
    """
    if isinstance(influence, Tally):
        ends = np.array([-influence.smallest, influence.largest]) + [1, -1] * influence.mean()
        return Margins(*map(np.asarray, np.maximum(ends / influence.size, 0.0)))
    runs = influence.shape[-1]
    shares = np.full(runs, 1 / runs) if weights is None else weights
    shares = shares / shares.sum()
    parts = shares * (influence - (shares * influence).sum(axis=-1, keepdims=True))
    return Margins(np.maximum(-parts.min(axis=-1), 0.0), np.maximum(parts.max(axis=-1), 0.0))


def skewness_margins(
    influence: FloatArray, replicate: IntArray, replicates: int, level: float
) -> tuple[Margins, Margins]:
    """Return how far the end moves out towards which the means of replicates are skewed.

    Parameters
    ----------
    influence : ndarray, shape (..., run)
        Values whose mean is estimated, at any places.
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
    sums = group_sums(influence - influence.mean(axis=-1, keepdims=True), replicate, replicates)
    return skewness_margins_of_sums(sums, len(replicate), level)


def skewness_margins_of_sums(sums: FloatArray, runs: int, level: float) -> tuple[Margins, Margins]:
    """Return `skewness_margins` from each replicate's sum of deviations from the mean."""
    replicates = sums.shape[-1]
    means = replicates / runs * sums
    deviations = means - means.mean(axis=-1, keepdims=True)
    squares = (deviations**2).sum(axis=-1)
    if replicates < 3:
        return Margins.zero(squares.shape), Margins.zero(squares.shape)
    varies = squares > 0
    std = np.sqrt(np.where(varies, squares, 1.0) / (replicates - 1))
    skewness = ((deviations / std[..., np.newaxis]) ** 3).sum(axis=-1) * replicates
    skewness = skewness / ((replicates - 1) * (replicates - 2))
    t = student_quantile(replicates - 1, level)
    skew = std * np.abs(skewness) * (1 + 2 * t**2) / (6 * replicates)
    furthest = -deviations.min(axis=-1) / replicates, deviations.max(axis=-1) / replicates
    below, above = varies & (skewness < 0), varies & ~(skewness < 0)
    skew_margins = Margins(np.where(below, skew, 0.0), np.where(above, skew, 0.0))
    return skew_margins, Margins(
        np.where(below, furthest[0], 0.0), np.where(above, furthest[1], 0.0)
    )
