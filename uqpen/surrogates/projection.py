"""Coefficients from an integration rule: each is the integral of the output times its term."""

from __future__ import annotations

import numpy as np

from uqpen.core.arrays import FloatArray

__all__ = ["is_exact", "projection_coefficients"]


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
