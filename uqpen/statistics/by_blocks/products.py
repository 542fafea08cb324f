"""Products of columns by batch of runs: how the columns correlate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray

__all__ = ["Products"]

# Correlations of columns that depend linearly on each other but for rounding.
_SINGULAR = 1e12


@dataclass(frozen=True, eq=False)
class Products:
    """Sums of columns and of their products, by batch.

    Parameters
    ----------
    sizes : ndarray of int, shape (batch,)
        Number of runs.
    sums : ndarray, shape (batch, column)
    products : ndarray, shape (batch, column, column)
    """

    sizes: IntArray
    sums: FloatArray
    products: FloatArray

    @classmethod
    def empty(cls, batches: int, columns: int) -> Products:
        """Return the sums of no runs."""
        shape = (batches, columns)
        sizes = np.zeros(batches, dtype=np.int64)
        return cls(sizes, np.zeros(shape), np.zeros((*shape, columns)))

    def add(self, batch: int, columns: FloatArray) -> None:
        """Add runs to a batch, in place; their columns are rows, about fixed centres."""
        self.sizes[batch] += columns.shape[1]
        self.sums[batch] += columns.sum(axis=1)
        for k, column in enumerate(columns):
            # `einsum` adds in one order on every processor.
            found = np.einsum("jr,r->j", columns[k:], column)
            self.products[batch, k, k:] += found
            self.products[batch, k + 1 :, k] += found[1:]

    @property
    def whole(self) -> Products:
        """All runs as one batch."""
        return Products(*(np.sum(each, axis=0, keepdims=True) for each in self._columns))

    def matrices(self) -> FloatArray:
        """Correlation matrix of each batch; NaN where a column does not vary."""
        runs = np.maximum(self.sizes, 1)[:, np.newaxis]
        means = self.sums / runs
        squares = self.products / runs[..., np.newaxis]
        covariance = squares - means[:, :, np.newaxis] * means[:, np.newaxis, :]
        variance = np.einsum("bkk->bk", covariance)
        spread = np.sqrt(np.where(variance > 0, variance, np.nan))
        return covariance / spread[:, :, np.newaxis] / spread[:, np.newaxis, :]

    @property
    def _columns(self) -> tuple[IntArray, FloatArray, FloatArray]:
        return self.sizes, self.sums, self.products


def partial(matrix: FloatArray, resolution: float = 0.0) -> FloatArray:
    """Partial correlations of the last column with each of the others, given all others.

    NaN for all where the columns are linearly dependent, as far as it can be known.

    Parameters
    ----------
    matrix : ndarray, shape (column, column)
        Correlations of the columns.
    resolution : float
        Share of the variance of a column that its cells do not resolve.
    """
    singular = min(_SINGULAR, 0.25 / resolution) if resolution else _SINGULAR
    if not np.isfinite(matrix).all() or np.linalg.cond(matrix) > singular:
        return np.full(len(matrix) - 1, np.nan)
    inverse = np.linalg.inv(matrix)
    found: FloatArray = -inverse[-1, :-1] / np.sqrt(inverse[-1, -1] * np.diag(inverse)[:-1])
    return found
