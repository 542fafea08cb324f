"""Polynomials and coefficients of an expansion by chaospy, in the form of one's own.

chaospy gives the recurrence of each input's polynomials, builds the expansion and computes its
coefficients. What it has fitted is a `ProductBasis` with coefficients as any other, so neither its
evaluation nor its archive needs chaospy.
"""

from __future__ import annotations

import functools
import importlib
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.distributions.univariate import Beta, Gamma, Normal, Uniform
from uqpen.surrogates.chaos.basis import ProductBasis, UnivariateBasis
from uqpen.surrogates.chaos.term_selection import FitPoints, Terms

# Family, parameters, location and scale of a standard form.
_Form = tuple[str, tuple[float, ...], float, float]

_EXPECTED = "inputs that are normal, uniform, gamma or beta"
_OR_LOGARITHMS = f"{_EXPECTED}, or whose logarithm is normal or uniform"


def input_problems(joint: JointDistribution, *, logarithms: bool) -> Iterator[Problem]:
    """Yield a problem for each input whose polynomials chaospy does not have in closed form.

    Its numerical recurrence errs by 3e-8 in the mean of a triangular input, and takes seconds.
    """
    for entry in joint.random:
        try:
            _standard(entry.distribution, logarithms=logarithms)
        except KeyError:
            family = type(entry.distribution).__name__.lower()
            expected = _OR_LOGARITHMS if logarithms else _EXPECTED
            yield Problem(("engine",), f'"chaospy" with {entry.variable.name}, {family}', expected)


@dataclass(frozen=True)
class _Standard:
    """Distribution of chaospy for the standardised variable ξ = (x - location) / scale.

    In standard form, as large values of an SI unit cost digits in its expansion.
    """

    family: str
    parameters: tuple[float, ...]
    location: float
    scale: float
    is_logarithm: bool

    def make(self) -> Any:
        """Return an instance; one object cannot stand for two inputs."""
        return getattr(_chaospy(), self.family)(*self.parameters)

    def univariate_basis(self, name: str, degree: int) -> UnivariateBasis:
        """Return the orthonormal polynomials up to a degree, by chaospy's recurrence."""
        centres, ratios = np.asarray(self.make().ttr(np.arange(degree + 1)), dtype=np.float64)
        ratios[0] = 1.0
        return UnivariateBasis(
            name, self.is_logarithm, self.location, self.scale, centres + 0.0, ratios
        )


@dataclass(frozen=True)
class ChaospyExpansion:
    """Expansion that chaospy builds and fits."""

    names: tuple[str, ...]  # the random inputs
    distributions: tuple[_Standard, ...]  # their standard forms

    @classmethod
    def from_distribution(cls, joint: JointDistribution, *, logarithms: bool) -> ChaospyExpansion:
        """Return the expansion in the random inputs, or in logarithms where these are simpler."""
        return cls(
            tuple(entry.variable.name for entry in joint.random),
            tuple(_standard(each.distribution, logarithms=logarithms) for each in joint.random),
        )

    def basis(self, degree: int) -> ProductBasis:
        """Return the polynomials up to a degree in each input."""
        pairs = zip(self.names, self.distributions, strict=True)
        return ProductBasis(tuple(each.univariate_basis(name, degree) for name, each in pairs))

    def coefficients(
        self, points: FitPoints, values: FloatArray, terms: Terms, weights: FloatArray | None
    ) -> FloatArray:
        """Compute the coefficients of terms: by regression or, with weights, by projection."""
        chaospy = _chaospy()
        indices = tuple(map(tuple, terms.indices.tolist()))
        standard = np.array(
            [
                (np.log(points.inputs[name]) if each.is_logarithm else points.inputs[name])
                - each.location
                for name, each in zip(self.names, self.distributions, strict=True)
            ]
        )
        standard /= np.array([each.scale for each in self.distributions])[:, None]
        with warnings.catch_warnings():
            # Its libraries use deprecated keywords of NumPy.
            warnings.simplefilter("ignore")
            expansion = _expansion(self.distributions, terms.order, indices)
            if weights is None:
                _, found = chaospy.fit_regression(expansion, standard, values, retall=1)
            else:
                # Orthonormal terms have the norm 1.
                _, found = chaospy.fit_quadrature(
                    expansion, standard, weights, values, retall=True, norms=np.ones(len(expansion))
                )
        return np.asarray(found, dtype=np.float64).reshape(len(terms.indices))


@functools.lru_cache(
    maxsize=1
)  # the fits that leave runs out have the same terms one after another
def _expansion(
    distributions: tuple[_Standard, ...], order: int, indices: tuple[tuple[int, ...], ...]
) -> Any:
    """Return terms of the orthonormal expansion in independent variables."""
    chaospy = _chaospy()
    joint = chaospy.J(*(each.make() for each in distributions))
    expansion = chaospy.generate_expansion(order, joint, normed=True)
    return expansion[_positions(expansion, indices)]


def _positions(expansion: Any, indices: tuple[tuple[int, ...], ...]) -> list[int]:
    """Return the positions of terms in an expansion of chaospy, by their leading exponents."""
    exponents = np.asarray(expansion.exponents, dtype=np.int64)
    present = np.asarray(expansion.coefficients) != 0
    degrees = np.where(present, exponents.sum(axis=1)[:, None], -1)
    leading = {tuple(exponents[row]): at for at, row in enumerate(degrees.argmax(axis=0))}
    return [leading[index] for index in indices]


def _standard(distribution: Distribution, *, logarithms: bool) -> _Standard:
    """Return the standard form of a distribution; KeyError where there is none."""
    of_logarithm = distribution.logarithm() if logarithms else None
    family = of_logarithm or distribution
    form: _Form = _FORMS[type(family)](family)
    return _Standard(*form, of_logarithm is not None)


def _gamma(family: Gamma) -> _Form:
    return "Gamma", ((family.mean / family.std) ** 2,), 0.0, family.std**2 / family.mean


def _bounded(name: str, parameters: tuple[float, ...], family: Uniform | Beta) -> _Form:
    half = family.upper / 2 - family.lower / 2
    return name, (*parameters, -1.0, 1.0), family.lower + half, half


_FORMS: dict[type, Any] = {
    Normal: lambda family: ("Normal", (0.0, 1.0), family.mean, family.std),
    Uniform: lambda family: _bounded("Uniform", (), family),
    Beta: lambda family: _bounded("Beta", (family.alpha, family.beta), family),
    Gamma: _gamma,
}


def _chaospy() -> Any:
    return importlib.import_module("chaospy")
