"""Basis of an expansion: univariate polynomials, and products of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray, IntArray
from uqpen.core.model import Input
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.input_group import ChaospyJoint
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.distributions.orthogonal_polynomials import recurrence
from uqpen.distributions.univariate import Normal
from uqpen.surrogates.diagnostics import describe

if TYPE_CHECKING:
    import xarray as xr

# Univariate basis: polynomials that are orthonormal for the distribution of one input.
#
# They are functions of a standardised variable: the input itself or its logarithm, shifted and
# scaled so that its size is about one. A normal distribution has Hermite's polynomials, a uniform
# one Legendre's, a gamma distribution Laguerre's and a beta distribution Jacobi's; any other
# distribution has polynomials of its own.

_LINEAR, _LOGARITHM = "linear", "logarithm"


@dataclass(frozen=True, eq=False)
class UnivariateBasis:
    """Standardised variable of an input, and the recurrence of the polynomials in it.

    With ξ = (x - location) / scale, x the input or its logarithm, the orthonormal polynomials are
    √b_{n+1} p_{n+1} = (ξ - a_n) p_n - √b_n p_{n-1}, from p_0 = 1.
    """

    name: str  # the input's
    is_logarithm: bool  # whether x is the input's logarithm
    location: float  # of the standardised variable ξ of x
    scale: float  # of the same
    centres: FloatArray  # (degree + 1,): a_n from n = 0
    ratios: FloatArray  # (degree + 1,): b_n from n = 0; b_0 is 1 and has no meaning

    @property
    def highest_degree(self) -> int:
        """Highest degree of the polynomials."""
        return len(self.ratios) - 1

    def polynomials(self, values: FloatArray, degree: int) -> FloatArray:
        """Evaluate the polynomials up to a degree, shape (degree + 1, run).

        Parameters
        ----------
        values : ndarray, shape (run,)
            In the input's SI unit; the result is NaN where the logarithm does not exist.
        degree : int
            At most `highest_degree`.
        """
        # Contiguous, so that NumPy's logarithm takes the same path for every batch.
        x = np.ascontiguousarray(values, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.log(x) if self.is_logarithm else x
        xi = (x - self.location) / self.scale
        roots = np.sqrt(self.ratios)
        table = np.ones((degree + 1, len(xi)))
        for n in range(degree):
            following = (xi - self.centres[n]) * table[n]
            if n:
                following -= roots[n] * table[n - 1]
            table[n + 1] = following / roots[n + 1]
        return table

    def to_variable(self, variable: Input) -> tuple[tuple[str, str], FloatArray, dict[str, Any]]:
        """Return dimensions, values and attributes of a variable of an archive."""
        attributes = {
            "long_name": f"recurrence coefficients of the polynomials in {variable.title}",
            "units": "1",
            "germ": _LOGARITHM if self.is_logarithm else _LINEAR,
            "location": self.location,
            "scale": self.scale,
            **describe(variable, "of_"),
        }
        dimensions = (f"{self.name}_coefficient", f"{self.name}_degree")
        return dimensions, np.stack([self.centres, self.ratios]), attributes

    @classmethod
    def from_variable(cls, name: str, array: xr.DataArray) -> UnivariateBasis:
        """Restore it from `to_variable`."""
        centres, ratios = np.asarray(array.values, dtype=np.float64)
        is_logarithm = array.attrs["germ"] == _LOGARITHM
        location, scale = float(array.attrs["location"]), float(array.attrs["scale"])
        return cls(name, is_logarithm, location, scale, centres, ratios)


def univariate_basis(
    name: str, distribution: Distribution, degree: int, *, logarithms: bool = True
) -> UnivariateBasis:
    """Build the univariate basis of an input, with polynomials up to a degree.

    Parameters
    ----------
    distribution : Distribution
        Its distribution; one on a few values has fewer polynomials.
    degree : int
        The highest.
    logarithms : bool
        Whether an input is replaced by its logarithm where that has a simpler distribution.
    """
    of_logarithm = distribution.logarithm() if logarithms else None
    found = recurrence(of_logarithm or distribution, degree)
    is_usable = np.isfinite(found.alpha) & np.isfinite(found.beta) & (found.beta > 0)
    usable = len(is_usable) if is_usable.all() else int(is_usable.argmin())
    if not usable:  # the mean is infinite, and a constant needs none
        return UnivariateBasis(name, of_logarithm is not None, 0.0, 1.0, np.zeros(1), np.ones(1))
    return UnivariateBasis(
        name=name,
        is_logarithm=of_logarithm is not None,
        location=found.location,
        scale=found.scale,
        centres=found.alpha[:usable],
        ratios=found.beta[:usable],
    )


# Products of univariate polynomials: their selection, values and sums.

# A sum of terms grouped by the degree of their first input, then of the next: at the end of each
# branch stands a coefficient.
NestedSums = float | list[tuple[int, "NestedSums"]]

# With more terms than this no fit is possible.
MOST_TERMS = 100_000

# Runs computed at a time: their values stay in the processor's cache. Each run is computed by
# itself, so results depend neither on this nor on the batch.
_ROWS = 4096


@dataclass(frozen=True, eq=False)
class ProductBasis:
    """Orthonormal polynomials of independent inputs."""

    # One for each random input, in the order of the joint distribution.
    univariate_bases: tuple[UnivariateBasis, ...]
    # Joint distributions of some inputs. The polynomials of these are ones in independent standard
    # normal variables, which follow from the inputs by Rosenblatt's transformation.
    joints: tuple[ChaospyJoint, ...] = ()

    @classmethod
    def from_distribution(
        cls, joint: JointDistribution, degree: int, *, logarithms: bool = True
    ) -> ProductBasis:
        """Build the basis of the random inputs from their distributions; see `univariate_basis`."""
        joints = tuple(each for each in joint.groups if isinstance(each, ChaospyJoint))
        joined = {name for each in joints for name in each.inputs}
        names = [entry.variable.name for entry in joint.random]
        distributions = (
            Normal(0.0, 1.0) if name in joined else entry.distribution
            for name, entry in zip(names, joint.random, strict=True)
        )
        return cls(
            tuple(
                univariate_basis(name, distribution, degree, logarithms=logarithms)
                for name, distribution in zip(names, distributions, strict=True)
            ),
            joints,
        )

    @property
    def names(self) -> tuple[str, ...]:
        """The inputs."""
        return tuple(basis.name for basis in self.univariate_bases)

    def indices(self, order: int, truncation: float) -> IntArray:
        """Return the degrees of every term up to an order; see `multi_indices`.

        Terms without polynomials are left out: a distribution on a few values has fewer of them.
        """
        found = multi_indices(len(self.univariate_bases), order, truncation)
        return found[(found <= self._highest_degrees).all(axis=1)]

    def has_terms(self, indices: IntArray) -> bool:
        """Return True if there are polynomials of all degrees, shape (term, input)."""
        if indices.ndim != 2 or indices.shape[1] != len(self.univariate_bases):
            return False
        return bool(((indices >= 0) & (indices <= self._highest_degrees)).all())

    @property
    def _highest_degrees(self) -> list[int]:
        return [basis.highest_degree for basis in self.univariate_bases]

    def matrix(self, inputs: Arrays, indices: IntArray) -> FloatArray:
        """Compute the values of terms at points, shape (run, term).

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            SI values.
        indices : ndarray of int, shape (term, input)
            Their degrees.
        """
        runs = len(inputs[self.names[0]])
        matrix = np.ones((len(indices), runs))
        for table, degrees in zip(self._tables(inputs, indices), indices.T, strict=True):
            rows = np.flatnonzero(degrees)
            matrix[rows] *= table[degrees[rows]]
        return matrix.T

    def evaluate(
        self, inputs: Arrays, indices: IntArray, expansions: Sequence[NestedSums]
    ) -> list[FloatArray]:
        """Evaluate expansions at points; the values do not depend on the batch, bit by bit.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            SI values.
        indices : ndarray of int, shape (term, input)
            Degrees of all the expansions' terms.
        expansions : sequence of NestedSums
            The result of `nested_sums` for each.
        """
        runs = len(inputs[self.names[0]])
        values = [np.empty(runs) for _ in expansions]
        for start in range(0, runs, _ROWS):
            rows = slice(start, start + _ROWS)
            some = {name: inputs[name][rows] for name in self.names}
            tables = self._tables(some, indices)
            for whole, expansion in zip(values, expansions, strict=True):
                whole[rows] = _sum(tables, expansion)
        return values

    def _tables(self, inputs: Arrays, indices: IntArray) -> list[FloatArray]:
        degrees = indices.max(axis=0, initial=0)
        for joint in self.joints:
            scores = joint.normal_scores(np.column_stack([inputs[name] for name in joint.inputs]))
            inputs = {**inputs, **dict(zip(joint.inputs, scores.T, strict=True))}
        return [
            basis.polynomials(inputs[basis.name], int(degree))
            for basis, degree in zip(self.univariate_bases, degrees, strict=True)
        ]


def multi_indices(dimension: int, order: int, truncation: float) -> IntArray:
    """Return the degrees of the terms with (Σ k^q)^(1/q) at most the order, the constant first.

    Their shape is (term, input). There are none where there would be more than `MOST_TERMS`.

    Parameters
    ----------
    dimension : int
        Number of inputs.
    order : int
        The highest degree of a term in one input.
    truncation : float
        q: 1 for all terms up to a total degree, less for fewer interactions.
    """
    # Rounding must not shut out a term that lies on the border.
    limit = order**truncation * (1 + 1e-12)
    degrees = np.arange(order + 1)
    powers = degrees.astype(np.float64) ** truncation
    found, sums = np.zeros((1, 0), dtype=np.int64), np.zeros(1)
    for _ in range(dimension):
        longer = (sums[:, None] + powers).ravel()
        is_within = longer <= limit
        if is_within.sum() > MOST_TERMS:
            return np.zeros((0, dimension), dtype=np.int64)
        before, degree = np.divmod(np.flatnonzero(is_within), len(degrees))
        found, sums = np.column_stack([found[before], degree]), longer[is_within]
    return found[np.lexsort((*-found.T[::-1], found.sum(axis=1)))]


def nested_sums(indices: IntArray, coefficients: FloatArray) -> NestedSums:
    """Convert an expansion to nested sums, which need a third of the multiplications."""
    order = np.lexsort(indices.T[::-1])
    terms = list(zip(indices[order].tolist(), coefficients[order].tolist(), strict=True))
    return _grouped(terms, 0)


def _grouped(terms: list[tuple[list[int], float]], position: int) -> NestedSums:
    if position == len(terms[0][0]):
        return terms[0][1]
    return [
        (degree, _grouped(list(group), position + 1))
        for degree, group in groupby(terms, key=lambda term: term[0][position])
    ]


def _sum(tables: Sequence[FloatArray], expansion: NestedSums) -> Any:
    """Evaluate nested sums, one operation on whole arrays after the other.

    Not a product of matrices: its last bits depend on how many rows there are.
    """
    if isinstance(expansion, float):
        return expansion
    total: Any = None
    for degree, inner in expansion:
        part = _sum(tables[1:], inner)
        if degree:
            part = part * tables[0][degree]
        total = part if total is None else total + part
    return total
