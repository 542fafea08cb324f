"""Orthogonal polynomials of a distribution, by their three-term recurrence, and Gauss's rule.

The coefficients belong to a standardised variable t = (x - location) / scale, so that they stay
near one whatever the unit of x:

    p[k+1](t) = (t - alpha[k]) p[k](t) - beta[k] p[k-1](t),    p[0] = 1, p[-1] = 0

where the polynomials are monic, E p[j](t) p[k](t) = 0 for j ≠ k, and the mean square of p[k](t) is
beta[1] … beta[k].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.univariate import Beta, Gamma, Lognormal, Mixture, Normal, Uniform

# A distribution is integrated over z, where Φ(z) is the probability below. The range ends here,
# where Φ(-z) is almost the smallest probability that a double can represent.
_FARTHEST = 37.0
# Every distribution has a value up to here, where its draws end (see `OPEN_INTERVAL`).
_GIVEN_UP = 8.2
_PANELS = 148
_NODES_PER_PANEL = 20
# Two halves of a panel must agree with the whole to this, relative to the distribution's spread.
_AGREEMENT = 1e-14
# A panel is halved until its share of a corner or a jump is below rounding.
_HALVINGS = 48
# A distribution of n values has n polynomials; the remainder for the next is rounding.
_NOTHING = 1e-10
# An empirical distribution may have a jump in every panel; more would take too long.
_MOST_PANELS = 20_000


@dataclass(frozen=True)
class Recurrence:
    """Three-term recurrence of the monic orthogonal polynomials in t of a distribution."""

    alpha: FloatArray  # (order + 1,): the coefficients
    beta: FloatArray  # (order + 1,): the same; ``beta[0]`` is 1, the total probability
    location: float  # of the standardised variable t = (x - location) / scale
    scale: float  # of the same

    @property
    def mean(self) -> float:
        """Mean of the distribution."""
        return self.location + self.scale * float(self.alpha[0])

    @property
    def std(self) -> float:
        """Standard deviation of the distribution; needs the recurrence up to order 1 at least."""
        return self.scale * math.sqrt(self.beta[1])

    @property
    def is_finite(self) -> bool:
        """True if all coefficients are finite and lead to a rule with real nodes."""
        is_number = np.isfinite(self.alpha).all() and np.isfinite(self.beta).all()
        return bool(is_number and (self.beta > 0).all())

    def gauss(self, nodes: int) -> tuple[FloatArray, FloatArray]:
        """Return values and weights, whose sum is 1, of Gauss's rule with a number of nodes.

        It is exact for polynomials up to degree 2 `nodes` - 1; the recurrence must reach order
        `nodes` - 1. Golub, G. H. & Welsch, J. H. (1969). Math. Comput. 23, 221-230.
        """
        off_diagonal = np.sqrt(self.beta[1:nodes])
        t, vectors = scipy.linalg.eigh_tridiagonal(self.alpha[:nodes], off_diagonal)
        weights = vectors[0] ** 2
        return self.location + self.scale * t, weights / weights.sum()


def recurrence(distribution: Distribution, order: int) -> Recurrence:
    """Compute the recurrence of a distribution's orthogonal polynomials up to an order.

    The classical ones have formulas. The coefficients of any other follow from its quantile
    function, integrated to rounding.
    """
    k = np.arange(order + 1, dtype=np.float64)
    with np.errstate(all="ignore"):
        if formula := _FORMULAS.get(type(distribution)):
            return formula(distribution, k)
        if distribution.highest_moment <= 2:  # the sums take long, and lead to nothing
            none = np.full_like(k, np.nan)
            return Recurrence(none, none, distribution.median, 1.0)
        found = _stieltjes(*_nodes(distribution), k)
        # Coefficients of moments that are infinite, of which the sums have something all the same.
        found.alpha[2 * k + 1 >= distribution.highest_moment] = np.nan
        found.beta[2 * k >= distribution.highest_moment] = np.nan
        return found


def _hermite(distribution: Normal, k: FloatArray) -> Recurrence:
    return Recurrence(
        np.zeros_like(k), np.where(k > 0, k, 1.0), distribution.mean, distribution.std
    )


def _legendre(distribution: Uniform, k: FloatArray) -> Recurrence:
    beta = np.where(k > 0, k**2 / (4 * k**2 - 1), 1.0)
    half = distribution.upper / 2 - distribution.lower / 2
    return Recurrence(np.zeros_like(k), beta, distribution.lower + half, half)


def _laguerre(distribution: Gamma, k: FloatArray) -> Recurrence:
    shape = (distribution.mean / distribution.std) ** 2
    # Over the standard deviation, and from the mean, as a large shape is nearly normal.
    beta = np.where(k > 0, k * (1 + (k - 1) / shape), 1.0)
    return Recurrence(2 * k / math.sqrt(shape), beta, distribution.mean, distribution.std)


def _jacobi(distribution: Beta, k: FloatArray) -> Recurrence:
    a, b = distribution.beta - 1, distribution.alpha - 1
    total = 2 * k + a + b
    with np.errstate(divide="ignore", invalid="ignore"):
        alpha = (b - a) * (b + a) / (total * (total + 2))
        beta = 4 * k * (k + a) * (k + b) * (k + a + b) / (total**2 * (total + 1) * (total - 1))
        # The general formula is 0/0 here for some parameters.
        first = 4 * (1 + a) * (1 + b) / ((2 + a + b) ** 2 * (3 + a + b))
    alpha[0] = (b - a) / (a + b + 2)
    beta[0] = 1.0
    beta[1:2] = first
    half = distribution.upper / 2 - distribution.lower / 2
    return Recurrence(alpha, beta, distribution.lower + half, half)


def _stieltjes_wigert(distribution: Lognormal, k: FloatArray) -> Recurrence:
    ratio = distribution.std / distribution.mean
    q = 1 + ratio**2
    # In units of the mean; (q^k - 1) keeps its digits for a narrow distribution.
    excess = np.expm1(k * math.log1p(ratio**2))
    alpha = q ** (k - 1) * (q * excess + excess + q) - 1
    beta = np.where(k > 0, q ** (3 * k - 3) * excess, 1.0)
    return Recurrence(
        alpha / ratio, np.where(k > 0, beta / ratio**2, 1.0), distribution.mean, distribution.std
    )


_FORMULAS: dict[type, Callable[..., Recurrence]] = {
    Normal: _hermite,
    Uniform: _legendre,
    Gamma: _laguerre,
    Beta: _jacobi,
    Lognormal: _stieltjes_wigert,
}


def _stieltjes(values: FloatArray, weights: FloatArray, k: FloatArray) -> Recurrence:
    """Compute the coefficients by Stieltjes's procedure on values with probabilities.

    Gautschi, W. (2004). Orthogonal Polynomials: Computation and Approximation, section 2.2.
    """
    location = float(values @ weights)
    scale = math.sqrt(float((values - location) ** 2 @ weights))
    t = (values - location) / scale
    alpha, beta = np.full_like(k, np.nan), np.full_like(k, np.nan)
    before, now, norm = np.zeros_like(t), np.ones_like(t), 1.0
    for order in range(len(k)):
        # Orthonormal ones, as the monic ones of a high order overflow.
        beta[order] = norm**2
        alpha[order] = float(t * now**2 @ weights)
        following = (t - alpha[order]) * now - norm * before
        before, norm = now, math.sqrt(float(following**2 @ weights))
        if not norm > _NOTHING:
            break
        now = following / norm
    beta[0] = 1.0
    return Recurrence(alpha, beta, location, scale)


def _nodes(distribution: Distribution) -> tuple[FloatArray, FloatArray]:
    """Return values and weights of a distribution; those of a mixture are those of its parts."""
    if isinstance(distribution, Mixture):
        found = [_nodes(part) for part in distribution.parts]
        shares = zip(distribution.shares, found, strict=True)
        weights = np.concatenate([share * weights for share, (_, weights) in shares])
        return np.concatenate([values for values, _ in found]), weights
    return distribution.atoms() or _distribution_nodes(distribution)


def _distribution_nodes(distribution: Distribution) -> tuple[FloatArray, FloatArray]:
    """Discretise a distribution: values with weights, enough to represent it.

    Gauss's rule on panels of z, halved where the quantile function is not smooth: at the mode of a
    triangle, at the values of an empirical distribution.
    """
    ends = np.linspace(-_FARTHEST, _FARTHEST, _PANELS + 1)
    lower, upper = ends[:-1], ends[1:]
    settled: list[tuple[FloatArray, FloatArray]] = []
    panels = 0
    for halving in range(_HALVINGS + 1):
        values, weights = _panel_nodes(distribution, lower, upper)
        panels += len(lower)
        if halving == _HALVINGS or panels > _MOST_PANELS:
            done = np.full(lower.shape, fill_value=True)
        else:
            done = _has_converged(distribution, lower, upper, values, weights)
        settled.append((values[done].ravel(), weights[done].ravel()))
        if done.all():
            break
        lower, upper = lower[~done], upper[~done]
        between = (lower + upper) / 2
        lower, upper = np.concatenate([lower, between]), np.concatenate([between, upper])
    values, weights = (np.concatenate(parts) for parts in zip(*settled, strict=True))
    return values, weights / weights.sum()


def _has_converged(
    distribution: Distribution,
    lower: FloatArray,
    upper: FloatArray,
    values: FloatArray,
    weights: FloatArray,
) -> BoolArray:
    """Return a mask of the panels whose first two moments agree with those of their halves."""
    low, middle, high = _values(distribution, np.array([-1.0, 0.0, 1.0]))
    between = (lower + upper) / 2
    moments = np.zeros((2, len(lower)))
    spread = (high - low) or 1.0
    for sign, (x, weight) in (
        (1, (values, weights)),
        (-1, _panel_nodes(distribution, lower, between)),
        (-1, _panel_nodes(distribution, between, upper)),
    ):
        t = (x - middle) / spread
        moments += sign * np.stack([(t * weight).sum(axis=1), (t**2 * weight).sum(axis=1)])
    largest = np.abs((values - middle) / spread).max(axis=1)
    allowed = _AGREEMENT * np.clip(largest, 1.0, 1e3)
    settled: BoolArray = (np.abs(moments) <= allowed).all(axis=0)
    return settled


def _panel_nodes(
    distribution: Distribution, lower: FloatArray, upper: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return values at the nodes of each panel of z, and their probability weights."""
    nodes, weights = scipy.special.roots_legendre(_NODES_PER_PANEL)
    half = (upper - lower)[:, None] / 2
    z = (lower[:, None] + half) + half * nodes
    density = np.exp(-(z**2) / 2) / math.sqrt(2 * math.pi)
    values = _values(distribution, z)
    # Some inverse functions fail far out, where the probability is negligible.
    is_number = np.isfinite(values) | (np.abs(z) < _GIVEN_UP)
    return np.where(is_number, values, 0.0), np.where(is_number, half * weights * density, 0.0)


def _values(distribution: Distribution, z: FloatArray) -> FloatArray:
    """Return values at standard normal quantiles, each tail from its own probability."""
    tail = scipy.special.ndtr(-np.abs(z))
    return np.where(z < 0, distribution.ppf(tail), distribution.isf(tail))
