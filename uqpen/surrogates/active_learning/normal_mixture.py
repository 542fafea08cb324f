"""Mixture of normal distributions: an importance density for a rare event."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg
from scipy.special import logsumexp

from uqpen.core.arrays import FloatArray

__all__ = ["NormalMixture"]

# Numbers of components that are tried, and steps of each fit.
_COMPONENTS, _STEPS = (1, 2, 4, 8), 25
# Points of a component by coordinate, so that its covariance is known.
_POINTS_PER_INPUT = 20
# Standard deviations of a component grow by this factor: its weights stay bounded where the event
# goes on beyond the points.
_WIDER = 1.2
# Least variance of a component, so that none falls onto a single point.
_LEAST_VARIANCE = 1e-3


@dataclass(frozen=True, eq=False)
class NormalMixture:
    """Mixture of normal distributions.

    Parameters
    ----------
    shares : ndarray, shape (component,)
        They add up to 1.
    means : ndarray, shape (component, input)
    factors : ndarray, shape (component, input, input)
        Lower Cholesky factors of the covariances.
    """

    shares: FloatArray
    means: FloatArray
    factors: FloatArray

    @classmethod
    def of_scales(
        cls, shares: list[float], deviations: list[float], dimension: int
    ) -> NormalMixture:
        """Return a mixture of distributions around the origin, alike in all directions."""
        factors = np.array([each * np.eye(dimension) for each in deviations])
        return cls(np.array(shares), np.zeros((len(shares), dimension)), factors)

    @classmethod
    def fit(
        cls, points: FloatArray, weights: FloatArray, rng: np.random.Generator
    ) -> NormalMixture:
        """Fit weighted points by expectation maximisation, with the best number of components.

        The number is that of the smallest Bayesian information criterion.
        """
        count, dimension = points.shape
        size = weights.sum() ** 2 / (weights**2).sum()
        most = max(1, int(size / (_POINTS_PER_INPUT * dimension)))
        found: list[tuple[float, int, NormalMixture]] = []
        for components in (each for each in _COMPONENTS if each <= min(most, count)):
            mixture = cls._start(points, weights, components, rng)
            for _ in range(_STEPS if components > 1 else 1):
                mixture = mixture._improved(points, weights)
            likelihood = float(mixture.log_density(points) @ weights) / weights.sum() * size
            numbers = components * (1 + dimension + dimension * (dimension + 1) / 2)
            found.append((numbers * math.log(size) - 2 * likelihood, len(found), mixture))
        return min(found)[-1]._wider()

    @staticmethod
    def joined(parts: list[NormalMixture], shares: list[float]) -> NormalMixture:
        """Return the mixture of mixtures."""
        return NormalMixture(
            np.concatenate([a * each.shares for a, each in zip(shares, parts, strict=True)]),
            np.concatenate([each.means for each in parts]),
            np.concatenate([each.factors for each in parts]),
        )

    def log_density(self, points: FloatArray) -> FloatArray:
        """Return the logarithm of the density, shape (point,)."""
        return np.asarray(logsumexp(self._log_parts(points), axis=0))

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return independent draws, shape (point, input)."""
        component = rng.choice(len(self.shares), size=count, p=self.shares / self.shares.sum())
        normal = rng.standard_normal((count, self.means.shape[1]))
        return self.means[component] + np.einsum("nij,nj->ni", self.factors[component], normal)

    def _log_parts(self, points: FloatArray) -> FloatArray:
        constant = 0.5 * points.shape[1] * math.log(2 * math.pi)
        parts = np.empty((len(self.shares), len(points)))
        for number, (mean, factor) in enumerate(zip(self.means, self.factors, strict=True)):
            scaled = linalg.solve_triangular(factor, (points - mean).T, lower=True)
            parts[number] = -0.5 * (scaled**2).sum(axis=0) - np.log(np.diag(factor)).sum()
        return parts + np.log(self.shares)[:, np.newaxis] - constant

    @staticmethod
    def _start(
        points: FloatArray, weights: FloatArray, components: int, rng: np.random.Generator
    ) -> NormalMixture:
        """Return components around points that are far from each other (k-means++)."""
        probabilities = weights / weights.sum()
        chosen = [int(rng.choice(len(points), p=probabilities))]
        distances = np.full(len(points), np.inf)
        for _ in range(components - 1):
            distances = np.minimum(distances, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
            likely = distances * probabilities
            chosen.append(int(rng.choice(len(points), p=likely / likely.sum())))
        covariance = _covariance(points, probabilities) / components
        factor = linalg.cholesky(covariance, lower=True)
        shares = np.full(components, 1 / components)
        return NormalMixture(shares, points[chosen], np.repeat(factor[np.newaxis], components, 0))

    def _improved(self, points: FloatArray, weights: FloatArray) -> NormalMixture:
        parts = self._log_parts(points)
        belongs = np.exp(parts - logsumexp(parts, axis=0)) * (weights / weights.sum())
        shares = np.maximum(belongs.sum(axis=1), 1e-12)
        means = (belongs @ points) / shares[:, np.newaxis]
        factors = [
            linalg.cholesky(_covariance(points - mean, own / share, centred=True), lower=True)
            for own, share, mean in zip(belongs, shares, means, strict=True)
        ]
        return NormalMixture(shares / shares.sum(), means, np.array(factors))

    def _wider(self) -> NormalMixture:
        return NormalMixture(self.shares, self.means, _WIDER * self.factors)


def _covariance(
    points: FloatArray, probabilities: FloatArray, *, centred: bool = False
) -> FloatArray:
    away = points if centred else points - probabilities @ points
    found: FloatArray = (away * probabilities[:, np.newaxis]).T @ away
    return found + _LEAST_VARIANCE * np.eye(points.shape[1])
