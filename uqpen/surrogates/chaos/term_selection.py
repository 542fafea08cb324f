"""Terms of an expansion: of a given order, or of the order with the best fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from uqpen.core.arrays import Arrays, BoolArray, FloatArray, IntArray
from uqpen.core.errors import counted
from uqpen.surrogates.chaos.basis import MOST_TERMS, ProductBasis
from uqpen.surrogates.chaos.coefficients import (
    FOLDS,
    RegressionFit,
    cross_validation,
    is_exact,
    least_squares,
    projection_coefficients,
    sparse_regression,
)

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
    """Terms with coefficients."""

    indices: IntArray  # (term, input): their degrees
    coefficients: FloatArray  # (term,): theirs
    order: int  # the highest order of all the terms that they were chosen from
    truncation: float  # the truncation of these; see `uqpen.surrogates.chaos.basis.multi_indices`
    # Mean square errors as a share of the variance: both the same where all terms are kept, and NaN
    # for a projection.
    leave_one_out: float  # see `RegressionFit`
    cross_validation: float  # at runs that took no part in the choice of the terms either; no less


@dataclass(frozen=True, eq=False)
class FitPoints:
    """The points of a fit and the terms that may be fitted there."""

    basis: ProductBasis  # basis of the random inputs
    inputs: Arrays  # (run,): their values
    truncation: float  # see `uqpen.surrogates.chaos.basis.multi_indices`

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
    values : ndarray, shape (run,)
        The values to fit; not constant.
    order : int, optional
        The order; without it, that of the least cross-validation error, or of the least corrected
        leave-one-out error where all terms are kept. On the concrete study, the order of a sparse
        fit with the least leave-one-out error has two to three times the error at fresh runs.
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
    inputs = counted(dimension, "random input")
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


# Forward selection of terms, judged at runs left out.
#
# Terms are taken one by one, always the one that lowers the sum of squares the most once the others
# have taken their part of it (orthogonal least squares). Each part of the runs is left out in turn,
# and terms are chosen anew by the others; so the errors at the parts show how many terms to take.
# The selections of all parts go step by step together, as their products with the candidates, which
# take the time, are then one product of matrices.
#
# References
# ----------
# Chen, S., Billings, S. A. & Luo, W. (1989). Int. J. Control 50, 1873-1896.

# Most terms, and the largest number of terms as a share of the runs.
_MOST_TERMS = 400
_LARGEST_SHARE_OF_TERMS = 0.8
# It ends when this number of terms in a row have not lowered the error.
_STEP_PATIENCE = 20
# A column of which others leave less than this share of its squares depends on them.
_DEPENDENT = 1e-10
# Below this share of the squares of the values, what is left is rounding.
_NOTHING_LEFT = 1e-28


@dataclass(frozen=True, eq=False)
class Selection:
    """Terms in the order in which all runs choose them, with errors at runs left out."""

    columns: IntArray  # (term,): their columns of the matrix
    # (term,): mean square error at runs left out, as a share of the variance, of as many terms: of
    # those that the other runs choose.
    errors: FloatArray

    @property
    def least_error(self) -> float:
        """Least of the errors."""
        return float(self.errors.min())

    @property
    def best(self) -> IntArray:
        """Columns with the least error, ascending."""
        return np.sort(self.columns[: int(self.errors.argmin()) + 1])


def forward_selection(matrix: FloatArray, values: FloatArray, is_in: BoolArray) -> Selection:
    """Choose columns one by one, and find the errors of as many at the runs left out.

    Parameters
    ----------
    matrix : ndarray, shape (run, term)
        All candidates, the constant first; there may be more of them than runs.
    values : ndarray, shape (run,)
        The values to fit; not constant.
    is_in : ndarray of bool, shape (fit, run)
        The runs of each selection. The last one has all of them, and each run is left out of as
        many of the others.
    """
    fewest = int(is_in.sum(axis=1).min())
    most = min(matrix.shape[1], max(int(_LARGEST_SHARE_OF_TERMS * fewest), 1), _MOST_TERMS)
    growing = _GrowingFits(matrix, values, is_in, most)
    errors: list[float] = []
    while len(errors) < most and growing.grow():
        errors.append(growing.error_left_out)
        if len(errors) - 1 - int(np.argmin(errors)) >= _STEP_PATIENCE:
            break
    columns = np.array(growing.columns, dtype=np.int64)
    return Selection(columns, np.array(errors) / float(np.var(values, ddof=1)))


class _GrowingFits:
    """Least-squares fits to several selections of the runs, all with a term more at each step.

    Parameters
    ----------
    matrix, values, is_in
        As for `forward_selection`.
    most : int
        Most terms.
    """

    def __init__(self, matrix: FloatArray, values: FloatArray, is_in: BoolArray, most: int) -> None:
        self._matrix = matrix
        self._is_in = is_in.astype(np.float64)
        self._fits = np.arange(len(is_in))
        self._squares = self._is_in @ matrix**2
        # Of each candidate: the squares that the terms leave of it, and its product with the
        # residuals.
        self._left = self._squares.copy()
        self._residuals = np.tile(values, (len(is_in), 1))
        self._products = (self._is_in * values) @ matrix
        self._nothing = _NOTHING_LEFT * (self._is_in @ values**2)
        self._directions = np.zeros((len(is_in), most, len(values)))
        self._is_growing = np.ones(len(is_in), dtype=np.bool_)
        self.columns: list[int] = []

    @property
    def error_left_out(self) -> float:
        """Mean square error of runs in the fits that leave them out."""
        out = 1 - self._is_in
        return float((out * self._residuals**2).sum() / out.sum())

    def grow(self) -> bool:
        """Give each fit the term that lowers its squares the most; False where none is left.

        A fit without such a term, or with nothing left to explain, stays as it is.
        """
        columns = self._best_columns()
        chosen = self._matrix.T[columns]
        direction = self._orthogonal(chosen)
        length = np.sqrt((self._is_in * direction**2).sum(axis=1))
        is_new = length**2 > _DEPENDENT * self._squares[self._fits, columns]
        self._is_growing &= is_new
        if not self._is_growing[-1]:
            return False
        scale = np.divide(1, length, out=np.zeros_like(length), where=self._is_growing)
        direction *= scale[:, None]
        self._directions[:, len(self.columns)] = direction
        self._take(direction)
        self._left[self._fits, columns] = 0.0
        self.columns.append(int(columns[-1]))
        return True

    def _best_columns(self) -> IntArray:
        if not self.columns:
            return np.zeros(len(self._fits), dtype=np.int64)
        is_free = self._left > _DEPENDENT * self._squares
        gains = np.divide(
            self._products**2, self._left, out=np.zeros_like(self._left), where=is_free
        )
        return gains.argmax(axis=1)

    def _orthogonal(self, columns: FloatArray) -> FloatArray:
        """Return what the terms of each fit leave of a column, shape (fit, run)."""
        rest = columns.copy()
        directions = self._directions[:, : len(self.columns)]
        # Twice is enough (Kahan): rounding leaves a little in common after the first time.
        for _ in range(2):
            common = directions @ (self._is_in * rest)[:, :, None]
            rest -= (common.swapaxes(1, 2) @ directions)[:, 0]
        return rest

    def _take(self, direction: FloatArray) -> None:
        """Take the part along a direction out of the residuals and the candidates."""
        inside = self._is_in * direction
        part = (inside * self._residuals).sum(axis=1)
        self._residuals -= part[:, None] * direction
        common = inside @ self._matrix
        self._products -= part[:, None] * common
        self._left -= common**2
        self._is_growing &= (self._is_in * self._residuals**2).sum(axis=1) > self._nothing


# Terms of an expansion whose truncation, order and number of terms are chosen together.

# From few interactions to all of them.
TRUNCATIONS = (0.4, 0.5, 0.6, 0.75, 0.9, 1.0)
# Parts of the runs in cross-validation. Of few runs, a fit needs nearly all, and how they are
# divided would decide: they are divided into more parts, twice.
_FEW_RUNS, _PARTS_OF_FEW, _DIVISIONS_OF_FEW = 200, 10, 2
# A matrix has at most this number of entries: the pairs of 100 inputs at 1 000 runs.
_MOST_CHOSEN_ENTRIES = 6_000_000


@dataclass(frozen=True, eq=False)
class _Choice:
    """Terms chosen from those of one truncation and order."""

    points: FitPoints  # with the truncation
    order: int  # the order
    indices: IntArray  # (term, input): degrees of all the terms that they were chosen from
    selection: Selection  # the choice

    @property
    def error(self) -> float:
        """Error at runs left out, as a share of the variance."""
        return self.selection.least_error

    def fitted(self, values: FloatArray) -> Terms | str:
        """Return the terms with coefficients from all runs, or the reason why there are none."""
        indices = self.indices[self.selection.best]
        fit = least_squares(self.points.matrix(indices), values)
        if fit is None:
            return dependent_terms_problem(self.order)
        return Terms(
            indices,
            fit.coefficients,
            self.order,
            self.points.truncation,
            fit.leave_one_out,
            unseen_error(fit, self.error),
        )


def chosen_terms(
    points: FitPoints,
    values: FloatArray,
    order: int | None,
    rng: np.random.Generator,
    truncations: Sequence[float] = TRUNCATIONS,
) -> Terms | str:
    """Find the terms with the least error at runs left out, or the reason why there are none.

    Of several truncations with the same error, it is the one with the fewest interactions.

    Parameters
    ----------
    points : FitPoints
        The points of the runs; other truncations take the place of theirs.
    values : ndarray, shape (run,)
        The values to fit; not constant.
    order : int, optional
        The order; without it, the best one.
    truncations : sequence of float
        Those to choose from, ascending.
    """
    if problem := run_count_problem(points):
        return problem
    fewest = replace(points, truncation=truncations[0])
    if order is not None and (problem := size_problem(fewest, order)):
        return problem
    is_in = _parts(points.run_count, rng)
    # Truncations have the same terms at many orders.
    known: dict[bytes, Selection] = {}

    def select(indices: IntArray) -> Selection:
        key = indices.tobytes()
        if key not in known:
            known[key] = forward_selection(points.matrix(indices), values, is_in)
        return known[key]

    best: _Choice | None = None
    for truncation in truncations:
        found = _best_order(replace(points, truncation=truncation), order, select)
        if found and (best is None or found.error < best.error):
            best = found
        if best and best.error < _EXACT:
            break
    return best.fitted(values) if best else dependent_terms_problem(order or 1)


def _best_order(
    points: FitPoints, order: int | None, select: Callable[[IntArray], Selection]
) -> _Choice | None:
    """Return the choice with the least error for one truncation."""
    best: _Choice | None = None
    for tried, indices in _candidates(points, order):
        found = _Choice(points, tried, indices, select(indices))
        if best is None or found.error < best.error:
            best = found
        if best.error < _EXACT or tried - best.order >= _PATIENCE:
            break
    return best


def _candidates(points: FitPoints, order: int | None) -> Iterator[tuple[int, IntArray]]:
    """Yield orders and their terms."""
    if order is None:
        yield from points.orders(most_entries=_MOST_CHOSEN_ENTRIES)
    elif not size_problem(points, order):
        yield order, points.basis.indices(order, points.truncation)


def _parts(runs: int, rng: np.random.Generator) -> BoolArray:
    """Return the runs of each fit, shape (fit, run): all but a part of them, and in the end all."""
    parts, divisions = (_PARTS_OF_FEW, _DIVISIONS_OF_FEW) if runs <= _FEW_RUNS else (FOLDS, 1)
    folds = np.array([rng.permutation(np.arange(runs) % parts) for _ in range(divisions)])
    is_in = folds[:, None] != np.arange(parts)[:, None]
    return np.vstack([is_in.reshape(-1, runs), np.ones(runs, dtype=np.bool_)])
