"""Best linear unbiased estimator of a mean from independent groups of runs by several models.

A group of runs is made by some of the models at common points. Its mean outputs are unbiased, and
the best linear combination of those of all groups is that of generalised least squares (Schaden, D.
& Ullmann, E. (2020). SIAM/ASA J. Uncertainty Quantification 8, 601-635). The model whose mean is
wanted is the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray

__all__ = ["LinearEstimator"]

# Part of each variance that is taken to be noise of its own. Without it, outputs that are linear in
# each other, or constant, have no inverse.
_NOISE = 1e-9


@dataclass(frozen=True, eq=False)
class LinearEstimator:
    """Best linear unbiased estimator of the mean output of the first model.

    Parameters
    ----------
    covariance : ndarray, shape (model, model)
        Of the models' outputs at a common point.
    groups : tuple of ndarray of bool, shape (model,)
        The models of each group. Each model is in one of them.
    """

    covariance: FloatArray
    groups: Sequence[BoolArray]

    def weights(self, runs: FloatArray) -> FloatArray:
        """Return the weights of the groups' mean outputs.

        Parameters
        ----------
        runs : ndarray, shape (group,)
            Number of points of each group, not necessarily whole.

        Returns
        -------
        ndarray, shape (group, model)
            They add up to 1 for the first model, and to 0 for each other. A model that is not in a
            group has the weight 0 there.
        """
        information = runs[:, np.newaxis, np.newaxis] * self._inverses
        wanted = np.zeros(len(self._scale))
        wanted[0] = 1.0
        # Of a model that has no runs nothing is known, and nothing is needed: its weight is 0.
        direction = np.linalg.lstsq(information.sum(axis=0), wanted, rcond=None)[0]
        return (information @ direction) * self._scale[0] / self._scale

    def group_variances(self, weights: FloatArray) -> FloatArray:
        """Return the variance of the weighted outputs at one point of each group."""
        return ((weights @ self.covariance) * weights).sum(axis=1).clip(min=0.0)

    def variance(self, runs: FloatArray) -> float:
        """Return the variance of the estimator with numbers of points above 0."""
        return float((self.group_variances(self.weights(runs)) / runs).sum())

    @cached_property
    def _scale(self) -> FloatArray:
        """Standard deviation of each output; 1 for a constant one."""
        scale = np.sqrt(np.diag(self.covariance))
        return np.where(scale > 0, scale, 1.0)

    @cached_property
    def _inverses(self) -> FloatArray:
        """Inverse of the correlations within each group; 0 for models outside of it."""
        correlation = self.covariance / np.outer(self._scale, self._scale)
        correlation = correlation + _NOISE * np.eye(len(correlation))
        inverses = np.zeros((len(self.groups), *correlation.shape))
        for inverse, group in zip(inverses, self.groups, strict=True):
            inside = np.ix_(group, group)
            inverse[inside] = np.linalg.inv(correlation[inside])
        return inverses
