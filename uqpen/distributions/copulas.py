"""Dependence between random inputs: copulas, as maps of the unit cube onto itself."""

from __future__ import annotations

import functools
import math
import operator
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from types import MappingProxyType
from typing import ClassVar

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem, SettingsError
from uqpen.core.settings import number, validate
from uqpen.distributions.distribution import OPEN_INTERVAL

# Dependence between random inputs: copulas, as maps of the unit cube onto itself.
#
# A copula is the joint distribution of the inputs' probabilities, apart from the distribution of
# each. The inverse of Rosenblatt's transformation turns points of the unit cube whose coordinates
# are independent into points that follow the copula: each coordinate in turn is the quantile of its
# conditional distribution given those before.
#
# Rosenblatt, M. (1952). Ann. Math. Stat. 23, 470-472.

_NONE_GIVEN: Mapping[int, FloatArray] = MappingProxyType({})


class Dependence(ABC):
    """Copula over some of the random inputs.

    A subclass is a frozen dataclass of its parameters. The first one is ``inputs``, the names of
    the inputs that it joins. It works on *scores*: the function of the probabilities in which its
    formulas are simplest. Every formula treats each run by itself, in a fixed number of steps, so
    that the point of a run does not depend on the other runs computed with it.
    """

    inputs: tuple[str, ...]

    def __post_init__(self) -> None:
        problems = [
            Problem(("inputs", position), f'"{name}" twice', "each input once")
            for position, name in enumerate(self.inputs)
            if name in self.inputs[:position]
        ]
        if len(self.inputs) < 2:
            few = Problem(("inputs",), f"{len(self.inputs)} inputs", "at least two, to be joined")
            problems = [few]
        if problems:
            raise SettingsError(problems)
        validate(self, self.check_settings())

    def check_settings(self) -> Iterator[Problem]:
        """Yield the problems between parameters that are valid by themselves."""
        yield from ()

    def __str__(self) -> str:
        return f"{self.title} of {', '.join(self.inputs)}: {self.description}"

    @property
    def title(self) -> str:
        """Name for display."""
        return f"{type(self).__name__.removesuffix('Copula').lower()} copula"

    @property
    @abstractmethod
    def description(self) -> str:
        """Parameters in one line."""

    @property
    def parameters(self) -> int:
        """Number of parameters that a fit decides."""
        return 1

    @classmethod
    def fit(
        cls, inputs: tuple[str, ...], kendall: FloatArray, ranks: FloatArray
    ) -> Dependence | None:
        """Return the copula with given rank correlations; None if it cannot have them.

        Parameters
        ----------
        inputs : tuple of str
            The inputs that it joins.
        kendall : ndarray, shape (input, input)
            Kendall's rank correlations.
        ranks : ndarray, shape (row, input)
            Ranks of measurements over their number plus 1, for parameters beside these.
        """
        return None

    def log_density(self, probability: FloatArray) -> FloatArray:
        """Return the logarithm of the density at points of the unit cube, shape (run, input)."""
        raise NotImplementedError(f"{self.title} has no density")

    @abstractmethod
    def score(self, probability: FloatArray) -> FloatArray:
        """Convert probabilities to scores, element by element."""

    @abstractmethod
    def probability(self, score: FloatArray) -> FloatArray:
        """Convert scores to probabilities."""

    @abstractmethod
    def conditional_score(
        self, position: int, probability: FloatArray, known: Mapping[int, FloatArray]
    ) -> FloatArray:
        """Return the conditional quantile of one input's score, given the scores of others.

        Parameters
        ----------
        position : int
            Position in `inputs`.
        probability : ndarray, shape (run,)
            Strictly between 0 and 1.
        known : mapping of int to ndarray, shape (run,)
            The scores of other inputs, by position; at least one.
        """

    def inverse_rosenblatt(
        self, unit: FloatArray, given: Mapping[int, FloatArray] = _NONE_GIVEN
    ) -> FloatArray:
        """Map points with independent coordinates to points that follow the copula.

        Parameters
        ----------
        unit : ndarray, shape (run, input)
            Independent probabilities; the columns of given inputs are ignored.
        given : mapping of int to ndarray, shape (run,)
            The probabilities of given inputs, by position; the copula is then conditional on them.

        Returns
        -------
        ndarray, shape (run, input)
            Given columns are unchanged, or else the first. Without given inputs, each column is
            uniform by itself.
        """
        points = np.clip(unit, *OPEN_INTERVAL)
        for position, column in given.items():
            points[:, position] = np.clip(column, *OPEN_INTERVAL)
        known = {position: self.score(points[:, position]) for position in sorted(given)}
        for position in range(len(self.inputs)):
            if not known:
                known[position] = self.score(points[:, position])
            elif position not in known:
                known[position] = self.conditional_score(position, points[:, position], known)
                points[:, position] = np.clip(self.probability(known[position]), *OPEN_INTERVAL)
        return points


