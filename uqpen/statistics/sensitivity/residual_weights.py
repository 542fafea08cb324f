"""Residuals of linear regressions of columns on each other, as weighted sums of the columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray

__all__ = ["ResidualWeights"]


@dataclass(frozen=True, eq=False)
class ResidualWeights:
    """Regressions of inputs and an output on the other inputs, all from one inverse.

    Parameters
    ----------
    inverse : ndarray, shape (input, input)
        Of the mean products of the inputs (the precision matrix).
    slopes : ndarray, shape (input,)
        Of the output on all inputs.
    """

    inverse: FloatArray
    slopes: FloatArray

    @classmethod
    def of(cls, products: FloatArray) -> ResidualWeights:
        """Return the regressions, given the mean products of all columns, the output last."""
        inverse = _inverse(products[:-1, :-1])
        return cls(inverse, (inverse * products[-1, :-1]).sum(axis=1))

    def without(self, i: int) -> FloatArray:
        """Return the weights in the residuals of input `i` and of the output on the other inputs.

        Returns
        -------
        ndarray, shape (2, column)
            The column of the output is the last.
        """
        own = self.inverse[i] / self.inverse[i, i]
        slopes = self.slopes - self.slopes[i] * own
        slopes[i] = 0.0
        return np.stack([np.append(own, 0.0), np.append(-slopes, 1.0)])


def _inverse(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a positive definite matrix, by sweeping each of its columns.

    Its digits do not depend on the processor, as those of linear algebra do. Goodnight, J. H.
    (1979). Am. Stat. 33, 149-158.
    """
    swept = matrix.copy()
    for k in range(len(swept)):
        pivot, row, column = swept[k, k], swept[k].copy(), swept[:, k].copy()
        swept -= np.outer(column, row / pivot)
        swept[k], swept[:, k] = row / pivot, -column / pivot
        swept[k, k] = 1 / pivot
    return swept
