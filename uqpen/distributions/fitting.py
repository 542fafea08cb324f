"""Maximum-likelihood fit of a named family to measurements, and its goodness of fit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem, SettingsError
from uqpen.distributions.continuous import (
    Gamma,
    Gumbel,
    Lognormal,
    LogUniform,
    Normal,
    Uniform,
    Weibull,
)
from uqpen.distributions.distribution import OPEN_INTERVAL, Distribution

__all__ = ["FAMILIES", "LOWEST_P_VALUE", "NOT_FITTABLE", "DistributionFit", "fit_distribution"]


# Bootstrap samples: enough to distinguish a probability of 0.05 from 0.03 and 0.07.
_SAMPLES = 999

# Most measurements in all samples; a hundred samples still distinguish a bad fit from a good one.
_MOST_DRAWS = 10_000_000
_FEWEST_SAMPLES = 99

# A fit is rejected if a smaller share than this of samples of the fitted distribution fits worse.
LOWEST_P_VALUE = 0.05

NOT_FITTABLE = {
    "triangular": "the likelihood of its three corners has no single maximum",
    "discrete": "its values are given, and counting them needs no fit",
    "beta": "the likelihood of its ends has no bound",
}


@dataclass(frozen=True)
class DistributionFit:
    """Distribution fitted to measurements by maximum likelihood.

    Parameters
    ----------
    distribution : Distribution
        The fitted distribution.
    distance : float
        Kolmogorov-Smirnov distance: the largest difference of its cdf from that of the
        measurements.
    p_value : float
        Share of samples of the fitted distribution, each fitted anew, that lie as far from their
        fit as the measurements from theirs.
    """

    distribution: Distribution
    distance: float
    p_value: float

    @property
    def is_rejected(self) -> bool:
        """True if such measurements would be unlikely under the fitted distribution."""
        return self.p_value < LOWEST_P_VALUE


def fit_distribution(
    family: str, measurements: FloatArray, rng: np.random.Generator, *, samples: int | None = None
) -> DistributionFit:
    """Fit a family to measurements.

    Parameters
    ----------
    family : str
        One of `FAMILIES`.
    measurements : ndarray, shape (measurement,)
        In SI units.
    rng : Generator
        For the bootstrap.
    samples : int, optional
        Number of bootstrap samples; 999, or fewer where there are very many measurements.

    Raises
    ------
    SettingsError
        If no parameters of the family are the likeliest, or they are beyond double precision.

    References
    ----------
    Stute, W., González Manteiga, W. & Presedo Quindimil, M. (1993). Metrika 40, 243-256.
    """
    if samples is None:
        samples = max(_FEWEST_SAMPLES, min(_SAMPLES, _MOST_DRAWS // len(measurements)))
    distribution = _maximum_likelihood(family, measurements)
    distance = _distance(distribution, measurements)
    worse = 0
    for _ in range(samples):
        sample = distribution.ppf(np.clip(rng.random(len(measurements)), *OPEN_INTERVAL))
        worse += _distance(_maximum_likelihood(family, sample), sample) >= distance
    return DistributionFit(distribution, distance, (1 + worse) / (1 + samples))


def _maximum_likelihood(family: str, measurements: FloatArray) -> Distribution:
    if family in _POSITIVE and not (measurements > 0).all():
        found = f"a measurement of {measurements.min():g}"
        expected = f"values above 0, as those of a {family} distribution are"
        raise SettingsError([Problem((), found, expected)])
    # Scaled by a power of two near their size, which is exact: powers neither overflow nor vanish.
    size = math.ldexp(1.0, math.frexp(float(np.abs(measurements).max()))[1] - 1)
    try:
        with np.errstate(all="ignore"):
            distribution = FAMILIES[family](measurements / size, size)
            if distribution.is_finite:
                return distribution
    except (ArithmeticError, ValueError, RuntimeError):
        pass  # the equations have no solution within double precision
    found = f"measurements too far apart, or too near each other, for a {family} distribution"
    raise SettingsError([Problem((), found, "another family")])


def _distance(distribution: Distribution, measurements: FloatArray) -> float:
    probabilities = distribution.cdf(np.sort(measurements))
    steps = np.arange(len(measurements) + 1) / len(measurements)
    return float(max((steps[1:] - probabilities).max(), (probabilities - steps[:-1]).max()))


def _lognormal(x: FloatArray, size: float) -> Lognormal:
    logarithms = np.log(x)
    variance = float(logarithms.var())
    mean = math.exp(float(logarithms.mean()) + variance / 2) * size
    return Lognormal(mean, mean * math.sqrt(math.expm1(variance)))


def _ends(x: FloatArray, size: float) -> tuple[float, float]:
    return float(x.min() * size), float(x.max() * size)


def _gamma(x: FloatArray, size: float) -> Gamma:
    mean = float(x.mean())
    departures = x / mean - 1
    excess = float(np.mean(departures - np.log1p(departures)))  # ln E x - E ln x
    shape = _root(lambda shape: _gamma_excess(shape) - excess, 0.5, 1.0, excess)
    return Gamma(mean * size, mean * size / math.sqrt(shape))


def _gamma_excess(shape: float) -> float:
    """Return ln E x - E ln x of a gamma distribution, between 1 / (2 shape) and 1 / shape."""
    if shape > 1e4:  # where the difference would cancel
        return 1 / (2 * shape) + 1 / (12 * shape**2)
    return math.log(shape) - float(special.digamma(shape))


def _weibull(x: FloatArray, size: float) -> Weibull:
    logarithms = np.log(x)
    middle, scatter = float(logarithms.mean()), float(logarithms.std())

    def slope(shape: float) -> float:
        weights = np.exp(shape * (logarithms - logarithms.max()))
        return float(weights @ logarithms / weights.sum()) - 1 / shape - middle

    shape = _root(slope, 0.1, 10.0, scatter)
    greatest = float(x.max())
    mean_power = float(np.mean((x / greatest) ** shape))
    return Weibull(shape, greatest * mean_power ** (1 / shape) * size)


def _gumbel(x: FloatArray, size: float) -> Gumbel:
    mean, lowest = float(x.mean()), float(x.min())

    def slope(rate: float) -> float:
        weights = np.exp(-rate * (x - lowest))
        return mean - float(weights @ x / weights.sum()) - 1 / rate

    scale = 1 / _root(slope, 0.1, 10.0, float(x.std()))
    location = lowest - scale * math.log(float(np.exp((lowest - x) / scale).mean()))
    std = scale * math.pi / math.sqrt(6)
    return Gumbel((location + np.euler_gamma * scale) * size, std * size)


def _root(slope: Callable[[float], float], low: float, high: float, scatter: float) -> float:
    """Find the zero of a monotonic function of a rate; it is of the order of 1 / scatter."""
    low, high = low / scatter, high / scatter
    rising = slope(high) > slope(low)
    for _ in range(60):
        if (slope(low) < 0) == rising and (slope(high) > 0) == rising:
            return float(optimize.brentq(slope, low, high, rtol=1e-12))
        low, high = low / 2, high * 2
    raise ArithmeticError("no sign change")


FAMILIES: dict[str, Callable[[FloatArray, float], Distribution]] = {
    "normal": lambda x, size: Normal(float(x.mean()) * size, float(x.std()) * size),
    "lognormal": _lognormal,
    "uniform": lambda x, size: Uniform(*_ends(x, size)),
    "log-uniform": lambda x, size: LogUniform(*_ends(x, size)),
    "gamma": _gamma,
    "weibull": _weibull,
    "gumbel": _gumbel,
}

_POSITIVE = frozenset({"lognormal", "log-uniform", "gamma", "weibull"})
