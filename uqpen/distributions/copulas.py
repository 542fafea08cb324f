"""Copulas with one parameter.

A copula of Archimedes' kind is ``psi(phi(u1) + phi(u2) + …)`` with ``phi`` the inverse of ``psi``;
the conditional distribution of one coordinate given others follows from derivatives of ``psi``.
Each is inverted in closed form here, or by Newton's method from a starting value from which it
converges monotonically.

Nelsen, R. B. (2006). An Introduction to Copulas. Springer, chapter 4.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.settings import number
from uqpen.distributions.dependence import Dependence, sum_columns

__all__ = ["ClaytonCopula", "FrankCopula", "GumbelCopula", "JoeCopula"]


# The least probability, 2**-54, to the power of minus this has room in double precision.
_STRONGEST = 16.0

# Newton steps of Joe's copula: 7 suffice for theta above 1.1, and 21 for 1 + 1e-9.
_STEPS = 25


class _OneParameter(Dependence):
    """Copula with a parameter `theta`, the same for every pair of its inputs."""

    theta: float

    @property
    @abstractmethod
    def kendall(self) -> float:
        """Kendall's rank correlation of each pair."""

    @property
    def description(self) -> str:
        return f"theta {self.theta:g}, Kendall's rank correlation {self.kendall:.4g}"


class _Bivariate(_OneParameter):
    """Copula whose conditional distribution is inverted for two inputs only."""

    def check_settings(self) -> Iterator[Problem]:
        if len(self.inputs) > 2:
            expected = "two inputs: of more, its conditional distributions have no simple inverse"
            yield Problem(("inputs",), f"{len(self.inputs)} inputs", expected)


@dataclass(frozen=True)
class ClaytonCopula(_OneParameter):
    """Clayton copula, with dependence in the lower tail: small values occur together."""

    inputs: tuple[str, ...]
    theta: float = number(above=0, below=_STRONGEST)

    @property
    def kendall(self) -> float:
        return self.theta / (self.theta + 2)

    def score(self, probability: FloatArray) -> FloatArray:
        return scipy.special.expm1(-self.theta * np.log(probability))

    def probability(self, score: FloatArray) -> FloatArray:
        return np.exp(-scipy.special.log1p(score) / self.theta)

    def conditional_score(
        self, position: int, probability: FloatArray, known: Mapping[int, FloatArray]
    ) -> FloatArray:
        power = 1 / self.theta + len(known)
        return (1 + sum_columns(known)) * scipy.special.expm1(-np.log(probability) / power)


@dataclass(frozen=True)
class GumbelCopula(_Bivariate):
    """Gumbel copula, with dependence in the upper tail: large values occur together."""

    inputs: tuple[str, ...]
    theta: float = number(above=1, below=_STRONGEST)

    @property
    def kendall(self) -> float:
        return 1 - 1 / self.theta

    def score(self, probability: FloatArray) -> FloatArray:
        return -np.log(probability)

    def probability(self, score: FloatArray) -> FloatArray:
        return np.exp(-score)

    def conditional_score(
        self, position: int, probability: FloatArray, known: Mapping[int, FloatArray]
    ) -> FloatArray:
        # phi is the score to the power theta; w, the sum of both phi to the power 1/theta, solves
        # w + a ln w = c.
        (first,) = known.values()
        a = self.theta - 1
        target = -np.log(probability)
        c = first + a * np.log(first) + target
        growth = a * scipy.special.wrightomega(c / a - np.log(a)) / first - 1
        # The difference of two near numbers, to its own full accuracy.
        excess = first * growth + a * scipy.special.log1p(growth) - target
        growth = growth - excess / (first + a / (1 + growth))
        return first * scipy.special.expm1(self.theta * scipy.special.log1p(growth)) ** (
            1 / self.theta
        )


@dataclass(frozen=True)
class FrankCopula(_Bivariate):
    """Frank copula, without tail dependence; a negative `theta` gives negative dependence."""

    inputs: tuple[str, ...]
    theta: float = number(above=-100, below=100)

    def check_settings(self) -> Iterator[Problem]:
        yield from super().check_settings()
        if self.theta == 0:
            yield Problem(("theta",), "0", "another number than 0, which is independence")

    @property
    def kendall(self) -> float:
        # Debye's function of the first order, by Gauss's rule: its integrand is smooth.
        nodes, weights = np.polynomial.legendre.leggauss(200)
        x = abs(self.theta) * (nodes + 1) / 2
        debye = float((weights * x / scipy.special.expm1(x)).sum() / 2)
        return float(np.copysign(1 - 4 / abs(self.theta) * (1 - debye), self.theta))

    def score(self, probability: FloatArray) -> FloatArray:
        return probability

    def probability(self, score: FloatArray) -> FloatArray:
        return score

    def conditional_score(
        self, position: int, probability: FloatArray, known: Mapping[int, FloatArray]
    ) -> FloatArray:
        (first,) = known.values()
        theta, p = abs(self.theta), probability if self.theta > 0 else 1 - probability
        decay = np.exp(-theta * first)
        whole = p + decay * (1 - p)
        share = -p * scipy.special.expm1(-theta) / whole
        with np.errstate(divide="ignore"):  # of the branch that is not taken
            far = np.log((p * np.exp(-theta) + decay * (1 - p)) / whole)
            near = scipy.special.log1p(-np.minimum(share, 1.0))
        second = -np.where(share < 0.5, near, far) / theta
        return second if self.theta > 0 else 1 - second


@dataclass(frozen=True)
class JoeCopula(_Bivariate):
    """Joe copula: stronger dependence in the upper tail than Gumbel's, weaker elsewhere."""

    inputs: tuple[str, ...]
    theta: float = number(above=1, below=_STRONGEST)

    @property
    def kendall(self) -> float:
        a = 2 / self.theta
        slope = float(scipy.special.polygamma(1, 2.0))
        if abs(a - 1) > 1e-6:  # nearer, the difference would cancel
            slope = float(scipy.special.digamma(2.0) - scipy.special.digamma(a + 1)) / (1 - a)
        return 1 - a * slope

    def score(self, probability: FloatArray) -> FloatArray:
        return self.theta * scipy.special.log1p(-probability)

    def probability(self, score: FloatArray) -> FloatArray:
        return -scipy.special.expm1(score / self.theta)

    def conditional_score(
        self, position: int, probability: FloatArray, known: Mapping[int, FloatArray]
    ) -> FloatArray:
        # With x = 1 - exp(-phi) of the sum of both phi, y = ln x solves -a y + ln(1 - x) = c.
        (first,) = known.values()
        a = 1 - 1 / self.theta
        c = np.log(probability) + np.log(-scipy.special.expm1(first)) - a * first
        y = -np.logaddexp(0.0, c)  # right of the solution, where the curve bends down
        for _ in range(_STEPS):
            rest = -scipy.special.expm1(y)
            y = y + (np.log(rest) - a * y - c) / (a + np.exp(y) / rest)
        share = scipy.special.expm1(y) / scipy.special.expm1(first)
        with np.errstate(divide="ignore"):  # of the branch that is not taken, and of the very end
            near = scipy.special.log1p(-np.minimum(share, 1.0))
            far = first + np.log(
                scipy.special.expm1(np.maximum(y - first, 0.0)) / -scipy.special.expm1(first)
            )
        return np.where(share < 0.5, near, far)
