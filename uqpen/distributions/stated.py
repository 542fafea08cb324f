"""Distributions by their moments and quantiles, which a study states in place of parameters.

Most families are a standard variable times a scale, from a location on, or the exponential function
of such a variable. A mean, a standard deviation and a quantile are linear in location and scale.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy

from uqpen.core.errors import Problem, QuantityError, SettingsError, toml_text
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import (
    Context,
    declared_settings,
    difference,
    quantity,
    read_list,
    setting,
    validate,
)
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.orthogonal_polynomials import recurrence
from uqpen.distributions.univariate import (
    Arcsine,
    Beta,
    Exponential,
    Gamma,
    GeneralisedExtremeValue,
    Gumbel,
    Logistic,
    Lognormal,
    LogUniform,
    Normal,
    Pareto,
    Rayleigh,
    Student,
    Triangular,
    Uniform,
    Weibull,
)

_QUANTILE = 'a probability and the value below which it lies: [0.95, "3 mm"], or a list of such'

# A condition that is a multiple of another but for rounding.
_SAME = 1e-9


def _read_quantiles(written: Any, context: Context) -> tuple[tuple[float, float], ...]:
    def read_one(pair: Any) -> tuple[float, float]:
        is_pair = isinstance(pair, list) and len(pair) == 2
        if not is_pair or type(pair[0]) not in (int, float) or not 0 < pair[0] < 1:
            raise QuantityError(toml_text(pair), _QUANTILE)
        return float(pair[0]), parse_quantity(pair[1], context.like).value

    is_list = isinstance(written, list) and bool(written) and isinstance(written[0], list)
    return tuple(read_list(written, read_one)) if is_list else (read_one(written),)


@dataclass(frozen=True)
class Stated:
    """Moments and quantiles that a study states in place of parameters, in SI units."""

    mean: float | None = quantity(default=None)
    std: float | None = difference(above=0, default=None)
    median: float | None = quantity(default=None)
    quantile: tuple[tuple[float, float], ...] | None = setting(
        "quantiles", _QUANTILE, lambda each: isinstance(each, tuple), _read_quantiles, default=None
    )
    half_width: float | None = difference(above=0, default=None)

    def __post_init__(self) -> None:
        validate(self)

    @property
    def quantiles(self) -> tuple[tuple[float, float], ...]:
        """The probabilities with their quantiles, the median among them."""
        middle = () if self.median is None else ((0.5, self.median),)
        return tuple(sorted((*middle, *(self.quantile or ()))))

    @property
    def keys(self) -> list[str]:
        """The keys that are given."""
        return [key for key in STATED if getattr(self, key) is not None]


STATED = tuple(field.name for field, _ in declared_settings(Stated))


class _Form(NamedTuple):
    """Family as a function of a location and a scale, or of the scale alone."""

    make: Callable[..., Distribution]
    kept: tuple[str, ...] = ()  # parameters beside them, which a study gives
    has_location: bool = True
    half_width: bool = False  # whether the scale is half the width of the support
    # Of a family whose logarithm has location and scale: ln E exp(t z) of the standard variable z.
    of_logarithm: Callable[[float], float] | None = None


def _about(family: Callable[[float, float], Distribution]) -> Callable[..., Distribution]:
    return lambda middle, half: family(middle - half, middle + half)


_FORMS: dict[type[Distribution], _Form] = {
    Normal: _Form(Normal),
    Logistic: _Form(Logistic),
    Gumbel: _Form(Gumbel),
    Student: _Form(Student, ("degrees",)),
    GeneralisedExtremeValue: _Form(GeneralisedExtremeValue, ("shape",)),
    Uniform: _Form(_about(Uniform), half_width=True),
    Arcsine: _Form(_about(Arcsine), half_width=True),
    Triangular: _Form(lambda m, s: Triangular(m - s, m, m + s), half_width=True),
    Exponential: _Form(Exponential, has_location=False),
    Rayleigh: _Form(Rayleigh, has_location=False),
    Lognormal: _Form(Lognormal.of_logarithm, of_logarithm=lambda t: t**2 / 2),
    LogUniform: _Form(
        lambda m, s: LogUniform(math.exp(m - s), math.exp(m + s)),
        of_logarithm=lambda t: t + math.log(-math.expm1(-2 * t) / (2 * t)),
    ),
    Weibull: _Form(
        lambda m, s: Weibull(1 / s, math.exp(m)), of_logarithm=lambda t: math.lgamma(1 + t)
    ),
    Pareto: _Form(
        lambda m, s: Pareto(1 / s, math.exp(m)),
        of_logarithm=lambda t: -math.log1p(-t) if t < 1 else math.inf,
    ),
}


def is_stated(cls: type[Distribution], keys: Mapping[str, Any]) -> bool:
    """Check whether a table has moments or quantiles that are no parameters of the family."""
    parameters = {field.name for field, _ in declared_settings(cls)}
    return any(key in STATED and key not in parameters for key in keys)


def from_stated(cls: type[Distribution], stated: Stated, kept: Mapping[str, float]) -> Distribution:
    """Return the member of a family with the stated moments and quantiles.

    Parameters
    ----------
    kept : mapping of str to float
        Parameters of the family that are given beside them.

    SettingsError if they determine no member, or none is found.
    """
    form = _FORMS.get(cls)
    given = " and ".join([*stated.keys, *kept])
    try:
        if cls is Beta:
            return _beta(stated, kept)
        if cls is Gamma:
            return _gamma(stated, kept)
        if form is None:
            raise SettingsError([Problem((), given, "its parameters")])
        if set(kept) != set(form.kept):
            raise SettingsError([Problem((), given, _expected(form))])
        if form.of_logarithm is not None:
            return _of_logarithm(form, form.of_logarithm, stated)
        return _of_location_and_scale(form, stated, kept)
    except SettingsError:
        raise
    except (ArithmeticError, ValueError):
        found = f"{given} that no distribution of this family has"
        raise SettingsError([Problem((), found, "others, or another family")]) from None


def _expected(form: _Form) -> str:
    """Return in words what determines a member of a family."""
    beside = f", beside {' and '.join(form.kept)}" if form.kept else ""
    if form.of_logarithm is not None:
        return "mean and std, or two of median and quantiles"
    known = ["mean", "std", "median", "quantiles", *["half_width"] * form.half_width]
    return f"{'two' if form.has_location else 'one'} of {', '.join(known)}{beside}"


def _of_location_and_scale(form: _Form, stated: Stated, kept: Mapping[str, float]) -> Distribution:
    """Solve the linear equations of location and scale."""
    standard = form.make(*[0.0] * form.has_location, 1.0, **kept)
    rows = [
        (1.0, float(standard.ppf(np.array(probability))), value)
        for probability, value in stated.quantiles
    ]
    if stated.mean is not None or stated.std is not None:
        if standard.highest_moment <= 2:
            found = "a mean or a std where the standard deviation is infinite"
            raise SettingsError([Problem((), found, "median and quantiles")])
        moments = recurrence(standard, 1)
        if stated.mean is not None:
            rows.append((1.0, moments.mean, stated.mean))
        if stated.std is not None:
            rows.append((0.0, moments.std, stated.std))
    if stated.half_width is not None and form.half_width:
        rows.append((0.0, 1.0, stated.half_width))
    elif stated.half_width is not None:
        rows.clear()
    if len(rows) != 1 + form.has_location:
        raise SettingsError([Problem((), " and ".join(stated.keys), _expected(form))])
    if not form.has_location:
        ((_, factor, value),) = rows
        return form.make(_positive(value / factor))
    return form.make(*_solve(rows), **kept)


def _solve(rows: list[tuple[float, float, float]]) -> tuple[float, float]:
    """Return the location and the scale that satisfy two linear equations."""
    (a, b, value), (c, d, other) = rows
    determinant = a * d - b * c
    if abs(determinant) < _SAME * max(abs(a * d), abs(b * c), _SAME):
        found = "two conditions that are the same of this family"
        raise SettingsError([Problem((), found, "two that differ")])
    scale = _positive((a * other - c * value) / determinant)
    location = (value * d - b * other) / determinant
    return location, scale


def _positive(scale: float) -> float:
    if not scale > 0:
        raise ValueError(scale)  # quantiles in the wrong order, say
    return scale


def _of_logarithm(form: _Form, cumulant: Callable[[float], float], stated: Stated) -> Distribution:
    """Return a distribution whose logarithm has a location and a scale."""
    if stated.keys == ["mean", "std"]:
        mean, std = stated.mean, stated.std
        assert mean is not None  # with std, as the keys say
        assert std is not None
        target = math.log1p((std / mean) ** 2)
        scale = _root(lambda each: cumulant(2 * each) - 2 * cumulant(each) - target)
        return form.make(math.log(mean) - cumulant(scale), scale)
    if not set(stated.keys) <= {"median", "quantile"} or len(stated.quantiles) != 2:
        raise SettingsError([Problem((), " and ".join(stated.keys), _expected(form))])
    standard = form.make(0.0, 1.0)
    return form.make(
        *_solve(
            [
                (1.0, math.log(float(standard.ppf(np.array(probability)))), math.log(value))
                for probability, value in stated.quantiles
            ]
        )
    )


def _gamma(stated: Stated, kept: Mapping[str, float]) -> Distribution:
    """Return a gamma distribution: the ratio of two quantiles decides on its shape."""
    if kept or not set(stated.keys) <= {"median", "quantile"} or len(stated.quantiles) != 2:
        found = " and ".join([*stated.keys, *kept])
        raise SettingsError([Problem((), found, "mean and std, or two of median and quantiles")])
    (low, value), (high, other) = stated.quantiles
    target = math.log(other / value)

    def ratio(spread: float) -> float:
        ends = scipy.special.gammaincinv(spread**-2, [low, high])
        return float(np.log(ends[1] / ends[0])) - target

    spread = _root(ratio)
    mean = value * spread**-2 / float(scipy.special.gammaincinv(spread**-2, low))
    return Gamma(mean, mean * spread)


def _beta(stated: Stated, kept: Mapping[str, float]) -> Distribution:
    """Return a beta distribution of a mean and a standard deviation between two ends."""
    if stated.keys != ["mean", "std"] or set(kept) != {"lower", "upper"}:
        found = " and ".join([*stated.keys, *kept])
        raise SettingsError([Problem((), found, "mean and std, beside lower and upper")])
    assert stated.mean is not None  # as the keys say
    assert stated.std is not None
    lower, upper = kept["lower"], kept["upper"]
    mean, std = (stated.mean - lower) / (upper - lower), stated.std / (upper - lower)
    total = _positive(mean * (1 - mean) / std**2 - 1)
    return Beta(_positive(mean * total), _positive((1 - mean) * total), lower, upper)


def _root(slope: Callable[[float], float]) -> float:
    """Find the zero of an increasing function of a scale, from 1e-9 up to where it is infinite."""
    low = high = 1e-9
    while slope(high) < 0:
        low, high = high, high * 2
        if high > 1e3:
            raise ArithmeticError("no such scale")
    while math.isinf(slope(high)):  # a bracket must have numbers
        middle = (low + high) / 2
        low, high = (low, middle) if slope(middle) > 0 else (middle, high)
        if high - low < 1e-15 * high:
            raise ArithmeticError("no such scale")
    return float(scipy.optimize.brentq(slope, low, high, xtol=1e-300, rtol=1e-14))