def sum_columns(columns: Mapping[int, FloatArray]) -> FloatArray:
    """Sum columns in the order of their positions, run by run.

    A sum over an axis of an array may go in another order where the array has another shape.
    """
    return functools.reduce(operator.add, [columns[position] for position in sorted(columns)])


# Copulas with one parameter.
#
# A copula of Archimedes' kind is ``psi(phi(u1) + phi(u2) + …)`` with ``phi`` the inverse of
# ``psi``; the conditional distribution of one coordinate given others follows from derivatives of
# ``psi``. Each is inverted in closed form here, or by Newton's method from a starting value from
# which it converges monotonically.
#
# Nelsen, R. B. (2006). An Introduction to Copulas. Springer, chapter 4.

# Nodes and weights of Gauss's rule, by their number.
_gauss_rule = functools.cache(np.polynomial.legendre.leggauss)

# The least probability, 2**-54, to the power of minus this has room in double precision.
_STRONGEST = 16.0

# Newton steps of Joe's copula: 7 suffice for theta above 1.1, and 21 for 1 + 1e-9.
_STEPS = 25


class _OneParameter(Dependence):
    """Copula with a parameter `theta`, the same for every pair of its inputs."""

    theta: float

    @classmethod
    def fit(
        cls, inputs: tuple[str, ...], kendall: FloatArray, ranks: FloatArray
    ) -> Dependence | None:
        mean = float(kendall[np.triu_indices(len(inputs), 1)].mean())

        def excess(theta: float) -> float:
            return cls(inputs, theta).kendall - mean  # type: ignore[call-arg]

        try:
            theta = float(scipy.optimize.brentq(excess, *cls.ends(mean), xtol=1e-12))
            return cls(inputs, theta)  # type: ignore[call-arg]
        except (SettingsError, ValueError):  # of more inputs than it joins, or beyond its range
            return None

    @classmethod
    def ends(cls, kendall: float) -> tuple[float, float]:
        """Return the parameters between which one with a rank correlation lies."""
        return 1 + 1e-6, _STRONGEST - 1e-6

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

    @classmethod
    def ends(cls, kendall: float) -> tuple[float, float]:
        return 1e-6, _STRONGEST - 1e-6

    def log_density(self, probability: FloatArray) -> FloatArray:
        logarithms = np.log(probability)
        size = probability.shape[1]
        total = scipy.special.log1p(self.score(probability).sum(axis=1))
        constant = scipy.special.log1p(self.theta * np.arange(size)).sum()
        return (
            constant - (1 + self.theta) * logarithms.sum(axis=1) - (1 / self.theta + size) * total
        )

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

    def log_density(self, probability: FloatArray) -> FloatArray:
        scores = self.score(probability)
        total = (scores**self.theta).sum(axis=1) ** (1 / self.theta)
        return (
            (scores + (self.theta - 1) * np.log(scores)).sum(axis=1)
            - total
            + (1 - 2 * self.theta) * np.log(total)
            + np.log(total + self.theta - 1)
        )

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
        nodes, weights = _gauss_rule(200)
        x = abs(self.theta) * (nodes + 1) / 2
        debye = float((weights * x / scipy.special.expm1(x)).sum() / 2)
        return float(np.copysign(1 - 4 / abs(self.theta) * (1 - debye), self.theta))

    @classmethod
    def ends(cls, kendall: float) -> tuple[float, float]:
        return (1e-6, 100 - 1e-6) if kendall > 0 else (-100 + 1e-6, -1e-6)

    def log_density(self, probability: FloatArray) -> FloatArray:
        theta = abs(self.theta)
        first, second = probability.T
        if self.theta < 0:
            second = 1 - second
        whole = -scipy.special.expm1(-theta)
        # Both parts are positive: their sum loses no digit.
        rest = -np.exp(-theta * first) * scipy.special.expm1(-theta * second)
        rest -= np.exp(-theta * second) * scipy.special.expm1(-theta * (1 - second))
        return np.log(theta * whole) - theta * (first + second) - 2 * np.log(rest)

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

    def log_density(self, probability: FloatArray) -> FloatArray:
        scores = self.score(probability)  # theta times the logarithm of what is above
        # 1 - (1 - exp(s1)) (1 - exp(s2)), to its own full accuracy.
        joined = np.exp(scores).sum(axis=1) - np.exp(scores.sum(axis=1))
        return (
            (1 / self.theta - 2) * np.log(joined)
            + (1 - 1 / self.theta) * scores.sum(axis=1)
            + np.log(self.theta - 1 + joined)
        )

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


