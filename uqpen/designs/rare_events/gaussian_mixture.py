"""Mixture of normal distributions that the runs of importance sampling are drawn from."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.threads import one_blas_thread

__all__ = [
    "INFLATED",
    "NOMINAL",
    "GaussianComponent",
    "GaussianMixture",
    "inflation",
    "log_normal_density",
]

# Numbers of the first components of every mixture: the distribution of the inputs, and the same
# inflated. Those that are fitted follow.
NOMINAL, INFLATED = 0, 1


@dataclass(frozen=True, eq=False)
class GaussianComponent:
    """Normal distribution in standard normal space.

    Parameters
    ----------
    mean : ndarray, shape (random input,)
        Its mean.
    covariance : ndarray, shape (random input, random input)
        Positive definite.
    """

    mean: FloatArray
    covariance: FloatArray


def inflation(dimension: int) -> float:
    """Return the standard deviation of the inflated component.

    The squared radius of its draws reaches far beyond that of the inputs, while the ratio of the
    densities stays bounded. In many dimensions only a small inflation leaves that bound useful.
    """
    return 1 + 1.2 / math.sqrt(dimension / 2)


def log_normal_density(points: FloatArray) -> FloatArray:
    """Return the logarithm of the standard normal density, shape (run,)."""
    dimension = points.shape[1]
    squared: FloatArray = (points**2).sum(axis=1)
    return -0.5 * (squared + dimension * math.log(2 * math.pi))


@dataclass(frozen=True, eq=False)
class GaussianMixture:
    """Normal distributions with the number of draws of each.

    The numbers are fixed and not drawn, which makes an estimate narrower and leaves it unbiased.

    Parameters
    ----------
    components : tuple of GaussianComponent
        At least one.
    counts : ndarray of int, shape (component,)
        Number of draws of each.
    """

    components: tuple[GaussianComponent, ...]
    counts: IntArray

    @classmethod
    def of_shares(
        cls, components: tuple[GaussianComponent, ...], shares: FloatArray, number: int
    ) -> GaussianMixture:
        """Return a mixture for a number of draws, given the share of each component.

        Numbers are rounded so that their sum is right: the largest remainders are rounded up.
        """
        exact = number * shares / shares.sum()
        counts = np.floor(exact).astype(np.int64)
        last = np.argsort(counts - exact, kind="stable")[: number - counts.sum()]
        counts[last] += 1
        return cls(components, counts)

    @property
    def number(self) -> int:
        """Number of draws."""
        return int(self.counts.sum())

    @property
    def component(self) -> IntArray:
        """Number of the component of each draw, shape (draw,)."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @one_blas_thread()
    def draw(self, rng: np.random.Generator) -> FloatArray:
        """Return draws in the order of the components, shape (draw, random input)."""
        dimension = len(self.components[0].mean)
        normal = rng.standard_normal((self.number, dimension))
        parts = np.split(normal, np.cumsum(self.counts)[:-1])
        return np.concatenate(
            [
                each.mean + part @ np.linalg.cholesky(each.covariance).T
                for each, part in zip(self.components, parts, strict=True)
            ]
        )

    @one_blas_thread()
    def log_density(self, points: FloatArray) -> FloatArray:
        """Return the logarithm of the density of the mixture, shape (run,)."""
        used = [k for k, count in enumerate(self.counts) if count]
        logarithms = np.empty((len(used), len(points)))
        for row, k in enumerate(used):
            factor = np.linalg.cholesky(self.components[k].covariance)
            standard = np.linalg.solve(factor, (points - self.components[k].mean).T).T
            logarithms[row] = log_normal_density(standard) - np.log(np.diag(factor)).sum()
        shares = self.counts[used] / self.number
        total: FloatArray = logsumexp(logarithms, axis=0, b=shares[:, np.newaxis])
        return total
