"""Splitters: ascending values of a column, and the cells that they divide all numbers into."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.statistics.by_blocks.locate import Cells, Places, locate

__all__ = ["Splitters"]

# Entries of the table from which searches start, for each splitter.
_ENTRIES = 4
# The table covers the values between these shares of the splitters; those beyond are searched for.
_TAIL = 1 / 512


@dataclass(frozen=True, eq=False)
class Splitters:
    """Ascending values of a column, all different.

    With k splitters there are 2 k + 1 cells, in ascending order: below the first splitter, at it,
    between it and the second, and so on. So a value that many runs share has a cell of its own.

    Parameters
    ----------
    values : ndarray, shape (splitter,)
        At most 65 535.
    """

    values: FloatArray

    @classmethod
    def from_values(cls, values: FloatArray, most: int) -> Splitters:
        """Return evenly spread order statistics of some values, without those that repeat."""
        distinct = np.unique(values)
        if distinct.size > most:
            places = (np.arange(most) + 0.5) / most * values.size
            distinct = np.unique(np.sort(values)[places.astype(np.int64)])
        return cls(distinct)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return 2 * self.values.size + 1

    def locate(self, values: FloatArray) -> Cells:
        """Return the cell of each value; an even one lies between splitters."""
        found = np.empty(values.size, dtype=np.int32)
        locate(np.ascontiguousarray(values), self._searched, *self._steps, self._first, found)
        return found

    @cached_property
    def _searched(self) -> FloatArray:
        return np.append(self.values, [np.nan, np.nan])

    @cached_property
    def _steps(self) -> tuple[float, float]:
        """Begin of the table, and its entries by unit of the column."""
        if not self.values.size:
            return 0.0, 0.0
        tail = int(self.values.size * _TAIL)
        low, high = self.values[tail], self.values[-1 - tail]
        with np.errstate(over="ignore", divide="ignore"):
            scale = _ENTRIES * self.values.size / (high - low)
        return float(low), float(scale) if np.isfinite(scale) else 0.0

    @cached_property
    def _first(self) -> Places:
        """Number of splitters before each entry of the table, and all at the end."""
        origin, scale = self._steps
        entries = _ENTRIES * self.values.size
        with np.errstate(over="ignore"):
            steps = (self.values - origin) * scale
        entry = np.clip(steps, 0, max(entries - 1, 0)).astype(np.int64)
        counts = np.bincount(entry, minlength=max(entries, 1))
        return np.concatenate([[0], np.cumsum(counts)]).astype(np.uint16)
