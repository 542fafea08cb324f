"""Coefficients of an expansion: by least squares, and by an integration rule."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray, IntArray

# Coefficients from runs: least squares on all terms, or on those that a sparse fit chooses.
#
# A sparse fit takes the terms one by one, always the one most correlated with what is left, and
# keeps as many as have the least leave-one-out error (orthogonal matching pursuit). That error
# needs no refitting: it follows from the residuals and the leverages of one fit. But it is of terms
# that the run left out has helped to choose, and so too small; cross-validation chooses them anew.
#
# References
# ----------
# Blatman, G. & Sudret, B. (2011). J. Comput. Phys. 230, 2345-2367.
# Chapelle, O., Vapnik, V. & Bengio, Y. (2002). Mach. Learn. 48, 9-23 (the correction for few
# runs).
# Tropp, J. & Gilbert, A. (2007). IEEE Trans. Inf. Theory 53, 4655-4666.

# Most terms of a sparse fit, and the largest number of terms as a share of the runs.
_MOST_TERMS = 400
_LARGEST_SHARE_OF_TERMS = 0.5
# It ends when this number of terms in a row have not lowered the error, or the remainder is zero.
_PATIENCE = 20
_NOTHING_LEFT = 1e-14

# Parts of the runs in cross-validation.
FOLDS = 5

# A column that adds less than this share of itself to those before depends on them.
_DEPENDENT = 1e-10


@dataclass(frozen=True, eq=False)
class RegressionFit:
    """Coefficients of terms, and their errors."""

    terms: IntArray  # (term,): which columns of the matrix have a coefficient, ascending
    coefficients: FloatArray  # (term,): theirs
    # Mean square of each run's error when it is left out, as a share of the variance.
    leave_one_out: float
    # The same, corrected upwards, as few runs make many terms look too good. It compares fits to
    # the same runs. Infinite where it cannot be computed.
    corrected: float


def least_squares(matrix: FloatArray, values: FloatArray) -> RegressionFit | None:
    """Fit all columns by ordinary least squares; None where they are linearly dependent.

    Parameters
    ----------
    matrix : ndarray, shape (run, term)
        With more rows than columns.
    values : ndarray, shape (run,)
        The values to fit; not constant.
    """
    runs, terms = matrix.shape
    if runs <= terms:
        return None
    q, r = np.linalg.qr(matrix)
    size = np.abs(np.diagonal(r))
    if not size.min() > _DEPENDENT * size.max():
        return None
    coefficients = scipy.linalg.solve_triangular(r, q.T @ values)
    error = _leave_one_out(values - q @ (q.T @ values), (q**2).sum(axis=1), values)
    inverse = scipy.linalg.solve_triangular(r, np.eye(terms))
    corrected = error * _correction(runs, terms, float((inverse**2).sum()))
    return RegressionFit(np.arange(terms), coefficients, error, corrected)


def sparse_regression(matrix: FloatArray, values: FloatArray) -> RegressionFit | None:
    """Fit by least squares a few columns, those with the least leave-one-out error.

    Parameters
    ----------
    matrix : ndarray, shape (run, term)
        All candidates, the constant first; there may be more of them than runs.
    values : ndarray, shape (run,)
        The values to fit; not constant.
    """
    chosen, corrected = _matching_pursuit(matrix, values)
    terms = np.sort(np.array(chosen, dtype=np.int64))
    fit = least_squares(matrix[:, terms], values)
    return fit and RegressionFit(terms, fit.coefficients, fit.leave_one_out, corrected)


def cross_validation(matrix: FloatArray, values: FloatArray, folds: IntArray) -> float:
    """Return the mean square error of a sparse fit at runs left out of selection and fit.

    It is a share of the variance.

    Parameters
    ----------
    matrix, values
        As for `sparse_regression`.
    folds : ndarray of int, shape (run,)
        The part that each run belongs to, from 0 to `FOLDS` - 1.
    """
    squares = 0.0
    for fold in range(FOLDS):
        out = folds == fold
        fit = sparse_regression(matrix[~out], values[~out])
        if fit is None:
            return np.inf
        error = values[out] - matrix[np.ix_(out, fit.terms)] @ fit.coefficients
        squares += float(np.sum(error**2))
    return squares / len(values) / float(np.var(values, ddof=1))


def _matching_pursuit(matrix: FloatArray, values: FloatArray) -> tuple[list[int], float]:
    """Return the columns of the best fit in the sequence, and its corrected error."""
    runs, candidates = matrix.shape
    most = min(candidates, max(int(_LARGEST_SHARE_OF_TERMS * runs), 1), _MOST_TERMS)
    norms = np.sqrt((matrix**2).sum(axis=0))
    is_free = norms > 0
    q, inverse = np.empty((runs, most), order="F"), np.zeros((most, most))
    residual, leverage = values.copy(), np.zeros(runs)
    chosen: list[int] = []
    best, best_error = 1, np.inf
    for count in range(most):
        gains = np.abs(residual @ matrix) / np.where(is_free, norms, np.inf)
        column = int(gains.argmax()) if count else 0
        is_free[column] = False
        projection, direction = _orthogonalize(q[:, :count], matrix[:, column])
        length = float(np.linalg.norm(direction))
        if not length > _DEPENDENT * norms[column]:
            break
        q[:, count] = direction / length
        # The inverse of R grows by a column; its squares are the trace that the correction needs.
        inverse[:count, count] = -inverse[:count, :count] @ projection / length
        inverse[count, count] = 1 / length
        residual = residual - q[:, count] * (q[:, count] @ residual)
        leverage += q[:, count] ** 2
        chosen.append(column)
        error = _leave_one_out(residual, leverage, values)
        error *= _correction(runs, count + 1, float((inverse**2).sum()))
        if error < best_error:
            best, best_error = count + 1, error
        is_done = np.linalg.norm(residual) <= _NOTHING_LEFT * np.linalg.norm(values)
        if is_done or count + 1 - best > _PATIENCE:
            break
    return chosen[:best], best_error


def _orthogonalize(q: FloatArray, column: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Split a column into its coefficients on orthonormal columns and a remainder."""
    first = q.T @ column
    rest = column - q @ first
    # Twice is enough (Kahan): rounding leaves a little in common after the first time.
    second = q.T @ rest
    return first + second, rest - q @ second


