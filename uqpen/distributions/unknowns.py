"""Unknowns of a distribution: parameters fitted to specimens, and parameters that are intervals.

A random input with an unknown has no one distribution. It has those at each value of the unknown,
and the answers of a study are those over all of them. Points are drawn from one distribution
with the mass of all, and each run counts by the ratio of two densities.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem, SettingsError
from uqpen.core.lookup import resolve
from uqpen.distributions import DISTRIBUTIONS
from uqpen.distributions.distribution import OPEN_INTERVAL, Distribution
from uqpen.distributions.measurements import maximum_likelihood
from uqpen.distributions.univariate import (
    Gamma,
    Gumbel,
    Lognormal,
    LogUniform,
    Mixture,
    Normal,
    Student,
    Truncated,
    Uniform,
    Weibull,
)


class Unknown(ABC):
    """Part of the distribution of an input that is not known."""

    @abstractmethod
    def drawn(self) -> Distribution:
        """Return the distribution that points are drawn from."""

    @abstractmethod
    def truncated(self, lower: float, upper: float) -> Unknown:
        """Return the same of the truncated distributions."""


# Parameters fitted to specimens.

# Draws of the parameters: the ends of a 95 % interval over them lie on 25 draws each.
DRAWS = 1000
# How many times the specimens are in what more of them would say, and the draws for it.
_TIMES, _DRAWS_OF_MORE = (2, 4), 400


@dataclass(frozen=True, eq=False)
class FittedParameters(Unknown):
    """Parameters that were fitted to few specimens, so that other ones are likely too."""

    fitted: Distribution  # with the parameters of maximum likelihood
    # With parameters under which such specimens would be likely as well, all equally probable.
    draws: tuple[Distribution, ...]
    predictive: Distribution  # of the next specimen: the mixture of the draws
    family: str
    measurements: FloatArray  # the specimens, in SI units
    generators: Sequence[np.random.Generator]  # of the draws for more specimens
    limits: tuple[float, float] | None = None  # of truncated distributions

    @cached_property
    def draws_of_more(self) -> dict[int, Sequence[Distribution]]:
        """Draws by the number of specimens, if there were two or four times as many like these."""
        found: dict[int, Sequence[Distribution]] = {}
        for times, rng in zip(_TIMES, self.generators, strict=True):
            # Copies of all have the same fit.
            many = np.tile(self.measurements, times)
            draws = _draws(self.family, many, _DRAWS_OF_MORE, rng)
            if self.limits is not None:
                draws = tuple(Truncated(each, *self.limits) for each in draws)
            found |= {len(many): draws} if draws else {}
        return found

    def drawn(self) -> Distribution:
        return self.predictive

    def truncated(self, lower: float, upper: float) -> FittedParameters:
        fitted, *draws = (Truncated(part, lower, upper) for part in (self.fitted, *self.draws))
        return replace(
            self,
            fitted=fitted,
            draws=tuple(draws),
            predictive=Mixed.of(draws),
            limits=(lower, upper),
        )


# Families with a location and a scale, perhaps of the logarithm: the family of what these are of,
# and the member that has them.
_PIVOTS: Mapping[type[Distribution], tuple[str, Callable[[float, float], Distribution]]] = {
    Normal: ("normal", Normal),
    Lognormal: ("normal", Lognormal.of_logarithm),
    Gumbel: ("gumbel", Gumbel),
    Weibull: ("weibull", lambda location, scale: Weibull(1 / scale, math.exp(location))),
    Uniform: ("uniform", lambda location, scale: Uniform(location, location + scale)),
    LogUniform: (
        "uniform",
        lambda location, scale: LogUniform(math.exp(location), math.exp(location + scale)),
    ),
}
# The members of location 0 and scale 1.
_STANDARD: Mapping[str, Distribution] = {
    "normal": Normal(0.0, 1.0),
    "gumbel": Gumbel(0.0, 1.0),
    "weibull": Weibull(1.0, 1.0),
    "uniform": Uniform(0.0, 1.0),
}


def _location_and_scale(family: str, values: FloatArray) -> tuple[float, float]:
    """Return those of the likeliest member; of the logarithm for a Weibull distribution."""
    match maximum_likelihood(family, values):
        case Normal(mean, std) | Gumbel(mean, std):
            return mean, std
        case Weibull(shape, scale):
            return math.log(scale), 1 / shape
        case Uniform(lower, upper):
            return lower, upper - lower
    raise AssertionError(family)


def fitted_parameters(
    family: str, measurements: FloatArray, rng: np.random.Generator
) -> FittedParameters:
    """Fit a family to specimens, and draw parameters that are as likely as those of the fit.

    Of a family with a location and a scale, the draws are pivotal: samples of its standard member,
    as many as there are specimens, are fitted as these are, and have m and s. The parameters
    of a draw are σ = s₀/s and μ = m₀ − m σ, where m₀, s₀ are those of the specimens. Intervals of
    a quantile or a probability over the draws then are exact for any number of specimens, and
    the mixture of the draws is the predictive distribution: it holds the next specimen below its
    5 % quantile in 5 % of all cases. For the normal distribution it is Student's.
    The gamma distribution has draws of its posterior for a reference prior, on a grid.

    Parameters
    ----------
    family : str
        One of `uqpen.distributions.measurements.fitted_families`.
    measurements : ndarray, shape (measurement,)
        In SI units.
    rng : Generator

    Raises
    ------
    SettingsError
        If the family has no fit to the measurements, or draws are beyond double precision.

    References
    ----------
    Lawless, J. F. (2003). Statistical Models and Methods for Lifetime Data, appendix E. Wiley.
    Geisser, S. (1993). Predictive Inference. Chapman & Hall.
    """
    fitted = maximum_likelihood(family, measurements)
    draws = _draws(family, measurements, DRAWS, rng)
    if not draws:
        found = f"measurements too far apart for the uncertainty of a {family} distribution"
        raise SettingsError([Problem((), found, "another family, or more measurements")])
    predictive: Distribution
    if resolve(DISTRIBUTIONS[family]) is Normal:
        count = len(measurements)
        width = float(measurements.std(ddof=1)) * math.sqrt(1 + 1 / count)
        predictive = Student(float(measurements.mean()), width, count - 1.0)
    else:
        predictive = Mixed.of(draws)
    generators = rng.spawn(len(_TIMES))
    return FittedParameters(fitted, draws, predictive, family, measurements, generators)


def _draws(
    family: str, measurements: FloatArray, number: int, rng: np.random.Generator
) -> tuple[Distribution, ...]:
    """Return draws of the parameters; empty where one is beyond double precision."""
    cls = resolve(DISTRIBUTIONS[family])
    try:
        with np.errstate(all="ignore"):
            made: Iterator[Distribution] = (
                _gamma_draws(measurements, number, rng)
                if cls is Gamma
                else _pivotal_draws(cls, measurements, number, rng)
            )
            draws = tuple(made)
    except (ArithmeticError, ValueError, SettingsError):
        return ()
    return draws if all(each.is_finite for each in draws) else ()


def _pivotal_draws(
    cls: type[Distribution], measurements: FloatArray, number: int, rng: np.random.Generator
) -> Iterator[Distribution]:
    family, member = _PIVOTS[cls]
    values = np.log(measurements) if cls in (Lognormal, LogUniform) else measurements
    location, scale = _location_and_scale(family, values)
    for _ in range(number):
        sample = _STANDARD[family].ppf(np.clip(rng.random(len(values)), *OPEN_INTERVAL))
        own_location, own_scale = _location_and_scale(family, sample)
        drawn_scale = scale / own_scale
        yield member(location - own_location * drawn_scale, drawn_scale)


def _gamma_draws(
    measurements: FloatArray, number: int, rng: np.random.Generator
) -> Iterator[Gamma]:
    """Draw from the posterior of a gamma distribution, its shape on a grid.

    The prior is √(k ψ′(k) − 1) / √k of the shape k and 1/θ of the scale θ.

    References
    ----------
    Sun, D. & Ye, K. (1996). J. Statist. Plann. Inference 54, 41-58.
    """
    count, total = len(measurements), float(measurements.sum())
    excess = math.log(total / count) - float(np.log(measurements).mean())
    # From far below to far above the likeliest shape, which is from 1/2 to 1 over the excess.
    logarithms = np.linspace(math.log(1e-3 / excess), math.log(1e3 / excess), 20_001)
    k = np.exp(logarithms)
    # k ψ′(k) − 1 of a large shape, where the difference cancels.
    curvature = np.where(
        k > 1e4, 1 / (2 * k) + 1 / (6 * k**2), k * scipy.special.polygamma(1, k) - 1
    )
    likelihood = scipy.special.gammaln(count * k) - count * scipy.special.gammaln(k)
    likelihood -= count * k * (math.log(count) + excess)
    density = likelihood + np.log(curvature) / 2 + np.log(k) / 2  # of the logarithm of k
    below = np.cumsum(np.exp(density - density.max()))
    shapes = np.exp(np.interp(rng.random(number), below / below[-1], logarithms))
    scales = total / rng.gamma(count * shapes)
    for shape, scale in zip(shapes.tolist(), scales.tolist(), strict=True):
        yield Gamma(shape * scale, math.sqrt(shape) * scale)


# Knots of a mixture of many distributions, and how far out they lie in standard normal deviations:
# no draw is beyond. Between two of them, the deviate is wrong by less than 1e-4.
_KNOTS, _OUTERMOST = 1025, 8.4
# Probabilities at which all parts have a first knot.
_FIRST = 33


@dataclass(frozen=True)
class Mixed(Distribution):
    """Mixture of many distributions of one kind, all equally probable, by a table.

    The standard normal deviate of a probability is linear in the value, or in its logarithm where
    all values are above 0, between the knots of the table.
    """

    knots: tuple[float, ...]  # ascending: values, or logarithms of values
    deviates: tuple[float, ...]  # ascending: the deviate of the probability below each
    is_logarithmic: bool = False

    @classmethod
    def of(cls, parts: Sequence[Distribution]) -> Mixed:
        """Return the mixture of some distributions."""
        first = scipy.special.ndtr(np.linspace(-_OUTERMOST, 0.0, _FIRST))
        ends = np.array([[part.ppf(first), part.isf(first)] for part in parts])
        is_logarithmic = bool((ends > 0).all())
        # At each probability, the quantile of a mixture lies among those of its parts.
        known = ends[:, np.isfinite(ends).all(axis=0)]
        x = np.unique(np.quantile(known, [0.0, 0.1, 0.5, 0.9, 1.0], axis=0))
        for _ in range(3):
            z = _mixed_deviates(parts, x)
            x, z = _ascending(x, z)
            spread = np.linspace(max(z[0], -_OUTERMOST), min(z[-1], _OUTERMOST), _KNOTS)
            scaled = np.log(x) if is_logarithmic else x
            knots = np.interp(spread, z, scaled)
            x = np.unique(np.exp(knots) if is_logarithmic else knots)
        x, z = _ascending(x, _mixed_deviates(parts, x))
        knots = np.log(x) if is_logarithmic else x
        return cls(tuple(knots.tolist()), tuple(z.tolist()), is_logarithmic)

    def ppf(self, probability: FloatArray) -> FloatArray:
        return self._value(scipy.special.ndtri(probability))

    def isf(self, probability: FloatArray) -> FloatArray:
        return self._value(-scipy.special.ndtri(probability))

    def cdf(self, value: FloatArray) -> FloatArray:
        return scipy.special.ndtr(self._deviate(value))

    def sf(self, value: FloatArray) -> FloatArray:
        return scipy.special.ndtr(-self._deviate(value))

    def log_density(self, value: FloatArray) -> FloatArray:
        knots, deviates = self._table
        scaled = np.log(value) if self.is_logarithmic else np.asarray(value)
        slopes = np.diff(deviates) / np.diff(knots)
        place = np.clip(np.searchsorted(knots, scaled, side="right") - 1, 0, len(slopes) - 1)
        deviate = np.interp(scaled, knots, deviates)
        found = np.log(slopes[place]) - deviate**2 / 2 - math.log(2 * math.pi) / 2
        is_inside = (scaled >= knots[0]) & (scaled <= knots[-1])
        return np.where(is_inside, found - (scaled if self.is_logarithmic else 0.0), -np.inf)

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        return np.array(self.knots), np.array(self.deviates)

    def _value(self, deviate: FloatArray) -> FloatArray:
        knots, deviates = self._table
        found = np.interp(deviate, deviates, knots)
        return np.exp(found) if self.is_logarithmic else found

    def _deviate(self, value: FloatArray) -> FloatArray:
        knots, deviates = self._table
        scaled = np.log(value) if self.is_logarithmic else value
        return np.interp(scaled, knots, deviates, left=-np.inf, right=np.inf)


def _mixed_deviates(parts: Sequence[Distribution], x: FloatArray) -> FloatArray:
    """Return the deviates of a mixture's probabilities, each from the tail that has its digits."""
    half = int(np.searchsorted(x, np.median([part.median for part in parts])))
    low, high = x[:half], x[half:]
    below, above = np.zeros(len(low)), np.zeros(len(high))
    for part in parts:
        below += part.cdf(low)
        above += part.sf(high)
    deviates = scipy.special.ndtri(below / len(parts)), scipy.special.ndtri(above / len(parts))
    return np.concatenate([deviates[0], -deviates[1]])


