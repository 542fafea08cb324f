"""Distributions of one input: formulas over `scipy.special`, and a few values."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.settings import difference, limit, number, numbers, quantity, quantity_list
from uqpen.distributions.distribution import UPPER_TAIL, Distribution, order_problem

# Continuous distributions of an input, each a few formulas over `scipy.special`.
#
# Parameters are those of the variable itself: the ``mean`` of a lognormal distribution is the mean
# of the variable, not of its logarithm.


@dataclass(frozen=True)
class Normal(Distribution):
    """Normal distribution."""

    mean: float = quantity()
    std: float = difference(above=0)

    def ppf(self, probability: FloatArray) -> FloatArray:
        return self.mean + self.std * scipy.special.ndtri(probability)

    def isf(self, probability: FloatArray) -> FloatArray:
        return self.mean - self.std * scipy.special.ndtri(probability)

    def cdf(self, value: FloatArray) -> FloatArray:
        return scipy.special.ndtr((value - self.mean) / self.std)

    def sf(self, value: FloatArray) -> FloatArray:
        return scipy.special.ndtr((self.mean - value) / self.std)

    @classmethod
    def fit(cls, x: FloatArray, size: float) -> Normal:
        return cls(float(x.mean()) * size, float(x.std()) * size)


class _OfLogarithm(Distribution):
    """Distribution of a variable whose logarithm has a simpler one."""

    is_positive = True

    @abstractmethod
    def logarithm(self) -> Distribution: ...

    def ppf(self, probability: FloatArray) -> FloatArray:
        return np.exp(self.logarithm().ppf(probability))

    def isf(self, probability: FloatArray) -> FloatArray:
        return np.exp(self.logarithm().isf(probability))

    def cdf(self, value: FloatArray) -> FloatArray:
        return self.logarithm().cdf(_log(value))

    def sf(self, value: FloatArray) -> FloatArray:
        return self.logarithm().sf(_log(value))


@dataclass(frozen=True)
class Lognormal(_OfLogarithm):
    """Lognormal distribution; mean and std are those of the variable, not of its logarithm."""

    mean: float = quantity(above=0)
    std: float = difference(above=0)

    def logarithm(self) -> Normal:
        variance = math.log1p((self.std / self.mean) ** 2)
        return Normal(math.log(self.mean) - variance / 2, math.sqrt(variance))

    def scores(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self.logarithm().scores(_log(value))

    @classmethod
    def fit(cls, x: FloatArray, size: float) -> Lognormal:
        logarithms = np.log(x)
        variance = float(logarithms.var())
        mean = math.exp(float(logarithms.mean()) + variance / 2) * size
        return cls(mean, mean * math.sqrt(math.expm1(variance)))


@dataclass(frozen=True)
class Uniform(Distribution):
    """Uniform distribution between two values."""

    lower: float = quantity()
    upper: float = quantity()

    def check_settings(self) -> Iterator[Problem]:
        return order_problem(self.lower, self.upper)

    def ppf(self, probability: FloatArray) -> FloatArray:
        return self.lower + (self.upper - self.lower) * probability

    def isf(self, probability: FloatArray) -> FloatArray:
        return self.upper - (self.upper - self.lower) * probability

    def cdf(self, value: FloatArray) -> FloatArray:
        return np.clip((value - self.lower) / (self.upper - self.lower), 0.0, 1.0)

    def sf(self, value: FloatArray) -> FloatArray:
        return np.clip((self.upper - value) / (self.upper - self.lower), 0.0, 1.0)

    @classmethod
    def fit(cls, x: FloatArray, size: float) -> Uniform:
        return cls(float(x.min() * size), float(x.max() * size))


@dataclass(frozen=True)
class LogUniform(_OfLogarithm):
    """Log-uniform distribution: the logarithm of the variable is uniform."""

    lower: float = quantity(above=0)
    upper: float = quantity(above=0)

    def check_settings(self) -> Iterator[Problem]:
        return order_problem(self.lower, self.upper)

    def logarithm(self) -> Uniform:
        return Uniform(math.log(self.lower), math.log(self.upper))

    def ppf(self, probability: FloatArray) -> FloatArray:
        # Rounding must not carry a value past the ends.
        return np.clip(super().ppf(probability), self.lower, self.upper)

    def isf(self, probability: FloatArray) -> FloatArray:
        return np.clip(super().isf(probability), self.lower, self.upper)

    @classmethod
    def fit(cls, x: FloatArray, size: float) -> LogUniform:
        return cls(float(x.min() * size), float(x.max() * size))


@dataclass(frozen=True)
class Triangular(Distribution):
    """Triangular distribution: the density is largest at the mode, zero outside lower and upper."""

    unfitted_reason = "the likelihood of its three corners has no single maximum"

    lower: float = quantity()
    mode: float = quantity()
    upper: float = quantity()

    def check_settings(self) -> Iterator[Problem]:
        yield from order_problem(self.lower, self.upper)
        if self.lower < self.upper and not self.lower <= self.mode <= self.upper:
            yield Problem(("mode",), f"{self.mode:g}", "a value from lower to upper")

    def ppf(self, probability: FloatArray) -> FloatArray:
        width, left = self.upper - self.lower, self.mode - self.lower
        rising = self.lower + np.sqrt(probability * width * left)
        falling = self.upper - np.sqrt((1 - probability) * width * (width - left))
        return np.where(probability * width <= left, rising, falling)

    def isf(self, probability: FloatArray) -> FloatArray:
        return -self._mirror().ppf(probability)

    def cdf(self, value: FloatArray) -> FloatArray:
        width, left = self.upper - self.lower, self.mode - self.lower
        x = np.clip(value, self.lower, self.upper)
        # The side of a mode at an end has no width; dividing by one instead leaves its zero.
        rising = (x - self.lower) ** 2 / (width * (left or 1.0))
        falling = 1 - (self.upper - x) ** 2 / (width * (width - left or 1.0))
        return np.where(x <= self.mode, rising, falling) if left else falling

    def sf(self, value: FloatArray) -> FloatArray:
        return self._mirror().cdf(-value)

    def _mirror(self) -> Triangular:
        return Triangular(-self.upper, -self.mode, -self.lower)


@dataclass(frozen=True)
class Beta(Distribution):
    """Beta distribution, scaled to the range from lower to upper."""

    unfitted_reason = "the likelihood of its ends has no bound"

    alpha: float = number(above=0)
    beta: float = number(above=0)
    lower: float = quantity()
    upper: float = quantity()

    def check_settings(self) -> Iterator[Problem]:
        return order_problem(self.lower, self.upper)

    def ppf(self, probability: FloatArray) -> FloatArray:
        unit = scipy.special.betaincinv(self.alpha, self.beta, probability)
        return self.lower + (self.upper - self.lower) * unit

    def isf(self, probability: FloatArray) -> FloatArray:
        unit = scipy.special.betaincinv(self.beta, self.alpha, probability)
        return self.upper - (self.upper - self.lower) * unit

    def cdf(self, value: FloatArray) -> FloatArray:
        unit = Uniform(self.lower, self.upper).cdf(value)
        return scipy.special.betainc(self.alpha, self.beta, unit)

    def sf(self, value: FloatArray) -> FloatArray:
        unit = Uniform(self.lower, self.upper).sf(value)
        return scipy.special.betainc(self.beta, self.alpha, unit)

    def scores(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        inside = Uniform(self.lower, self.upper)
        return _finite_log(inside.cdf(value)), _finite_log(inside.sf(value))


@dataclass(frozen=True)
class Gamma(Distribution):
    """Gamma distribution, given by its mean and standard deviation."""

    is_positive = True

    mean: float = quantity(above=0)
    std: float = difference(above=0)

    @property
    def _shape(self) -> float:
        return (self.mean / self.std) ** 2

    @property
    def _scale(self) -> float:
        return self.std * (self.std / self.mean)

    def ppf(self, probability: FloatArray) -> FloatArray:
        return self._scale * scipy.special.gammaincinv(self._shape, probability)

    def isf(self, probability: FloatArray) -> FloatArray:
        return self._scale * scipy.special.gammainccinv(self._shape, probability)

    def cdf(self, value: FloatArray) -> FloatArray:
        return scipy.special.gammainc(self._shape, np.maximum(value, 0.0) / self._scale)

    def sf(self, value: FloatArray) -> FloatArray:
        return scipy.special.gammaincc(self._shape, np.maximum(value, 0.0) / self._scale)

    def scores(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        return _finite_log(value / self._scale), value / self._scale

    @classmethod
    def fit(cls, x: FloatArray, size: float) -> Gamma:
        mean = float(x.mean())
        departures = x / mean - 1
        excess = float(np.mean(departures - np.log1p(departures)))  # ln E x - E ln x

        def excess_of(shape: float) -> float:
            """Return ln E x - E ln x of a gamma distribution, from 1 / (2 shape) to 1 / shape."""
            if shape > 1e4:  # where the difference would cancel
                return 1 / (2 * shape) + 1 / (12 * shape**2)
            return math.log(shape) - float(scipy.special.digamma(shape))

        shape = _root(lambda shape: excess_of(shape) - excess, 0.5, 1.0, excess)
        return cls(mean * size, mean * size / math.sqrt(shape))


@dataclass(frozen=True)
class Weibull(Distribution):
    """Two-parameter Weibull distribution; `scale` is its 63.2 % quantile."""

    is_positive = True

    shape: float = number(above=0)
    scale: float = quantity(above=0)

    def ppf(self, probability: FloatArray) -> FloatArray:
        return self.scale * (-scipy.special.log1p(-probability)) ** (1 / self.shape)

    def isf(self, probability: FloatArray) -> FloatArray:
        return self.scale * (-_log(probability)) ** (1 / self.shape)

    def cdf(self, value: FloatArray) -> FloatArray:
        return -scipy.special.expm1(-((np.maximum(value, 0.0) / self.scale) ** self.shape))

    def sf(self, value: FloatArray) -> FloatArray:
        return np.exp(-((np.maximum(value, 0.0) / self.scale) ** self.shape))

    def scores(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        log_ratio = _finite_log(value / self.scale)
        power = np.exp(self.shape * log_ratio)
        return power, log_ratio * (1 - power)

    @classmethod
    def fit(cls, x: FloatArray, size: float) -> Weibull:
        logarithms = np.log(x)
        middle, scatter = float(logarithms.mean()), float(logarithms.std())

        def slope(shape: float) -> float:
            weights = np.exp(shape * (logarithms - logarithms.max()))
            return float(weights @ logarithms / weights.sum()) - 1 / shape - middle

        shape = _root(slope, 0.1, 10.0, scatter)
        greatest = float(x.max())
        mean_power = float(np.mean((x / greatest) ** shape))
        return cls(shape, greatest * mean_power ** (1 / shape) * size)


@dataclass(frozen=True)
class Gumbel(Distribution):
    """Gumbel distribution of largest values, given by its mean and standard deviation."""

    mean: float = quantity()
    std: float = difference(above=0)

    @property
    def _scale(self) -> float:
        return self.std * math.sqrt(6) / math.pi

    @property
    def _location(self) -> float:
        return self.mean - np.euler_gamma * self._scale

    def ppf(self, probability: FloatArray) -> FloatArray:
        return self._location - self._scale * _log(-_log(probability))

    def isf(self, probability: FloatArray) -> FloatArray:
        return self._location - self._scale * _log(-scipy.special.log1p(-probability))

    def cdf(self, value: FloatArray) -> FloatArray:
        return np.exp(-np.exp((self._location - value) / self._scale))

    def sf(self, value: FloatArray) -> FloatArray:
        return -scipy.special.expm1(-np.exp((self._location - value) / self._scale))

    def scores(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        standard = (value - self._location) / self._scale
        share = 1 - np.exp(-standard)
        return share, standard * share

    @classmethod
    def fit(cls, x: FloatArray, size: float) -> Gumbel:
        mean, lowest = float(x.mean()), float(x.min())

        def slope(rate: float) -> float:
            weights = np.exp(-rate * (x - lowest))
            return mean - float(weights @ x / weights.sum()) - 1 / rate

        scale = 1 / _root(slope, 0.1, 10.0, float(x.std()))
        location = lowest - scale * math.log(float(np.exp((lowest - x) / scale).mean()))
        std = scale * math.pi / math.sqrt(6)
        return cls((location + np.euler_gamma * scale) * size, std * size)


def _log(value: FloatArray) -> FloatArray:
    """Return the logarithm with log(0) = -inf and no warning, for the ends of a distribution."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(np.maximum(value, 0.0))


