"""Distributions of one input: formulas over `scipy.special`, and a few values."""

from __future__ import annotations

import functools
import math
import operator
from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.settings import (
    count,
    difference,
    limit,
    number,
    numbers,
    quantity,
    quantity_list,
    setting,
)
from uqpen.distributions.distribution import UPPER_TAIL, Distribution, order_problem

_LOG_ROOT_TWO_PI = math.log(2 * math.pi) / 2

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

    def log_density(self, value: FloatArray) -> FloatArray:
        standard = (value - self.mean) / self.std
        return -(standard**2) / 2 - math.log(self.std) - _LOG_ROOT_TWO_PI

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

    def log_density(self, value: FloatArray) -> FloatArray | None:
        logarithms = _log(value)
        of_logarithm = self.logarithm().log_density(logarithms)
        assert of_logarithm is not None  # of a built-in family
        return np.where(value > 0, of_logarithm - logarithms, -np.inf)


@dataclass(frozen=True)
class Lognormal(_OfLogarithm):
    """Lognormal distribution; mean and std are those of the variable, not of its logarithm."""

    mean: float = quantity(above=0)
    std: float = difference(above=0)

    @classmethod
    def of_logarithm(cls, location: float, scale: float) -> Lognormal:
        """Return the distribution whose logarithm has a mean and a standard deviation."""
        mean = math.exp(location + scale**2 / 2)
        return cls(mean, mean * math.sqrt(math.expm1(scale**2)))

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

    def log_density(self, value: FloatArray) -> FloatArray:
        is_inside = (value >= self.lower) & (value <= self.upper)
        return np.where(is_inside, -math.log(self.upper - self.lower), -np.inf)

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

    def log_density(self, value: FloatArray) -> FloatArray:
        width, left = self.upper - self.lower, self.mode - self.lower
        rising = _log((value - self.lower) / (left or 1.0))
        falling = _log((self.upper - value) / (width - left or 1.0))
        # An upright side is at the mode alone.
        one, other = (rising if left else falling), (falling if width > left else rising)
        return np.where(value < self.mode, one, other) + math.log(2 / width)

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

    def log_density(self, value: FloatArray) -> FloatArray:
        inside = Uniform(self.lower, self.upper)
        powers = scipy.special.xlogy(self.alpha - 1, inside.cdf(value)) + scipy.special.xlogy(
            self.beta - 1, inside.sf(value)
        )
        found = powers - scipy.special.betaln(self.alpha, self.beta)
        is_inside = (value >= self.lower) & (value <= self.upper)
        return np.where(is_inside, found - math.log(self.upper - self.lower), -np.inf)

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

    def log_density(self, value: FloatArray) -> FloatArray:
        # From the mean on: of a large shape, the usual terms are large and cancel.
        shape, ratio = self._shape, value / self.mean
        constant = shape * math.log(shape) - shape - float(scipy.special.gammaln(shape))
        if shape > 1e6:  # Stirling's series
            constant = math.log(shape / (2 * math.pi)) / 2 - 1 / (12 * shape)
        logarithms = scipy.special.log1p(ratio - 1)
        found = shape * (logarithms - (ratio - 1)) - logarithms - math.log(self.mean) + constant
        return np.where(value > 0, found, -np.inf)

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

    def log_density(self, value: FloatArray) -> FloatArray:
        ratio = np.maximum(value, 0.0) / self.scale
        powers = scipy.special.xlogy(self.shape - 1, ratio) - ratio**self.shape
        return np.where(value >= 0, powers + math.log(self.shape / self.scale), -np.inf)

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

    def log_density(self, value: FloatArray) -> FloatArray:
        standard = (value - self._location) / self._scale
        return -standard - np.exp(-standard) - math.log(self._scale)

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


