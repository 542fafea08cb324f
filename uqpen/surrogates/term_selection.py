"""Terms of an expansion: of a given order, or of the order with the best fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray, IntArray
from uqpen.surrogates.basis import MOST_TERMS, ProductBasis
from uqpen.surrogates.projection import is_exact, projection_coefficients
from uqpen.surrogates.regression import (
    FOLDS,
    RegressionFit,
    cross_validation,
    least_squares,
    sparse_regression,
)

__all__ = [
    "HIGHEST_ORDER",
    "FitPoints",
    "Terms",
    "dependent_terms_problem",
    "projection_terms",
    "regression_terms",
    "run_count_problem",
    "size_problem",
    "unseen_error",
]


# The highest order that is tried where none is given.
HIGHEST_ORDER = 20
# Orders are tried until this number of them in a row have been worse than the best one.
_PATIENCE = 3
# Below this error, a share of the variance, no figure is worth another order.
_EXACT = 1e-16
# An order is tried while its matrix has at most this number of entries: about a second ...
_MOST_ENTRIES = 4_000_000
# ... and given, while it fits into memory.
_MOST_ENTRIES_GIVEN = 100_000_000

_METHODS: dict[str, Callable[[FloatArray, FloatArray], RegressionFit | None]] = {
    "least-squares": least_squares,
    "sparse": sparse_regression,
}


@dataclass(frozen=True, eq=False)
class Terms:
    """Terms with coefficients.

    Parameters
    ----------
    indices : ndarray of int, shape (term, input)
        Their degrees.
    coefficients : ndarray, shape (term,)
        Theirs.
    order : int
        The highest order of all the terms that they were chosen from.
    truncation : float
        The truncation of these; see `uqpen.surrogates.basis.multi_indices`.
    leave_one_out, cross_validation : float
        Mean square error as a share of the variance: see `RegressionFit`, and at runs that took no
        part in the choice of the terms either. The second is at least the first. Both are the same
        where all terms are kept, and NaN for a projection.
    """

    indices: IntArray
    coefficients: FloatArray
    order: int
    truncation: float
    leave_one_out: float
    cross_validation: float


@dataclass(frozen=True, eq=False)
class FitPoints:
    """The points of a fit and the terms that may be fitted there.

    Parameters
    ----------
    basis : ProductBasis
        Basis of the random inputs.
    inputs : mapping of str to ndarray, shape (run,)
        Their values.
    truncation : float
        See `uqpen.surrogates.basis.multi_indices`.
    """

    basis: ProductBasis
    inputs: Arrays
    truncation: float

    @property
    def run_count(self) -> int:
        """Number of runs."""
        return len(next(iter(self.inputs.values())))

    def orders(
        self, most_terms: float = math.inf, most_entries: float = _MOST_ENTRIES
    ) -> Iterator[tuple[int, IntArray]]:
        """Yield orders from 1 and their terms, as long as there are not too many of them.

        The matrix of the terms at all points has at most `most_entries` entries.
        """
        for order in range(1, HIGHEST_ORDER + 1):
            indices = self.basis.indices(order, self.truncation)
            if not 0 < len(indices) <= min(most_terms, max(most_entries / self.run_count, 1)):
                return
            yield order, indices

    def matrix(self, indices: IntArray) -> FloatArray:
        """Return the values of the terms at the points."""
        return self.basis.matrix(self.inputs, indices)


def regression_terms(
    points: FitPoints,
    values: FloatArray,
    method: str,
    order: int | None,
    rng: np.random.Generator,
) -> Terms | str:
    """Find terms from runs at any points, or the reason why there are none.

    Parameters
    ----------
    points : FitPoints
        The points of the runs.
    values : ndarray, shape (run,)
        The values to fit; not constant.
    method : str
        ``"sparse"`` or ``"least-squares"``.
    order : int, optional
        The order; without it, that of the least cross-validation error, or of the least corrected
        leave-one-out error where all terms are kept. On the concrete study, the order of a sparse
        fit with the least leave-one-out error has two to three times the error at fresh runs.
    rng : Generator
        Divides the runs for cross-validation.
    """
    if problem := run_count_problem(points):
        return problem
    folds = rng.permutation(np.arange(points.run_count) % FOLDS)
    if order is not None:
        return _terms_of_order(points, values, method, order, folds)
    best, least = None, np.inf
    most_terms = math.inf if method == "sparse" else points.run_count / 2
    for tried, indices in points.orders(most_terms):
        found, error = _fitted(points, values, method, tried, indices, folds)
        if found is not None and (best is None or error < least):
            best, least = found, error
        if best and (least < _EXACT or tried - best.order >= _PATIENCE):
            break
    return best or dependent_terms_problem(1)


def projection_terms(
    points: FitPoints, weights: FloatArray, values: FloatArray, order: int | None
) -> Terms | str:
    """Find terms from an integration rule, or the reason why there are none.

    Parameters
    ----------
    points : FitPoints
        The rule's nodes.
    weights : ndarray, shape (node,)
        Its weights.
    values : ndarray, shape (node,)
        The values to fit.
    order : int, optional
        The order; without it, the highest that the rule is exact for.
    """
    best: Terms | None = None
    for tried, indices in points.orders(points.run_count):
        matrix = points.matrix(indices)
        if not is_exact(matrix, weights):
            break
        found = projection_coefficients(matrix, weights, values)
        best = Terms(indices, found, tried, points.truncation, np.nan, np.nan)
        if tried == order:
            return best
    highest = best.order if best else 0
    if order is not None or best is None:
        wanted = "any order" if order is None else f"order {order}"
        return f"its rule is too coarse for {wanted}; the highest that it is exact for is {highest}"
    return best


def run_count_problem(points: FitPoints) -> str:
    """Return the reason why there are too few runs for any regression; empty if there is none."""
    dimension = len(points.basis.univariate_bases)
    fewest = 2 * (dimension + 1)
    if points.run_count >= fewest:
        return ""
    inputs = f"{dimension} random input{'s' * (dimension > 1)}"
    return f"{points.run_count} runs came back, and {inputs} need at least {fewest}"


def size_problem(points: FitPoints, order: int) -> str:
    """Return the reason why an order has too many terms; empty if there is none."""
    terms, runs = len(points.basis.indices(order, points.truncation)), points.run_count
    if terms and terms * runs <= _MOST_ENTRIES_GIVEN:
        return ""
    count = f"{terms:_}" if terms else f"more than {MOST_TERMS:_}"
    return f"order {order} has {count} terms, too many for {runs} runs to be fitted in memory"


def dependent_terms_problem(order: int) -> str:
    """Return the reason why linearly dependent terms have no coefficients."""
    return f"its points do not tell the terms of order {order} apart"


def unseen_error(fit: RegressionFit, of_folds: float) -> float:
    """Return the error of a sparse fit at runs that it has not seen.

    Each fold of a cross-validation chooses terms of its own, so its error may be of another fit.
    All runs chose the terms that are kept, so the error of these is at least their leave-one-out
    error. It is just that for a constant, in which nothing was chosen.
    """
    if len(fit.terms) == 1:
        return fit.leave_one_out
    return max(of_folds, fit.leave_one_out)


def _terms_of_order(
    points: FitPoints, values: FloatArray, method: str, order: int, folds: IntArray
) -> Terms | str:
    if problem := size_problem(points, order):
        return problem
    indices = points.basis.indices(order, points.truncation)
    terms, runs = len(indices), points.run_count
    if method == "least-squares" and runs <= terms:
        return (
            f"{runs} runs came back, and least squares need more of them than order {order} has "
            f"terms, {terms}"
        )
    found, _ = _fitted(points, values, method, order, indices, folds)
    return found or dependent_terms_problem(order)


def _fitted(
    points: FitPoints,
    values: FloatArray,
    method: str,
    order: int,
    indices: IntArray,
    folds: IntArray,
) -> tuple[Terms | None, float]:
    """Fit the terms of an order; return them with the error for comparing orders."""
    matrix = points.matrix(indices)
    fit = _METHODS[method](matrix, values)
    if fit is None:
        return None, np.inf
    unseen, compared = fit.leave_one_out, fit.corrected
    if method == "sparse":
        unseen = compared = unseen_error(fit, cross_validation(matrix, values, folds))
    degrees, truncation = indices[fit.terms], points.truncation
    terms = Terms(degrees, fit.coefficients, order, truncation, fit.leave_one_out, unseen)
    return terms, compared
