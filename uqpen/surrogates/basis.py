"""Products of univariate polynomials: their selection, values and sums."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray, IntArray
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.univariate_basis import UnivariateBasis, univariate_basis

__all__ = ["MOST_TERMS", "NestedSums", "ProductBasis", "multi_indices", "nested_sums"]


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
    """Orthonormal polynomials of independent inputs.

    Parameters
    ----------
    univariate_bases : tuple of UnivariateBasis
        One for each random input, in the order of the joint distribution.
    """

    univariate_bases: tuple[UnivariateBasis, ...]

    @classmethod
    def from_distribution(
        cls, joint: JointDistribution, degree: int, *, logarithms: bool = True
    ) -> ProductBasis:
        """Build the basis of the random inputs from their distributions; see `univariate_basis`."""
        return cls(
            tuple(
                univariate_basis(
                    entry.variable.name, entry.distribution, degree, logarithms=logarithms
                )
                for entry in joint.random
            )
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