def _ascending(x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the knots whose finite deviates lie above all before."""
    finite = np.isfinite(z)
    x, z = x[finite], z[finite]
    keeps = np.concatenate([[True], z[1:] > np.maximum.accumulate(z)[:-1]])
    return x[keeps], z[keeps]


# Parameters that are intervals: a box of distributions, or p-box.

# Values that are looked at of each parameter that is an interval, by the number of these.
_LOOKED_AT: Mapping[int, tuple[int, ...]] = {
    1: (31,),
    2: (15, 9),
    3: (9, 7, 7),
    4: (5, 5, 5, 5),
    5: (3, 3, 3, 3, 3),
    6: (3, 3, 3, 3, 3, 3),
}
MOST_INTERVALS = max(_LOOKED_AT)


@dataclass(frozen=True, eq=False)
class ParameterBox(Unknown):
    """A family of distributions, some of its parameters known by their two ends alone.

    References
    ----------
    Ferson, S. et al. (2003). Constructing probability boxes and Dempster-Shafer structures. Sandia
    National Laboratories, SAND2002-4015.
    """

    family: type[Distribution]
    parameters: Mapping[str, float]  # those with one value
    ends: Mapping[str, tuple[float, float]]  # the lower and the upper end of the others
    limits: tuple[float, float] = (-math.inf, math.inf)  # of a truncated distribution

    def __post_init__(self) -> None:
        self.corners()

    def corners(self) -> list[Distribution]:
        """Return the distributions at the corners; SettingsError if one has no meaning."""
        return [self.at(values) for values in product(*self.ends.values())]

    def at(self, values: tuple[float, ...]) -> Distribution:
        """Return the distribution at values of the parameters that are intervals."""
        found = self.family(**self.parameters, **dict(zip(self.ends, values, strict=True)))
        return found if self.limits == (-math.inf, math.inf) else Truncated(found, *self.limits)

    def drawn(self) -> Distribution:
        """Return a mixture of the corners and of the middle with the largest spread."""
        middle = [
            upper if name == "std" else (lower + upper) / 2
            for name, (lower, upper) in self.ends.items()
        ]
        return Mixture((*self.corners(), self.at(tuple(middle))))

    def looked_at(self, counts: Sequence[int]) -> list[Distribution]:
        """Return the distributions on a grid over the box, its corners among them.

        Parameters
        ----------
        counts : sequence of int
            Of each parameter that is an interval, the number of its values.
        """
        lines = [
            np.linspace(*ends, count).tolist()
            for ends, count in zip(self.ends.values(), counts, strict=True)
        ]
        return [self.at(values) for values in product(*lines)]

    def truncated(self, lower: float, upper: float) -> ParameterBox:
        return ParameterBox(self.family, self.parameters, self.ends, (lower, upper))


def grid_of_boxes(boxes: Sequence[ParameterBox]) -> Iterator[tuple[Distribution, ...]]:
    """Yield the distributions of some inputs on a grid over the boxes of all of them.

    They have at most `MOST_INTERVALS` together.
    """
    counts = iter(_LOOKED_AT[sum(len(box.ends) for box in boxes)])
    return product(*(box.looked_at([next(counts) for _ in box.ends]) for box in boxes))
