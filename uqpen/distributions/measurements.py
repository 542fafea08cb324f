"""Measurements of an input: read from a file, and as an empirical or a fitted distribution."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.columns import Column
from uqpen.core.errors import Problem, SettingsError
from uqpen.core.lookup import resolve
from uqpen.core.model import Input
from uqpen.core.settings import declared_settings
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.distributions import DISTRIBUTIONS
from uqpen.distributions.distribution import OPEN_INTERVAL, Distribution

# Measurements of an input in a file beside the study.

# On average, a share (n - 1) / (n + 1) of the distribution lies between the least and the greatest
# of n measurements. An empirical distribution has no more than this share: 82 % for n = 10.
FEWEST = 10

# A family adds the rest of the distribution. More measurements than its two parameters are needed
# to check the fit.
FEWEST_FOR_A_FAMILY = 5


def check_measurements(
    values: FloatArray, column: Column, variable: Input, *, fewest: int
) -> Iterator[Problem]:
    """Check measurements of an input, in SI units, and yield the problems."""
    if len(values) < fewest:
        yield Problem((), f"{len(values)} measurements", f"at least {fewest}")
    elif len(np.unique(values)) < 2:
        yield Problem((), f"{len(values)} measurements that are all the same", "some that differ")
    outside = np.flatnonzero(~variable.bounds.contain(values))
    if outside.size:
        first = int(outside[0])
        found = f"{value_text(values[first], column.unit)} as measurement {first + 1}"
        where = "" if variable.unit == DIMENSIONLESS else f" {variable.unit}"
        yield Problem((), found, f"values {variable.bounds}{where}")


def value_text(value: float, unit: str) -> str:
    """Format a value given in SI units for display."""
    return _with_unit(scale(unit).from_si(value), unit)


def parameters_text(distribution: Distribution, unit: str) -> str:
    """Return the parameters of a distribution in one line, in a unit of its variable."""
    parts = []
    for field, setting in declared_settings(distribution):
        value = getattr(distribution, field.name)
        if setting.kind == "quantity":
            text = value_text(value, unit)
        elif setting.kind == "difference":
            text = _with_unit(scale(unit).difference_from_si(value), unit)
        else:
            text = f"{value:.4g}"
        parts.append(f"{field.name} {text}")
    return ", ".join(parts)


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.4g}" if unit == DIMENSIONLESS else f"{value:.4g} {unit}"


# Empirical distribution of an input: its measurements without a named family.


@dataclass(frozen=True)
class Empirical(Distribution):
    """Empirical distribution: quantiles are interpolated linearly between measurements.

    The measurement of rank ``i`` of ``n`` is the quantile of ``(i - 1/2) / n``; beyond the first
    and the last the quantile is constant. So no draw lies outside the measured range, and the mean
    is exactly that of the measurements.

    References
    ----------
    Hazen, A. (1914). Trans. Am. Soc. Civ. Eng. 77, 1539-1640.
    """

    measurements: tuple[float, ...]  # in SI units, in any order; at least two of them differ

    def check_settings(self) -> Iterator[Problem]:
        if not np.isfinite(self.measurements).all():
            yield Problem((), "a measurement that is no number", "finite numbers")
        elif len(set(self.measurements)) < 2:
            yield Problem((), "measurements that do not differ", "at least two that do")

    def ppf(self, probability: FloatArray) -> FloatArray:
        return np.interp(probability, self._positions, self._ordered)

    def isf(self, probability: FloatArray) -> FloatArray:
        return np.interp(probability, self._positions, self._ordered[::-1])

    def cdf(self, value: FloatArray) -> FloatArray:
        distinct, first, last = self._steps
        rank = np.searchsorted(distinct, value, side="right") - 1
        lower = np.clip(rank, 0, len(distinct) - 2)
        share = (value - distinct[lower]) / (distinct[lower + 1] - distinct[lower])
        inside = last[lower] + np.clip(share, 0.0, 1.0) * (first[lower + 1] - last[lower])
        return np.where(rank < 0, 0.0, np.where(rank > lower, 1.0, inside))

    def sf(self, value: FloatArray) -> FloatArray:
        return 1 - self.cdf(value)

    @cached_property
    def _ordered(self) -> FloatArray:
        return np.sort(np.array(self.measurements))

    @cached_property
    def _positions(self) -> FloatArray:
        return (np.arange(len(self.measurements)) + 0.5) / len(self.measurements)

    @cached_property
    def _steps(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distinct measurements, and the first and last position of each.

        A value measured several times has a probability of its own.
        """
        distinct, first, counts = np.unique(self._ordered, return_index=True, return_counts=True)
        return distinct, self._positions[first], self._positions[first + counts - 1]


# Maximum-likelihood fit of a named family to measurements, and its goodness of fit.

# Bootstrap samples: enough to distinguish a probability of 0.05 from 0.03 and 0.07.
_SAMPLES = 999

# Most measurements in all samples; a hundred samples still distinguish a bad fit from a good one.
_MOST_DRAWS = 10_000_000
_FEWEST_SAMPLES = 99

# A fit is rejected if a smaller share than this of samples of the fitted distribution fits worse.
LOWEST_P_VALUE = 0.05


@dataclass(frozen=True)
class DistributionFit:
    """Distribution fitted to measurements by maximum likelihood."""

    distribution: Distribution  # the fitted distribution
    # Kolmogorov-Smirnov distance: the largest difference of its cdf from that of the measurements.
    distance: float
    # Share of samples of the fitted distribution, each fitted anew, that lie as far from their fit
    # as the measurements from theirs.
    p_value: float

    @property
    def is_rejected(self) -> bool:
        """True if such measurements would be unlikely under the fitted distribution."""
        return self.p_value < LOWEST_P_VALUE


def fitted_families() -> list[str]:
    """Return the names of the distributions that are fitted to measurements."""
    return [name for name, each in DISTRIBUTIONS.items() if not resolve(each).unfitted_reason]


def fit_distribution(
    family: str, measurements: FloatArray, rng: np.random.Generator, *, samples: int | None = None
) -> DistributionFit:
    """Fit one of `fitted_families` to measurements in SI units.

    The bootstrap has 999 samples, or fewer where there are very many measurements.

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
    distribution = maximum_likelihood(family, measurements)
    distance = _distance(distribution, measurements)
    worse = 0
    for _ in range(samples):
        sample = distribution.ppf(np.clip(rng.random(len(measurements)), *OPEN_INTERVAL))
        worse += _distance(maximum_likelihood(family, sample), sample) >= distance
    return DistributionFit(distribution, distance, (1 + worse) / (1 + samples))


def maximum_likelihood(family: str, measurements: FloatArray) -> Distribution:
    """Return the member of a family under which measurements are the likeliest.

    SettingsError where there is none.
    """
    cls: type[Distribution] = resolve(DISTRIBUTIONS[family])
    if cls.is_positive and not (measurements > 0).all():
        found = f"a measurement of {measurements.min():g}"
        expected = f"values above 0, as those of a {family} distribution are"
        raise SettingsError([Problem((), found, expected)])
    # Scaled by a power of two near their size, which is exact: powers neither overflow nor vanish.
    size = math.ldexp(1.0, math.frexp(float(np.abs(measurements).max()))[1] - 1)
    try:
        with np.errstate(all="ignore"):
            distribution = cls.fit(measurements / size, size)
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
