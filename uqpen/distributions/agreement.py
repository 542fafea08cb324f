"""Agreement of given points with the joint distribution that a study states for them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["Agreement", "input_agreements", "largest_correlation"]

# One in so many studies of independent inputs has a larger correlation by chance.
_CHANCE = 1e-4
# A weaker one changes the variance of a sum of two inputs by less than a tenth.
_WEAK = 0.1


class Agreement(NamedTuple):
    """Comparison of points with a joint distribution by one number.

    Attributes
    ----------
    inputs : tuple of str
        The input, or the two inputs of a correlation.
    value : float
        Kolmogorov's distance, or Spearman's rank correlation.
    p_value : float
        Probability that as many independent draws of the joint distribution depart as far.
    """

    inputs: tuple[str, ...]
    value: float
    p_value: float

    @property
    def contradicts_independence(self) -> bool:
        """True for a rank correlation that is neither chance nor too weak to matter."""
        return self.p_value < _CHANCE and abs(self.value) >= _WEAK


def input_agreements(
    joint: JointDistribution, points: Mapping[str, FloatArray]
) -> Iterator[Agreement]:
    """Compare each random input with its distribution, by the Kolmogorov-Smirnov test.

    An input with a discrete distribution, or whose distribution is not known by itself, is left
    out.

    Parameters
    ----------
    joint : JointDistribution
        The inputs of the study.
    points : mapping of str to ndarray, shape (run,)
        In SI units.
    """
    unknown = {*joint.unloaded, *joint.implicit_inputs}
    for entry in joint.random:
        name = entry.variable.name
        if name in unknown or name not in points or entry.distribution.is_discrete:
            continue
        tested = scipy.stats.kstest(points[name], entry.distribution.cdf)
        yield Agreement((name,), float(tested.statistic), float(tested.pvalue))


def largest_correlation(
    joint: JointDistribution, points: Mapping[str, FloatArray]
) -> Agreement | None:
    """Return the largest rank correlation of two random inputs that are stated independent.

    Its probability is that of the largest among all pairs (Bonferroni). None where the study states
    a dependence, or fewer than two inputs vary.
    """
    names = [entry.variable.name for entry in joint.random]
    names = [name for name in names if name in points and np.ptp(points[name]) > 0]
    runs = len(points[names[0]]) if names else 0
    if not joint.is_independent or len(names) < 2 or runs < 3:
        return None
    ranks = np.array([scipy.stats.rankdata(points[name]) for name in names])
    correlations = np.corrcoef(ranks)
    pairs = list(combinations(range(len(names)), 2))
    first, second = max(pairs, key=lambda pair: abs(correlations[pair]))
    value = float(correlations[first, second])
    with np.errstate(divide="ignore"):
        t = abs(value) * np.sqrt((runs - 2) / np.float64(max(1 - value**2, 0.0)))
    p_value = min(1.0, len(pairs) * 2 * float(scipy.stats.t.sf(t, runs - 2)))
    return Agreement((names[first], names[second]), value, p_value)