class _OfLocationAndScale(Distribution):
    """Distribution of a standard variable times a scale, from a location on."""

    location: float
    scale: float

    @abstractmethod
    def _standard_ppf(self, lower: FloatArray, upper: FloatArray) -> FloatArray:
        """Return the standard quantile from the probabilities below and above it."""

    @abstractmethod
    def _standard_sf(self, z: FloatArray) -> FloatArray: ...

    def _standard_cdf(self, z: FloatArray) -> FloatArray:
        return self._standard_sf(-z)  # of a symmetric one

    @abstractmethod
    def _standard_log_density(self, z: FloatArray) -> FloatArray: ...

    def ppf(self, probability: FloatArray) -> FloatArray:
        return self.location + self.scale * self._standard_ppf(probability, 1 - probability)

    def isf(self, probability: FloatArray) -> FloatArray:
        return self.location + self.scale * self._standard_ppf(1 - probability, probability)

    def cdf(self, value: FloatArray) -> FloatArray:
        return self._standard_cdf((value - self.location) / self.scale)

    def sf(self, value: FloatArray) -> FloatArray:
        return self._standard_sf((value - self.location) / self.scale)

    def log_density(self, value: FloatArray) -> FloatArray:
        standard = (value - self.location) / self.scale
        return self._standard_log_density(standard) - math.log(self.scale)