# Copulas of the multivariate normal and Student's t distributions, given by a matrix.
#
# Fang, K. T., Kotz, S. & Ng, K. W. (1990). Symmetric Multivariate and Related Distributions.
# Chapman and Hall.


Matrix = tuple[tuple[float, ...], ...]

# No conditional variance is smaller; rounding leaves it ten digits.
_LEAST_EIGENVALUE = 1e-6

MEASURES = {
    "normal-scores": "the normal scores, the copula's own parameter",
    "t-scores": "the t scores, the copula's own parameter",
    "ranks": "the ranks (Spearman's)",
    "kendall": "the order of two draws (Kendall's)",
}


def score_correlation(correlation: float, measure: str) -> float:
    """Convert a correlation by one of `MEASURES` to the correlation of normal scores.

    The conversion of Kendall's is the same for every elliptical distribution; that of Spearman's is
    the one of the normal distribution (Kruskal, W. H. (1958). J. Am. Stat. Assoc. 53, 814-861).
    """
    if measure == "ranks":
        return 2 * math.sin(math.pi * correlation / 6)
    if measure == "kendall":
        return math.sin(math.pi * correlation / 2)
    return correlation


@dataclass(frozen=True)
class EllipticalCopula(Dependence):
    """Copula of a distribution whose surfaces of equal density are ellipsoids."""

    measures: ClassVar[tuple[str, ...]]
    """Keys of `MEASURES` that convert exactly into a correlation of its scores."""

    inputs: tuple[str, ...]  # the inputs that it joins
    matrix: Matrix  # correlations of the scores

    def check_settings(self) -> Iterator[Problem]:
        size = len(self.inputs)
        if len(self.matrix) != size or any(len(row) != size for row in self.matrix):
            yield Problem(("matrix",), "another size", f"{size} rows of {size} correlations")
            return
        wrong = list(_entry_problems(self.matrix))
        yield from wrong
        least = 1.0 if wrong else float(np.linalg.eigvalsh(np.array(self.matrix))[0])
        if not least > _LEAST_EIGENVALUE:
            found = f"correlations of scores whose matrix has the smallest eigenvalue {least:.3g}"
            expected = f"a positive definite matrix (every eigenvalue above {_LEAST_EIGENVALUE:g})"
            yield Problem(("matrix",), found, f"{expected}: correlations that can hold together")

    @property
    def description(self) -> str:
        pairs = [
            f"{one} and {other} {correlation:.4g}"
            for (row, one), (column, other) in combinations(enumerate(self.inputs), 2)
            if (correlation := self.matrix[row][column])
        ]
        scores = self.measures[0].replace("-", " ")
        return f"correlation of {scores}: {', '.join(pairs or ['none'])}"

    @property
    def parameters(self) -> int:
        return len(self.inputs) * (len(self.inputs) - 1) // 2

    @classmethod
    def fit(
        cls, inputs: tuple[str, ...], kendall: FloatArray, ranks: FloatArray
    ) -> Dependence | None:
        scores = np.sin(np.pi * kendall / 2)
        np.fill_diagonal(scores, 1.0)
        try:
            return cls(inputs, tuple(tuple(row) for row in scores.tolist()))
        except SettingsError:  # no joint distribution has all of them
            return None

    def _regression(
        self, position: int, known: Mapping[int, FloatArray]
    ) -> tuple[FloatArray, float]:
        """Return the conditional mean of a score given others, and its conditional scatter."""
        matrix, others = np.array(self.matrix), sorted(known)
        weights = np.linalg.solve(matrix[np.ix_(others, others)], matrix[others, position])
        mean = sum_columns({key: weights[rank] * known[key] for rank, key in enumerate(others)})
        return mean, math.sqrt(1 - float(weights @ matrix[others, position]))

    def _distance(self, known: Mapping[int, FloatArray]) -> FloatArray:
        """Return the squared Mahalanobis distance of known scores from the centre."""
        others = sorted(known)
        inverse = np.linalg.inv(np.array(self.matrix)[np.ix_(others, others)])
        products = [
            inverse[row, column] * known[one] * known[other]
            for row, one in enumerate(others)
            for column, other in enumerate(others)
        ]
        return sum_columns(dict(enumerate(products)))