def _leave_one_out(residual: FloatArray, leverage: FloatArray, values: FloatArray) -> float:
    """Return the mean square of e / (1 - h), as a share of the variance."""
    with np.errstate(divide="ignore", invalid="ignore"):
        error = float(np.mean((residual / (1 - leverage)) ** 2) / np.var(values, ddof=1))
    return error if np.isfinite(error) else np.inf


def _correction(runs: int, terms: int, trace: float) -> float:
    """Return Chapelle's factor n / (n - P) · (1 + tr C⁻¹ / n), with C the mean of ψψᵀ."""
    return runs / (runs - terms) * (1 + trace) if runs > terms else np.inf


# Coefficients from an integration rule: each is the integral of the output times its term.

# Nodes and weights come from a library with about this accuracy.
_TOLERANCE = 1e-8


def is_exact(matrix: FloatArray, weights: FloatArray) -> bool:
    """Check that a rule reproduces the orthonormality of the terms.

    Where it does not, a coefficient includes parts of other terms.

    Parameters
    ----------
    matrix : ndarray, shape (node, term)
        The terms at the nodes.
    weights : ndarray, shape (node,)
        Weights of the rule; some may be negative.
    """
    products = matrix.T @ (weights[:, None] * matrix)
    return bool(np.abs(products - np.eye(matrix.shape[1])).max() < _TOLERANCE)


def projection_coefficients(
    matrix: FloatArray, weights: FloatArray, values: FloatArray
) -> FloatArray:
    """Compute the coefficients, Σ w ψ f."""
    return matrix.T @ (weights * values)
