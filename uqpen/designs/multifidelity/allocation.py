"""Allocation of a budget to groups of models, by the covariances of their outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.designs.multifidelity.linear_unbiased import LinearEstimator

__all__ = ["Allocation", "best_allocation"]

# Each step lowers the variance. Numbers of runs are rounded, so a millionth is near enough.
_MOST_STEPS, _TOLERANCE = 2000, 1e-6

# A group with a smaller share of the budget, or of fewer points, is left out: its own error would
# not be known.
_SMALLEST_SHARE, _FEWEST_POINTS = 1e-3, 10


@dataclass(frozen=True, eq=False)
class Allocation:
    """Numbers of points by groups of models.

    Parameters
    ----------
    groups : tuple of ndarray of bool, shape (model,)
        The models of each group; the first has all of them.
    runs : ndarray, shape (group,)
        The number of points that each group runs, not necessarily whole.
    """

    groups: tuple[BoolArray, ...]
    runs: FloatArray

    def variance(self, covariance: FloatArray) -> float:
        """Return the variance of the best linear unbiased estimator of the first model's mean."""
        return LinearEstimator(covariance, self.groups).variance(self.runs)


def best_allocation(
    covariances: Sequence[FloatArray], costs: FloatArray, budget: float, pilot: int = 0
) -> Allocation:
    """Return the allocation with which the best linear unbiased estimator has least variance.

    For given weights of the groups' means, the best number of points of a group is proportional to
    the root of its variance over its cost. For given numbers, the best weights are known. Steps of
    both in turn lower the variance to the smallest, as it is convex in the numbers (the
    multiplicative algorithm for c-optimal designs: Yu, Y. (2010). Ann. Statist. 38, 1593-1606).

    Parameters
    ----------
    covariances : sequence of ndarray, shape (model, model)
        Of each output. The sum of the variances of their estimators, each over the variance of the
        first model's output, is made smallest.
    costs : ndarray, shape (model,)
        Of a run of each model.
    budget : float
        Total cost.
    pilot : int
        Number of points that all models run at least.
    """
    groups = _all_groups(len(costs))
    while True:
        prices = np.array([costs[group].sum() for group in groups])
        estimators = [LinearEstimator(covariance, groups) for covariance in covariances]
        runs = _allocate(estimators, prices, budget, pilot)
        is_kept = (runs * prices >= _SMALLEST_SHARE * budget) & (runs >= _FEWEST_POINTS)
        is_kept[0] = True
        if is_kept.all():
            return Allocation(groups, runs)
        groups = tuple(group for group, keep in zip(groups, is_kept, strict=True) if keep)


def _all_groups(models: int) -> tuple[BoolArray, ...]:
    """Return every group of at least one of the models, that of all models first."""
    chosen = product((True, False), repeat=models)
    return tuple(np.array(group) for group in chosen if any(group))


def _allocate(
    estimators: Sequence[LinearEstimator], prices: FloatArray, budget: float, pilot: int
) -> FloatArray:
    """Return the best numbers of points of the groups; the first has those of the pilot."""
    runs = _descend(estimators, prices, budget / len(prices) / prices, free=slice(None))
    if runs[0] >= pilot or len(runs) == 1:
        return runs
    runs[1:] *= (budget - pilot * prices[0]) / (runs[1:] @ prices[1:])
    runs[0] = pilot
    return _descend(estimators, prices, runs, free=slice(1, None))


def _descend(
    estimators: Sequence[LinearEstimator], prices: FloatArray, runs: FloatArray, free: slice
) -> FloatArray:
    """Return better and better numbers of points of the free groups, at the same cost."""
    budget, before = float(runs[free] @ prices[free]), np.inf
    for _ in range(_MOST_STEPS):
        spread = np.zeros(len(runs))
        for each in estimators:
            spread += each.group_variances(each.weights(runs)) / each.covariance[0, 0]
        variance = float((spread / np.maximum(runs, np.finfo(float).tiny)).sum())
        roots = np.sqrt(spread[free] / prices[free])
        if not variance < before * (1 - _TOLERANCE) or not roots.any():
            break
        before, runs = variance, runs.copy()
        runs[free] = budget * roots / (roots @ prices[free])
    return runs
