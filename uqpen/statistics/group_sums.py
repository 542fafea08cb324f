"""Sums over groups of runs."""

from __future__ import annotations

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray

__all__ = ["group_sums"]


def group_sums(values: FloatArray, group: IntArray, groups: int) -> FloatArray:
    """Sum values over each group of runs, added in the order of the runs.

    Parameters
    ----------
    values : ndarray, shape (..., run)
        Of one variable or of several.
    group : ndarray of int, shape (run,)
        The group of each run, from 0.
    groups : int
        Number of groups.

    Returns
    -------
    ndarray, shape (..., group)
    """
    sums = np.empty((*values.shape[:-1], groups))
    for row in np.ndindex(values.shape[:-1]):
        sums[row] = np.bincount(group, values[row], groups)
    return sums