@dataclass(frozen=True)
class GaussianCopula(EllipticalCopula):
    """Copula of the multivariate normal distribution."""

    measures = ("normal-scores", "ranks", "kendall")

    def score(self, probability: FloatArray) -> FloatArray:
        return scipy.special.ndtri(probability)

    def probability(self, score: FloatArray) -> FloatArray:
        return scipy.special.ndtr(score)

    def conditional_score(
        self, position: int, probability: FloatArray, known: Mapping[int, FloatArray]
    ) -> FloatArray:
        mean, std = self._regression(position, known)
        return mean + std * scipy.special.ndtri(probability)

    def log_density(self, probability: FloatArray) -> FloatArray:
        scores = self.score(probability)
        distance = self._distance(dict(enumerate(scores.T)))
        return (
            (scores**2).sum(axis=1) - distance - np.linalg.slogdet(np.array(self.matrix))[1]
        ) / 2


@dataclass(frozen=True)
class StudentCopula(EllipticalCopula):
    """Copula of the multivariate t distribution: extreme values of all inputs occur together.

    Parameters
    ----------
    degrees : float
        Its degrees of freedom; the fewer, the more the tails depend.
    """

    measures = ("t-scores", "kendall")

    degrees: float = number(above=1, below=1000, default=4.0)

    @property
    def description(self) -> str:
        return f"{self.degrees:g} degrees of freedom; {super().description}"

    def score(self, probability: FloatArray) -> FloatArray:
        return scipy.special.stdtrit(self.degrees, probability)

    def probability(self, score: FloatArray) -> FloatArray:
        return scipy.special.stdtr(self.degrees, score)

    def conditional_score(
        self, position: int, probability: FloatArray, known: Mapping[int, FloatArray]
    ) -> FloatArray:
        mean, scale = self._regression(position, known)
        degrees = self.degrees + len(known)
        widening = np.sqrt((self.degrees + self._distance(known)) / degrees)
        return mean + scale * widening * scipy.special.stdtrit(degrees, probability)

    @property
    def parameters(self) -> int:
        return super().parameters + 1

    @classmethod
    def fit(
        cls, inputs: tuple[str, ...], kendall: FloatArray, ranks: FloatArray
    ) -> Dependence | None:
        """Return the copula with given rank correlations and the likeliest degrees of freedom."""
        found = super().fit(inputs, kendall, ranks)
        if not isinstance(found, StudentCopula):
            return None

        def negative_likelihood(logarithm: float) -> float:
            made = replace(found, degrees=math.exp(logarithm))
            return -float(made.log_density(ranks).sum())

        # With more degrees it is a Gaussian copula in all but name.
        ends = (math.log(1.1), math.log(100.0))
        best = scipy.optimize.minimize_scalar(
            negative_likelihood, bounds=ends, options={"xatol": 0.02}
        )
        return replace(found, degrees=math.exp(float(best.x)))

    def log_density(self, probability: FloatArray) -> FloatArray:
        scores, size = self.score(probability), len(self.inputs)
        distance = self._distance(dict(enumerate(scores.T)))
        gamma = scipy.special.gammaln
        half = self.degrees / 2
        constant = (
            gamma(half + size / 2)
            + (size - 1) * gamma(half)
            - size * gamma(half + 0.5)
            - np.linalg.slogdet(np.array(self.matrix))[1] / 2
        )
        own = scipy.special.log1p(scores**2 / self.degrees).sum(axis=1) * (half + 0.5)
        return constant - (half + size / 2) * scipy.special.log1p(distance / self.degrees) + own


def _entry_problems(matrix: Matrix) -> Iterator[Problem]:
    """Yield the problems of single entries: the diagonal, the range, the symmetry."""
    for row, values in enumerate(matrix):
        for column, value in enumerate(values):
            where = ("matrix", row, column)
            if row == column:
                if value != 1:
                    yield Problem(where, f"{value:g}", "1 on the diagonal")
            elif not abs(value) < 1:
                yield Problem(where, f"{value:g}", "a correlation between -1 and 1")
            elif column < row and value != matrix[column][row]:
                found = f"{value:g} across the diagonal from {matrix[column][row]:g}"
                yield Problem(where, found, "a symmetric matrix: the same as across the diagonal")
