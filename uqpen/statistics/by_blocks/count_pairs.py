"""Counts of runs by the classes of two columns, compiled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import IntArray
from uqpen.models.compiled import compiled

__all__ = ["Classes", "count_pairs"]

Classes = npt.NDArray[np.int16]


@compiled("void(Array(int16, 1, 'C', True), Array(int16, 1, 'C', True), int64[:, ::1])")
def count_pairs(one: Classes, other: Classes, table: IntArray) -> None:
    """Add runs to a table, in place, by the row and the column of each."""
    for run in range(one.size):
        table[one[run], other[run]] += 1
