"""SALib's estimators of Sobol' indices, guarded.

Left to itself, SALib takes one value that is not a number, or outputs in a unit so large that their
variance lies below 1e-16, for an output that does not vary, and says zero.
"""

from __future__ import annotations

import numpy as np

from uqpen.core.arrays import FloatArray

__all__ = ["first_order", "second_order", "total_order"]


def first_order(A: FloatArray, AB: FloatArray, B: FloatArray) -> FloatArray:
    """First-order index (Saltelli et al. 2010, Comput. Phys. Commun. 181, 259-270).

    Parameters
    ----------
    A, AB, B : ndarray, shape (..., block)
        Standardized outputs at a point, at one that shares the others' input, and at another point
        that has that input. `AB` need not share anything with `A`.
    """
    from SALib.analyze import sobol

    _check_values(A, AB, B)
    return np.asarray(sobol.first_order(A.T, AB.T, B.T))


def total_order(A: FloatArray, AB: FloatArray, B: FloatArray) -> FloatArray:
    """Total-order index (Jansen 1999, Comput. Phys. Commun. 117, 35-43).

    Parameters
    ----------
    A, AB, B : ndarray, shape (..., block)
        Standardized outputs at a point, at one that differs in an input alone, and at another.
    """
    from SALib.analyze import sobol

    _check_values(A, AB, B)
    return np.asarray(sobol.total_order(A.T, AB.T, B.T))


def second_order(
    A: FloatArray,
    ABj: FloatArray,
    ABk: FloatArray,
    BAj: FloatArray,
    pair: FloatArray,
    B: FloatArray,
) -> FloatArray:
    """Index of a pair of inputs (Saltelli 2002, Comput. Phys. Commun. 145, 280-297).

    Parameters
    ----------
    A, ABj, ABk, B : ndarray, shape (block,)
        As for the first-order indices of the two inputs.
    BAj, pair : ndarray, shape (block,)
        Standardized outputs at two points that share both inputs.
    """
    from SALib.analyze import sobol

    _check_values(A, ABj, ABk, BAj, pair, B)
    index = np.asarray(sobol.second_order(A, ABj, pair, BAj, B))
    # SALib takes one point for that which shares the second input with B and that which shares both
    # with BA; where draws were made again they are two.
    return index + first_order(A, pair, B) - first_order(A, ABk, B)


def _check_values(*values: FloatArray) -> None:
    """Refuse values for which SALib gives wrong results; callers exclude them beforehand."""
    if len({column.shape for column in values}) > 1:
        raise ValueError(f"columns of unlike shapes: {[column.shape for column in values]}")
    if not all(np.isfinite(column).all() for column in values):
        raise ValueError("values that are not finite")
    spread = np.concatenate([values[0], values[-1]], axis=-1).std(axis=-1)
    if not ((spread > 0.1) & (spread < 10)).all():
        raise ValueError(f"values with a standard deviation of {spread}, not standardized")