def _finite_log(value: FloatArray) -> FloatArray:
    """Return the logarithm, of the smallest number where a value has been rounded to 0."""
    return np.log(np.maximum(value, np.finfo(np.float64).tiny))


def _root(slope: Callable[[float], float], low: float, high: float, scatter: float) -> float:
    """Find the zero of a monotonic function of a rate; it is of the order of 1 / scatter."""
    low, high = low / scatter, high / scatter
    rising = slope(high) > slope(low)
    for _ in range(60):
        if (slope(low) < 0) == rising and (slope(high) > 0) == rising:
            return float(scipy.optimize.brentq(slope, low, high, rtol=1e-12))
        low, high = low / 2, high * 2
    raise ArithmeticError("no sign change")


# Discrete distribution of an input: a few values, each with a probability.


@dataclass(frozen=True)
class Discrete(Distribution):
    """Discrete distribution: its quantile at p is the smallest value with a cdf of p or more.

    Parameters
    ----------
    values : sequence of float or str
        At least two, in any order, each once.
    weights : sequence of float, optional
        Relative probabilities, which need not add up to 1; equal ones by default.

    Examples
    --------
    >>> bolts = Discrete(["8 mm", "10 mm", "12 mm"], [1, 2, 1])
    >>> bolts.ppf(np.array([0.2, 0.5, 0.9]))
    array([0.008, 0.01 , 0.012])
    """

    is_discrete = True
    unfitted_reason = "its values are given, and counting them needs no fit"

    values: tuple[float, ...] = quantity_list()
    weights: tuple[float, ...] = numbers(minimum=0, default=())

    def check_settings(self) -> Iterator[Problem]:
        if len(set(self.values)) < max(len(self.values), 2):
            yield Problem(("values",), f"{len(set(self.values))} of them", "two or more, each once")
        if self.weights and len(self.weights) != len(self.values):
            expected = f"one for each of the {len(self.values)} values"
            yield Problem(("weights",), f"{len(self.weights)} weights", expected)
        elif self.weights and sum(weight > 0 for weight in self.weights) < 2:
            yield Problem(("weights",), "fewer than two above 0", "at least two above 0")

    @classmethod
    def from_sample(cls, values: FloatArray, weights: FloatArray) -> Discrete:
        """Return the distribution of weighted values; equal ones are taken together."""
        distinct, place = np.unique(values, return_inverse=True)
        total = np.bincount(place, weights, len(distinct))
        return cls(tuple(distinct.tolist()), tuple(total.tolist()))

    def ppf(self, probability: FloatArray) -> FloatArray:
        support, below, _ = self._steps
        return support[np.minimum(np.searchsorted(below, probability), len(support) - 1)]

    def isf(self, probability: FloatArray) -> FloatArray:
        support, _, above = self._steps
        # The probabilities above descend; the first of at most the given one counts.
        place = len(above) - np.searchsorted(above[::-1], probability, side="right")
        return support[np.minimum(place, len(support) - 1)]

    def cdf(self, value: FloatArray) -> FloatArray:
        support, below, _ = self._steps
        return np.concatenate([[0.0], below])[np.searchsorted(support, value, side="right")]

    def sf(self, value: FloatArray) -> FloatArray:
        support, _, above = self._steps
        return np.concatenate([[1.0], above])[np.searchsorted(support, value, side="right")]

    def atoms(self) -> tuple[FloatArray, FloatArray]:
        """Return the values with a probability above 0, ascending, and their probabilities."""
        weights = np.array(self.weights or [1.0] * len(self.values), dtype=np.float64)
        values = np.array(self.values, dtype=np.float64)
        order = np.argsort(values)
        order = order[weights[order] > 0]
        shares = weights[order] / weights.max()
        return values[order], shares / shares.sum()

    @cached_property
    def _steps(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The values, ascending, with the probability of at most and of more than each."""
        values, shares = self.atoms()
        above = np.concatenate([np.cumsum(shares[:0:-1])[::-1], [0.0]])
        below = np.where(above < 0.5, 1 - above, np.cumsum(shares))
        return values, below, above


@dataclass(frozen=True)
class Truncated(Distribution):
    """Truncated distribution: its parent, conditional on lying between two values.

    The parent keeps its parameters.

    Parameters
    ----------
    parent : Distribution
        The distribution before truncation.
    lower, upper : float
        Ends of the truncated support; infinite for an open end.
    """

    parent: Distribution
    lower: float = limit(default=-math.inf)
    upper: float = limit(default=math.inf)

    def check_settings(self) -> Iterator[Problem]:
        if self.parent.is_discrete:
            yield Problem((), "limits of a discrete distribution", "its values within them alone")
            return
        yield from order_problem(self.lower, self.upper)
        try:
            has_mass = self._mass() > 0
        except ArithmeticError:
            has_mass = False  # parameters so large or small that the formulas overflow
        if 0 < self.parent.least_upper_tail > float(self.parent.sf(np.array(self.lower))):
            least = self.parent.least_upper_tail
            expected = f"a probability of {least:g} or more above it: {UPPER_TAIL}"
            yield Problem(("lower",), f"{self.lower:g}", expected)
        elif self.lower < self.upper and not has_mass:
            found = f"{self.lower:g} to {self.upper:g}, where the distribution has no probability"
            yield Problem((), found, "limits that leave some of the distribution")

    @property
    def least_upper_tail(self) -> float:
        return self.parent.least_upper_tail if math.isinf(self.upper) else 0.0

    def logarithm(self) -> Truncated | None:
        parent = self.parent.logarithm()
        if parent is None:
            return None
        lower = math.log(self.lower) if self.lower > 0 else -math.inf
        return Truncated(parent, lower, math.log(self.upper))

    def ppf(self, probability: FloatArray) -> FloatArray:
        return self._inverse(probability, 1 - probability)

    def isf(self, probability: FloatArray) -> FloatArray:
        return self._inverse(1 - probability, probability)

    def cdf(self, value: FloatArray) -> FloatArray:
        x = np.clip(value, self.lower, self.upper)
        return self._probability(np.array(self.lower), x) / self._mass()

    def sf(self, value: FloatArray) -> FloatArray:
        x = np.clip(value, self.lower, self.upper)
        return self._probability(x, np.array(self.upper)) / self._mass()

    def scores(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self.parent.scores(value)

    def _is_upper_tail(self) -> bool:
        """Check that the support lies in the parent's upper half, where 1 - F is accurate."""
        return bool(self.parent.cdf(np.array(self.lower)) > 0.5)

    def _probability(self, lower: FloatArray, upper: FloatArray) -> FloatArray:
        """Return the parent's probability between two values."""
        if self._is_upper_tail():
            return self.parent.sf(lower) - self.parent.sf(upper)
        return self.parent.cdf(upper) - self.parent.cdf(lower)

    def _mass(self) -> float:
        return float(self._probability(np.array(self.lower), np.array(self.upper)))

    def _inverse(self, probability: FloatArray, complement: FloatArray) -> FloatArray:
        parent = self.parent
        tail, inverse = (
            (parent.sf, parent.isf) if self._is_upper_tail() else (parent.cdf, parent.ppf)
        )
        lower, upper = tail(np.array(self.lower)), tail(np.array(self.upper))
        return np.clip(inverse(complement * lower + probability * upper), self.lower, self.upper)
