"""Sums of variables by the cells of their runs, compiled."""

from __future__ import annotations

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.models.compiled import compiled
from uqpen.statistics.by_blocks.locate import Cells

__all__ = ["sums_by_cell"]


@compiled("float64[:, ::1](Array(int32, 1, 'C', True), Array(float64, 2, 'C', True), int64)")
def sums_by_cell(cells: Cells, variables: FloatArray, size: int) -> FloatArray:
    """Return the sum of each variable over each cell, shape (cell, variable), in order of runs.

    The sums of a cell are neighbours: a run finds all of them in one line of the cache.

    Parameters
    ----------
    cells : ndarray of int, shape (run,)
    variables : ndarray, shape (variable, run)
    size : int
        Number of cells.
    """
    sums = np.zeros((size, len(variables)))
    for run in range(len(cells)):
        of_cell = sums[cells[run]]
        for k in range(len(variables)):
            of_cell[k] += variables[k, run]
    return sums
