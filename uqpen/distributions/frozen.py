"""Distributions of SciPy and chaospy as distributions of an input."""

from __future__ import annotations

import ast
import importlib
import inspect
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import SettingsError
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.distributions.distribution import OPEN_INTERVAL, Distribution

# The key of a library in a study file, and its module with the distributions.
LIBRARIES = {"scipy": "scipy.stats", "chaospy": "chaospy"}


# Discrete distributions of chaospy, whose steps its interface does not show, and those of several
# variables.
_NO_SINGLE = ("Binomial", "DiscreteUniform", "MvLogNormal", "MvNormal", "MvStudentT")
# chaospy has an upper tail as 1 - F alone: its digits end near 1e-16, and of a probability of 1e-8
# it has eight.
_LEAST_UPPER_TAIL = 1e-8

# Of more values, sums would take long.
_MOST_ATOMS = 100_000


@dataclass(frozen=True)
class FrozenDistribution(Distribution):
    """Distribution of SciPy or chaospy with all its parameters, and the unit of its values.

    Parameters
    ----------
    frozen : object
        A frozen distribution of ``scipy.stats``, continuous or discrete, or a one-dimensional
        distribution of chaospy.
    unit : str
        Unit of its values.

    Examples
    --------
    >>> from scipy import stats
    >>> load = FrozenDistribution(stats.genextreme(-0.1, loc=10, scale=2), "kN")
    >>> float(load.ppf(0.5)) / 1e3  # doctest: +ELLIPSIS
    10.746...
    """

    frozen: Any
    unit: str = DIMENSIONLESS

    def ppf(self, probability: FloatArray) -> FloatArray:
        quantile = self.frozen.ppf if self._is_scipy else self.frozen.inv
        return self._to_si(quantile(probability))

    def isf(self, probability: FloatArray) -> FloatArray:
        if self._is_scipy:
            return self._to_si(self.frozen.isf(probability))
        return self.ppf(1 - np.asarray(probability))

    def cdf(self, value: FloatArray) -> FloatArray:
        return self._probability(self.frozen.cdf, value)

    def sf(self, value: FloatArray) -> FloatArray:
        if self._is_scipy:
            return self._probability(self.frozen.sf, value)
        return 1 - self.cdf(value)

    def log_density(self, value: FloatArray) -> FloatArray | None:
        measure = scale(self.unit)
        own = measure.from_si(np.asarray(value))
        if not self._is_scipy:
            return np.asarray(np.log(self.frozen.pdf(own))) - math.log(measure.factor)
        if self.is_discrete:
            return np.asarray(self.frozen.logpmf(own))
        return np.asarray(self.frozen.logpdf(own)) - math.log(measure.factor)

    def atoms(self) -> tuple[FloatArray, FloatArray] | None:
        """Return the whole numbers of a discrete distribution, and their probabilities."""
        if not self.is_discrete:
            return None
        first, last = (float(self.frozen.ppf(end)) for end in OPEN_INTERVAL)
        width = last - first + 20
        if not width < _MOST_ATOMS:
            return None
        # High powers weigh what lies beyond the draws.
        values = np.arange(first - width, last + width)
        shares = np.asarray(self.frozen.pmf(values), dtype=np.float64)
        return self._to_si(values[shares > 0]), shares[shares > 0] / shares.sum()

    @property
    def is_discrete(self) -> bool:  # type: ignore[override]
        """True if it has probabilities of single values, as ``scipy.stats.poisson`` has."""
        return self._is_scipy and not hasattr(self.frozen.dist, "pdf")

    @property
    def least_upper_tail(self) -> float:
        """Least probability above a value that it knows with eight digits; 0 for any."""
        return 0.0 if self._is_scipy else _LEAST_UPPER_TAIL

    @property
    def _is_scipy(self) -> bool:
        return hasattr(self.frozen, "sf")

    def _to_si(self, values: Any) -> FloatArray:
        measure = scale(self.unit)
        return np.asarray(values, dtype=np.float64) * measure.factor + measure.offset

    def _probability(self, function: Any, value: FloatArray) -> FloatArray:
        return np.asarray(function(scale(self.unit).from_si(np.asarray(value))), dtype=np.float64)


