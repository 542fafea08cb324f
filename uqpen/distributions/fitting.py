"""Maximum-likelihood fit of a named family to measurements, and its goodness of fit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem, SettingsError
from uqpen.core.lookup import resolve
from uqpen.distributions import DISTRIBUTIONS
from uqpen.distributions.distribution import OPEN_INTERVAL, Distribution

__all__ = ["LOWEST_P_VALUE", "DistributionFit", "fit_distribution", "fitted_families"]


# Bootstrap samples: enough to distinguish a probability of 0.05 from 0.03 and 0.07.
_SAMPLES = 999

# Most measurements in all samples; a hundred samples still distinguish a bad fit from a good one.
_MOST_DRAWS = 10_000_000
_FEWEST_SAMPLES = 99

# A fit is rejected if a smaller share than this of samples of the fitted distribution fits worse.
LOWEST_P_VALUE = 0.05


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


def fitted_families() -> list[str]:
    """Return the names of the distributions that are fitted to measurements."""
    return [name for name, each in DISTRIBUTIONS.items() if not resolve(each).unfitted_reason]


def fit_distribution(
    family: str, measurements: FloatArray, rng: np.random.Generator, *, samples: int | None = None
) -> DistributionFit:
    """Fit a family to measurements.

    Parameters
    ----------
    family : str
        One of `fitted_families`.
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
