"""Moments and sensitivity of an orthonormal expansion: sums of its squared coefficients.

They are those of the expansion under independent inputs; how near they are to the model's is a
matter of how well the expansion fits it.

References
----------
Sudret, B. (2008). Reliab. Eng. Syst. Saf. 93, 964-979.
Owen, A. B. (2014). SIAM/ASA J. Uncertain. Quantif. 2, 245-251 (Shapley effects).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray

__all__ = ["SobolIndices", "mean", "shapley_effects", "sobol_indices", "standard_deviation"]


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """Shares of the variance.

    Parameters
    ----------
    first, total : ndarray, shape (input,)
        First-order and total-order indices.
    second : ndarray, shape (input, input)
        Second-order indices; symmetric, NaN on the diagonal.
    """

    first: FloatArray
    total: FloatArray
    second: FloatArray


def mean(indices: IntArray, coefficients: FloatArray) -> float:
    """Return the mean: the constant term's coefficient."""
    return float(coefficients[~indices.any(axis=1)].sum())


def standard_deviation(indices: IntArray, coefficients: FloatArray) -> float:
    """Return the standard deviation: the root of the sum of all other coefficients' squares."""
    return math.sqrt(float(np.sum(coefficients[indices.any(axis=1)] ** 2)))


def sobol_indices(indices: IntArray, coefficients: FloatArray) -> SobolIndices:
    """Compute first-order, second-order and total-order indices; NaN without variance.

    Parameters
    ----------
    indices : ndarray of int, shape (term, input)
        The terms' degrees.
    coefficients : ndarray, shape (term,)
        Of orthonormal terms.
    """
    variances, active = _variances(indices, coefficients)
    inputs = active.sum(axis=1)
    alone, pairs = active[inputs == 1], active[inputs == 2].astype(np.float64)
    second = np.einsum("t,ti,tj->ij", variances[inputs == 2], pairs, pairs)
    np.fill_diagonal(second, np.nan)
    with np.errstate(invalid="ignore"):
        return SobolIndices(
            first=_total(variances[inputs == 1], alone) / variances.sum(),
            total=_total(variances, active) / variances.sum(),
            second=second / variances.sum(),
        )


def shapley_effects(indices: IntArray, coefficients: FloatArray) -> FloatArray:
    """Shapley effects, shape (input,): each term's variance in equal parts to the inputs in it.

    Their sum is 1; NaN without variance.
    """
    variances, active = _variances(indices, coefficients)
    with np.errstate(invalid="ignore"):
        return _total(variances / active.sum(axis=1), active) / variances.sum()


def _total(variances: FloatArray, active: BoolArray) -> FloatArray:
    """Return for each input the sum over the terms that it is in, shape (input,)."""
    return np.where(active, variances[:, None], 0.0).sum(axis=0)


def _variances(indices: IntArray, coefficients: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return each term's variance, without the constant's, and the inputs in it."""
    active = indices > 0
    terms = active.any(axis=1)
    return coefficients[terms] ** 2, active[terms]