@dataclass(frozen=True)
class Logistic(_OfLocationAndScale):
    """Logistic distribution, given by its mean and standard deviation."""

    mean: float = quantity()
    std: float = difference(above=0)

    @property
    def location(self) -> float:  # type: ignore[override]
        return self.mean

    @property
    def scale(self) -> float:  # type: ignore[override]
        return self.std * math.sqrt(3) / math.pi

    def _standard_ppf(self, lower: FloatArray, upper: FloatArray) -> FloatArray:
        return _log(lower) - _log(upper)

    def _standard_sf(self, z: FloatArray) -> FloatArray:
        return scipy.special.expit(-z)

    def _standard_log_density(self, z: FloatArray) -> FloatArray:
        return -np.abs(z) - 2 * scipy.special.log1p(np.exp(-np.abs(z)))

    def scores(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        standard = (value - self.location) / self.scale
        share = np.tanh(standard / 2)
        return share, standard * share


# Below this probability, SciPy's quantile of Student's distribution ends.
_FAR_OUT = 1e-30


@dataclass(frozen=True)
class Student(_OfLocationAndScale):
    """Student's t distribution; its standard deviation is larger than `scale`, or infinite."""

    location: float = quantity()
    scale: float = difference(above=0)
    degrees: float = number(above=0, below=1e6)

    @property
    def highest_moment(self) -> float:
        return self.degrees

    def _standard_ppf(self, lower: FloatArray, upper: FloatArray) -> FloatArray:
        tail = np.minimum(lower, upper)
        share = scipy.special.betaincinv(self.degrees / 2, 0.5, 2 * np.minimum(tail, _FAR_OUT))
        far = np.sqrt(self.degrees * (1 / share - 1))
        near = -scipy.special.stdtrit(self.degrees, np.maximum(tail, _FAR_OUT))
        found = np.where(tail < _FAR_OUT, far, near)
        return np.where(lower < upper, -found, found)

    def _standard_sf(self, z: FloatArray) -> FloatArray:
        return scipy.special.stdtr(self.degrees, -z)

    def _standard_log_density(self, z: FloatArray) -> FloatArray:
        half = self.degrees / 2
        constant = float(scipy.special.betaln(half, 0.5)) + math.log(self.degrees) / 2
        return -(half + 0.5) * scipy.special.log1p(z**2 / self.degrees) - constant

    def scores(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        standard = (value - self.location) / self.scale
        share = standard / (self.degrees + standard**2)
        return share, standard * share


@dataclass(frozen=True)
class GeneralisedExtremeValue(_OfLocationAndScale):
    """Generalised extreme value distribution of largest values.

    A `shape` above 0 has the long upper tail of Fréchet's distribution, 0 is Gumbel's, and one
    below 0 ends above, as Weibull's does from below. SciPy's ``c`` is minus this shape.
    """

    location: float = quantity()
    scale: float = difference(above=0)
    shape: float = number(above=-10, below=10)

    @property
    def highest_moment(self) -> float:
        return 1 / self.shape if self.shape > 0 else math.inf

    def _standard_ppf(self, lower: FloatArray, upper: FloatArray) -> FloatArray:
        rate = np.where(lower < upper, -_log(lower), -scipy.special.log1p(-upper))
        return -scipy.special.boxcox(rate, -self.shape)

    def _log_rate(self, z: FloatArray) -> FloatArray:
        """Return ln t, where exp(-t) is the probability below."""
        if not self.shape:
            return -z
        return -scipy.special.log1p(np.maximum(self.shape * z, -1.0)) / self.shape

    def _standard_cdf(self, z: FloatArray) -> FloatArray:
        return np.exp(-np.exp(self._log_rate(z)))

    def _standard_sf(self, z: FloatArray) -> FloatArray:
        return -scipy.special.expm1(-np.exp(self._log_rate(z)))

    def _standard_log_density(self, z: FloatArray) -> FloatArray:
        log_rate = self._log_rate(z)
        found = (1 + self.shape) * log_rate - np.exp(log_rate)
        return np.where(self.shape * z > -1, found, -np.inf)


@dataclass(frozen=True)
class Pareto(Distribution):
    """Pareto distribution: of values above `scale`, P(X > x) = (scale / x) ** shape."""

    is_positive = True

    shape: float = number(above=0)
    scale: float = quantity(above=0)

    @property
    def highest_moment(self) -> float:
        return self.shape

    def ppf(self, probability: FloatArray) -> FloatArray:
        return self.scale * np.exp(-scipy.special.log1p(-probability) / self.shape)

    def isf(self, probability: FloatArray) -> FloatArray:
        return self.scale * np.exp(-_log(probability) / self.shape)

    def cdf(self, value: FloatArray) -> FloatArray:
        return -scipy.special.expm1(-self.shape * self._excess(value))

    def sf(self, value: FloatArray) -> FloatArray:
        return np.exp(-self.shape * self._excess(value))

    def log_density(self, value: FloatArray) -> FloatArray:
        found = math.log(self.shape / self.scale) - (self.shape + 1) * self._excess(value)
        return np.where(value >= self.scale, found, -np.inf)

    def _excess(self, value: FloatArray) -> FloatArray:
        return np.log(np.maximum(value / self.scale, 1.0))


class _SameAs(Distribution):
    """Distribution that another family has with certain parameters."""

    @abstractmethod
    def same(self) -> Distribution:
        """Return the same distribution as a member of that family."""

    def ppf(self, probability: FloatArray) -> FloatArray:
        return self.same().ppf(probability)

    def isf(self, probability: FloatArray) -> FloatArray:
        return self.same().isf(probability)

    def cdf(self, value: FloatArray) -> FloatArray:
        return self.same().cdf(value)

    def sf(self, value: FloatArray) -> FloatArray:
        return self.same().sf(value)

    def log_density(self, value: FloatArray) -> FloatArray | None:
        return self.same().log_density(value)

    def scores(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self.same().scores(value)


@dataclass(frozen=True)
class Exponential(_SameAs):
    """Exponential distribution, whose standard deviation is its mean."""

    is_positive = True

    mean: float = quantity(above=0)

    def same(self) -> Weibull:
        return Weibull(1.0, self.mean)


@dataclass(frozen=True)
class Rayleigh(_SameAs):
    """Rayleigh distribution: the length of two normal components, each of this `scale`."""

    is_positive = True

    scale: float = quantity(above=0)

    def same(self) -> Weibull:
        return Weibull(2.0, self.scale * math.sqrt(2))


@dataclass(frozen=True)
class Arcsine(_SameAs):
    """Arcsine distribution, of a sine at a random phase: U-shaped from lower to upper."""

    lower: float = quantity()
    upper: float = quantity()

    def check_settings(self) -> Iterator[Problem]:
        return order_problem(self.lower, self.upper)

    def same(self) -> Beta:
        return Beta(0.5, 0.5, self.lower, self.upper)


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


# Discrete distributions of an input: a few values, or whole numbers.


class _SingleValues(Distribution):
    """Discrete distribution: its quantile at p is the smallest value with a cdf of p or more."""

    is_discrete = True
    unfitted_reason = "its values are given, and counting them needs no fit"

    @abstractmethod
    def atoms(self) -> tuple[FloatArray, FloatArray]:
        """Return the values with a probability above 0, ascending, and their probabilities."""

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

    @cached_property
    def _steps(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The values, ascending, with the probability of at most and of more than each."""
        values, shares = self.atoms()
        above = np.concatenate([np.cumsum(shares[:0:-1])[::-1], [0.0]])
        below = np.where(above < 0.5, 1 - above, np.cumsum(shares))
        return values, below, above

    def log_density(self, value: FloatArray) -> FloatArray:
        support, shares = self.atoms()
        place = np.minimum(np.searchsorted(support, value), len(support) - 1)
        return np.where(support[place] == value, np.log(shares[place]), -np.inf)


@dataclass(frozen=True)
class Discrete(_SingleValues):
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

    def atoms(self) -> tuple[FloatArray, FloatArray]:
        weights = np.array(self.weights or [1.0] * len(self.values), dtype=np.float64)
        values = np.array(self.values, dtype=np.float64)
        order = np.argsort(values)
        order = order[weights[order] > 0]
        shares = weights[order] / weights.max()
        return values[order], shares / shares.sum()


@dataclass(frozen=True)
class Choice(_SingleValues):
    """Choice among labels, such as kinds of bolts: texts without an order, a mean or a unit.

    Inside, a label is its position among those of the model, whatever the order in the study.

    Parameters
    ----------
    labels : sequence of str
        At least two, each once.
    weights : sequence of float, optional
        Relative probabilities, which need not add up to 1; equal ones by default.
    """

    labels: tuple[str, ...] = setting(
        "labels",
        'labels in a list, such as ["M8", "M10"]',
        lambda labels: isinstance(labels, tuple) and {*map(type, labels)} == {str},
        lambda written, _: tuple(written) if isinstance(written, list) else written,
    )
    weights: tuple[float, ...] = numbers(minimum=0, default=())
    order: tuple[str, ...] = ()  # all labels of the model, in its order

    def __post_init__(self) -> None:
        written: Any = self.labels
        if isinstance(written, list):  # of a program
            object.__setattr__(self, "labels", tuple(written))
        super().__post_init__()

    def check_settings(self) -> Iterator[Problem]:
        if len(set(self.labels)) < max(len(self.labels), 2):
            yield Problem(("labels",), f"{len(set(self.labels))} of them", "two or more, each once")
        if self.weights and len(self.weights) != len(self.labels):
            expected = f"one for each of the {len(self.labels)} labels"
            yield Problem(("weights",), f"{len(self.weights)} weights", expected)
        elif self.weights and sum(weight > 0 for weight in self.weights) < 2:
            yield Problem(("weights",), "fewer than two above 0", "at least two above 0")

    def atoms(self) -> tuple[FloatArray, FloatArray]:
        places = [(self.order or self.labels).index(label) for label in self.labels]
        weights = self.weights or (1.0,) * len(places)
        return Discrete(tuple(map(float, places)), weights).atoms()

    @property
    def median(self) -> float:
        """The likeliest label, in place of a median; the first of several."""
        values, shares = self.atoms()
        return float(values[shares.argmax()])


# Standard deviations, and whole numbers beside them, on either side of the mean of counts, beyond
# which a double has no probability (by Chernoff's bound), and the most of them.
_DEVIATIONS, _BESIDE = 45, 500
_MOST_COUNTS = 1_000_000
_MOST_TRIALS = 1_000_000_000


class _WholeNumbers(_SingleValues):
    """Distribution on whole numbers, which have no unit.

    The probabilities are products of their ratios, from the most probable number on. So both tails
    have all digits; of rare successes in a billion trials, incomplete beta functions have eight.
    """

    is_count = True

    @abstractmethod
    def _ends(self) -> tuple[float, float]:
        """Return whole numbers between which all probability lies that a double can state."""

    @abstractmethod
    def _ratios(self, k: FloatArray) -> FloatArray:
        """Return the probability of k + 1 over that of k, which does not increase with k."""

    def atoms(self) -> tuple[FloatArray, FloatArray]:
        return self._atoms

    @cached_property
    def _atoms(self) -> tuple[FloatArray, FloatArray]:
        first, last = self._ends()
        k = np.arange(first, last + 1, dtype=np.float64)
        ratios = self._ratios(k[:-1])
        most_probable = int((ratios >= 1).sum())
        with np.errstate(under="ignore"):
            rising = np.cumprod(1 / ratios[:most_probable][::-1])[::-1]
            falling = np.cumprod(ratios[most_probable:])
        shares = np.concatenate([rising, [1.0], falling])
        shares /= shares.sum()
        return k[shares > 0], shares[shares > 0]


@dataclass(frozen=True)
class Poisson(_WholeNumbers):
    """Poisson distribution: a number of events that occur independently at a constant rate."""

    mean: float = number(above=0, at_most=_MOST_COUNTS)

    def _ends(self) -> tuple[float, float]:
        reach = _DEVIATIONS * math.sqrt(self.mean)
        return max(0, math.floor(self.mean - reach)), math.ceil(self.mean + reach + _BESIDE)

    def _ratios(self, k: FloatArray) -> FloatArray:
        return self.mean / (k + 1)


@dataclass(frozen=True)
class Binomial(_WholeNumbers):
    """Binomial distribution: the successes among independent trials of one probability."""

    trials: int = count(maximum=_MOST_TRIALS)
    probability: float = number(above=0, below=1)

    def check_settings(self) -> Iterator[Problem]:
        if self.trials * self.probability > _MOST_COUNTS:
            found = f"{self.trials * self.probability:g} successes in the mean"
            yield Problem((), found, f"at most {_MOST_COUNTS:_}; a normal distribution is as near")

    def _ends(self) -> tuple[float, float]:
        first, last = Poisson(self.trials * self.probability)._ends()
        return first, min(last, self.trials)

    def _ratios(self, k: FloatArray) -> FloatArray:
        return (self.trials - k) / (k + 1) * (self.probability / (1 - self.probability))


@dataclass(frozen=True)
class Bernoulli(_WholeNumbers):
    """Bernoulli distribution: 1 with a probability, else 0."""

    probability: float = number(above=0, below=1)

    def _ends(self) -> tuple[float, float]:
        return 0, 1

    def _ratios(self, k: FloatArray) -> FloatArray:
        return np.full_like(k, self.probability / (1 - self.probability))


@dataclass(frozen=True)
class Integer(_WholeNumbers):
    """Uniform distribution on the whole numbers from lower to upper, both included."""

    lower: int = count(minimum=-_MOST_TRIALS, maximum=_MOST_TRIALS)
    upper: int = count(minimum=-_MOST_TRIALS, maximum=_MOST_TRIALS)

    def check_settings(self) -> Iterator[Problem]:
        yield from order_problem(self.lower, self.upper)
        if self.upper - self.lower >= _MOST_COUNTS:
            found = f"{self.upper - self.lower + 1:_} whole numbers"
            yield Problem((), found, f"at most {_MOST_COUNTS:_}, or a uniform distribution")

    def _ends(self) -> tuple[float, float]:
        return self.lower, self.upper

    def _ratios(self, k: FloatArray) -> FloatArray:
        return np.ones_like(k)


# Distributions made of others: truncated ones, and mixtures.


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

    @property
    def highest_moment(self) -> float:
        return self.parent.highest_moment if math.isinf(self.upper - self.lower) else math.inf

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

    def log_density(self, value: FloatArray) -> FloatArray | None:
        found = self.parent.log_density(value)
        if found is None:
            return None
        is_inside = (value >= self.lower) & (value <= self.upper)
        return np.where(is_inside, found - math.log(self._mass()), -np.inf)

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


@dataclass(frozen=True)
class Mixture(Distribution):
    """Mixture: a value follows one of several distributions, each with a probability.

    Parameters
    ----------
    parts : sequence of Distribution
        At least two, none of them discrete.
    weights : sequence of float, optional
        Relative probabilities, which need not add up to 1; equal ones by default.

    Examples
    --------
    >>> life = Mixture([Normal(0.0, 1.0), Normal(4.0, 0.5)], [0.7, 0.3])
    >>> round(float(life.sf(np.array(4.0))), 10)
    0.1500221699
    """

    parts: tuple[Distribution, ...]
    weights: tuple[float, ...] = numbers(default=())

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", tuple(self.parts))
        super().__post_init__()

    def check_settings(self) -> Iterator[Problem]:
        if len(self.parts) < 2:
            yield Problem((), f"{len(self.parts)} distributions", "at least two, to be mixed")
        if any(part.is_discrete for part in self.parts):
            expected = "continuous ones; values and their probabilities are one discrete one"
            yield Problem((), "a discrete distribution in a mixture", expected)
        if self.weights and len(self.weights) != len(self.parts):
            expected = f"one for each of the {len(self.parts)} distributions"
            yield Problem(("weights",), f"{len(self.weights)} weights", expected)
        elif not all(weight > 0 for weight in self.weights):
            yield Problem(("weights",), "a weight of 0 or less", "weights above 0")

    @property
    def shares(self) -> tuple[float, ...]:
        """Probability of each part."""
        weights = self.weights or (1.0,) * len(self.parts)
        return tuple(weight / math.fsum(weights) for weight in weights)

    @property
    def least_upper_tail(self) -> float:
        return max(part.least_upper_tail for part in self.parts)

    @property
    def highest_moment(self) -> float:
        return min(part.highest_moment for part in self.parts)

    def ppf(self, probability: FloatArray) -> FloatArray:
        return self._inverse(np.asarray(probability), 1 - np.asarray(probability))

    def isf(self, probability: FloatArray) -> FloatArray:
        return self._inverse(1 - np.asarray(probability), np.asarray(probability))

    def cdf(self, value: FloatArray) -> FloatArray:
        return self._sum([part.cdf(value) for part in self.parts])

    def sf(self, value: FloatArray) -> FloatArray:
        return self._sum([part.sf(value) for part in self.parts])

    def log_density(self, value: FloatArray) -> FloatArray | None:
        found = [part.log_density(value) for part in self.parts]
        densities = [each for each in found if each is not None]
        if len(densities) < len(found):
            return None
        largest = np.max(densities, axis=0)
        shift = np.where(np.isfinite(largest), largest, 0.0)
        return shift + np.log(self._sum([np.exp(each - shift) for each in densities]))

    def _sum(self, columns: Sequence[FloatArray]) -> FloatArray:
        return functools.reduce(
            operator.add, map(operator.mul, self.shares, columns), np.zeros_like(columns[0])
        )

    def _inverse(self, lower: FloatArray, upper: FloatArray) -> FloatArray:
        """Return quantiles from the probabilities below and above, by bisection.

        The probability above decides in the upper half, where it has the digits. Halves are taken
        of the places among all doubles, so an ulp remains of any value.
        """
        is_low = lower <= upper
        ends = np.array([np.where(is_low, part.ppf(lower), part.isf(upper)) for part in self.parts])
        low, high = _places(ends.min(axis=0)), _places(ends.max(axis=0))
        while (high - low > 1).any():
            middle = (low >> 1) + (high >> 1) + (low & high & 1)
            value = _at_places(middle)
            reaches = np.where(is_low, self.cdf(value) >= lower, self.sf(value) <= upper)
            high, low = np.where(reaches, middle, high), np.where(reaches, low, middle)
        return _at_places(high)


def _places(value: FloatArray) -> npt.NDArray[np.int64]:
    """Return the place of each number among all doubles in ascending order, as an integer."""
    bits = np.asarray(value + 0.0).view(np.int64)  # a negative zero has no place of its own
    return np.where(bits < 0, np.int64(-(2**63)) - bits, bits)


def _at_places(place: npt.NDArray[np.int64]) -> FloatArray:
    """Return the numbers at places among all doubles."""
    bits = np.where(place < 0, np.int64(-(2**63)) - place, place)
    return bits.view(np.float64)