def frozen_distribution(
    library: str, name: str, parameters: Mapping[str, float], unit: str
) -> FrozenDistribution:
    """Return a distribution by its name in one of `LIBRARIES` and its parameters.

    LookupError if the library has no such distribution of one variable; ValueError if it does not
    take these parameters, or is not defined for them.
    """
    module = importlib.import_module(LIBRARIES[library])
    family: Any = getattr(module, name, None)
    if not _is_family(library, module, family):
        raise LookupError(name)
    try:
        frozen = family(**parameters)
        median = float(np.ravel(frozen.ppf(0.5) if library == "scipy" else frozen.inv(0.5))[0])
    except TypeError:
        taken = ", ".join(_parameter_names(library, family))
        raise ValueError(f"it takes {taken}") from None
    except Exception as error:  # a library can raise anything about parameters
        raise ValueError(str(error) or type(error).__name__) from None
    if not np.isfinite(median):
        raise ValueError("it is not defined for these parameters")
    return FrozenDistribution(frozen, unit)


def frozen_families(library: str) -> dict[str, Any]:
    """Return the distributions of one variable that a library has, by their names."""
    module = importlib.import_module(LIBRARIES[library])
    return {name: each for name, each in vars(module).items() if _is_family(library, module, each)}


def as_frozen(value: object) -> FrozenDistribution | None:
    """Return a distribution of SciPy or chaospy with values without a unit; None for others."""
    is_scipy = hasattr(value, "dist") and hasattr(value, "kwds")
    return FrozenDistribution(value) if is_scipy or is_chaospy(value) else None


def is_chaospy(value: object) -> bool:
    """Check for a distribution of chaospy, of any dimension."""
    return type(value).__module__.partition(".")[0] == "chaospy" and hasattr(value, "inv")


def declare(frozen: Any) -> tuple[str, dict[str, Any]] | None:
    """Return the library of a distribution, and its name and parameters as data.

    None where they do not determine it: it is an expression, or of a class of the user's.
    """
    dist = getattr(frozen, "dist", None)
    if dist is not None and hasattr(frozen, "kwds"):
        names = _parameter_names("scipy", dist)
        library, name = "scipy", dist.name
        parameters = {**dict(zip(names, frozen.args, strict=False)), **frozen.kwds}
    else:
        try:
            library, (name, given, named) = "chaospy", parse_call(repr(frozen))
            parameters = inspect.signature(type(frozen)).bind(*given, **named).arguments
        except (SyntaxError, TypeError, ValueError):
            return None
    try:
        values = {key: float(value) for key, value in parameters.items()}
        again = frozen_distribution(library, name, values, DIMENSIONLESS)
        probabilities = np.linspace(0.01, 0.99, 21)
        same = np.array_equal(
            again.ppf(probabilities), FrozenDistribution(frozen).ppf(probabilities)
        )
    except (LookupError, TypeError, ValueError, SettingsError, ImportError):
        return None
    return (library, {"name": name, **values}) if same else None


def _parameter_names(library: str, family: Any) -> list[str]:
    """Return the names of a distribution's parameters."""
    if library != "scipy":
        return [*inspect.signature(family).parameters]
    ends = ["loc", "scale"] if hasattr(family, "pdf") else ["loc"]
    return [*(family.shapes.split(", ") if family.shapes else []), *ends]


def _is_family(library: str, module: Any, family: Any) -> bool:
    if library == "scipy":
        return isinstance(family, module.rv_continuous | module.rv_discrete)
    # Its other classes are operators, copulas and distributions of several variables.
    is_class = isinstance(family, type) and issubclass(family, module.Distribution)
    is_single = is_class and family.__module__.startswith("chaospy.distributions.collection.")
    return is_single and family.__name__ not in _NO_SINGLE


def parse_call(text: str) -> tuple[str, list[Any], dict[str, Any]]:
    """Parse the representation of an object, such as ``Beta(2, 3, lower=0, upper=4)``.

    Returns its name, its positional and its named parameters. ValueError, SyntaxError or TypeError
    where it is no call with plain values.
    """
    call = ast.parse(text, mode="eval").body
    if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name):
        raise ValueError(text)
    named = {str(each.arg): ast.literal_eval(each.value) for each in call.keywords}
    return call.func.id, [ast.literal_eval(value) for value in call.args], named
