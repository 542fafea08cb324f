"""Forward selection of terms, judged at runs left out.

Terms are taken one by one, always the one that lowers the sum of squares the most once the others
have taken their part of it (orthogonal least squares). Each part of the runs is left out in turn,
and terms are chosen anew by the others; so the errors at the parts show how many terms to take.
The selections of all parts go step by step together, as their products with the candidates, which
take the time, are then one product of matrices.

References
----------
Chen, S., Billings, S. A. & Luo, W. (1989). Int. J. Control 50, 1873-1896.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray

__all__ = ["Selection", "forward_selection"]


# Most terms, and the largest number of terms as a share of the runs.
_MOST_TERMS = 400
_LARGEST_SHARE_OF_TERMS = 0.8
# It ends when this number of terms in a row have not lowered the error.
_PATIENCE = 20
# A column of which others leave less than this share of its squares depends on them.
_DEPENDENT = 1e-10
# Below this share of the squares of the values, what is left is rounding.
_NOTHING_LEFT = 1e-28


@dataclass(frozen=True, eq=False)
class Selection:
    """Terms in the order in which all runs choose them, with errors at runs left out.

    Parameters
    ----------
    columns : ndarray of int, shape (term,)
        Their columns of the matrix.
    errors : ndarray, shape (term,)
        Mean square error at runs left out, as a share of the variance, of as many terms: of those
        that the other runs choose.
    """

    columns: IntArray
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
        if len(errors) - 1 - int(np.argmin(errors)) >= _PATIENCE:
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
