"""Distribution of a column: cells between splitters, their counts, and values of a few cells."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.models.compiled import compiled

__all__ = ["CellCounts", "CellValues", "Cells", "OrderedValues", "Places", "Splitters", "locate"]

Cells = npt.NDArray[np.int32]
# Half the memory of integers of four bytes, so that more of a table stays near the processor.
Places = npt.NDArray[np.uint16]

_FLOATS = "Array(float64, 1, 'C', True)"


@compiled(f"void({_FLOATS}, {_FLOATS}, float64, float64, Array(uint16, 1, 'C', True), int32[::1])")
def locate(
    values: FloatArray,
    splitters: FloatArray,
    origin: float,
    scale: float,
    first: Places,
    found: Cells,
) -> None:
    """Write the cell of each value; see `Splitters.locate`.

    Equal steps from `origin` are the entries of `first`, which holds the splitters before each.
    So a search takes few steps, and none that depends on rounding: the same steps placed the
    splitters. Two NaN follow the splitters: no value is above them or at them.
    """
    last = first.size - 2
    # A loop of its own, as the compiler then takes several values at once.
    for k in range(values.size):
        step = (values[k] - origin) * scale
        found[k] = int(step) if 0.0 <= step < last else (last if step > 0.0 else 0)
    for k in range(values.size):
        value, entry = values[k], found[k]
        low, high = np.int64(first[entry]), np.int64(first[entry + 1])
        while high - low > 2:
            middle = (low + high) >> 1
            if splitters[middle] < value:
                low = middle + 1
            else:
                high = middle
        # Comparisons that are added, in place of branches, which the processor would guess wrong.
        low += splitters[low] < value
        low += splitters[low] < value
        found[k] = 2 * low + (splitters[low] == value)


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


_Groups = npt.NDArray[np.int16]


@dataclass(frozen=True, eq=False)
class CellValues:
    """All values of a column in one cell.

    Parameters
    ----------
    values : ndarray, shape (value,)
        Ascending.
    groups : ndarray of int, shape (value,)
        The group of the run of each.
    """

    values: FloatArray
    groups: _Groups

    def of_first(self, groups: int) -> FloatArray:
        """Return the values of the first groups, ascending."""
        return self.values[self.groups < groups]


@dataclass(frozen=True, eq=False)
class CellCounts:
    """Counts of the cells of a column by group of its runs.

    Parameters
    ----------
    splitters : Splitters
    counts : ndarray of int, shape (group, cell)
    asked : set of int
        Cells whose values were asked for and are not known.
    known : dict of int to CellValues
        Cells whose values are known.
    """

    splitters: Splitters
    counts: IntArray
    asked: set[int] = field(default_factory=set)
    known: dict[int, CellValues] = field(default_factory=dict)

    @classmethod
    def empty(cls, splitters: Splitters, groups: int) -> CellCounts:
        """Return the counts of no runs."""
        return cls(splitters, np.zeros((groups, splitters.cells), dtype=np.int64))

    def add(self, group: int, cells: npt.NDArray[np.int32]) -> None:
        """Add runs to a group, in place, by their cells."""
        self.counts[group] += np.bincount(cells, minlength=self.counts.shape[1])

    def value_at(self, position: int, groups: int, below: IntArray) -> float:
        """Return an order statistic of the first groups; a splitter near it, if it is not known.

        Parameters
        ----------
        position : int
            From 0.
        groups : int
        below : ndarray of int, shape (cell + 1,)
            Number of runs of these groups below each cell.
        """
        cell = int(np.searchsorted(below, position, side="right")) - 1
        if cell % 2:
            return float(self.splitters.values[cell // 2])
        if (values := self.values_in(cell)) is None:
            return self._splitter_near(cell)
        return float(values.of_first(groups)[position - below[cell]])

    def _splitter_near(self, cell: int) -> float:
        """Return the splitter above a cell, below the last one; NaN where there is none."""
        splitters = self.splitters.values
        return float(splitters[min(cell // 2, splitters.size - 1)]) if splitters.size else np.nan

    def counts_below(self, value: float, *, or_equal: bool) -> IntArray:
        """Return the runs below a value, or at it too, by group; below its cell, if not known."""
        if np.isnan(value):
            return np.zeros(len(self.counts), dtype=np.int64)
        cell = int(self.splitters.locate(np.array([value]))[0])
        if cell % 2:
            return self._before[:, cell + or_equal]
        before = self._before[:, cell]
        if not self.counts[:, cell].any():
            return before
        if (found := self.values_in(cell)) is None:
            return before
        end = np.searchsorted(found.values, value, side="right" if or_equal else "left")
        return before + np.bincount(found.groups[:end], minlength=len(self.counts))

    @cached_property
    def _before(self) -> IntArray:
        """Number of runs below each cell, by group; known when all runs are counted."""
        return np.pad(np.cumsum(self.counts, axis=1), ((0, 0), (1, 0)))

    def below_in_first(self, groups: int) -> IntArray:
        """Number of runs of the first groups below each cell, shape (cell + 1,)."""
        if groups not in self._below:
            self._below[groups] = self._before[:groups].sum(axis=0)
        return self._below[groups]

    @cached_property
    def _below(self) -> dict[int, IntArray]:
        """Counts found so far, as each growing part is analysed several times."""
        return {}

    @cached_property
    def sizes(self) -> IntArray:
        """Number of runs of each group; known when all runs are counted."""
        return self._before[:, -1].copy()

    def values_in(self, cell: int) -> CellValues | None:
        """Return the values of a cell between splitters; None, and ask for them, if not known."""
        if cell not in self.known:
            self.asked.add(cell)
        return self.known.get(cell)

    def collector(self) -> Collector:
        """Return a collector of the values that were asked for."""
        return Collector(self, np.isin(np.arange(self.splitters.cells), [*self.asked]))


@dataclass(frozen=True, eq=False)
class Collector:
    """Collector of the values of some cells, chunk after chunk of the runs."""

    counts: CellCounts
    is_asked: npt.NDArray[np.bool_]
    parts: list[tuple[int, npt.NDArray[np.int32], FloatArray]] = field(default_factory=list)

    def add(self, group: int, values: FloatArray, cells: npt.NDArray[np.int32]) -> None:
        """Add the runs of a chunk, with the cells of their values."""
        taken = np.flatnonzero(self.is_asked[cells])
        self.parts.append((group, cells[taken], values[taken]))

    def finish(self) -> None:
        """Make the values known to the counts."""
        sizes = [len(part[1]) for part in self.parts]
        groups = np.repeat([part[0] for part in self.parts], sizes).astype(np.int16)
        values = np.concatenate([part[2] for part in self.parts])
        cells = np.concatenate([part[1] for part in self.parts])
        self.parts.clear()
        # Cells ascend with the values, so the order of the values is that of the cells.
        order = np.argsort(values, kind="stable")
        values, groups, cells = values[order], groups[order], cells[order]
        asked = np.array(sorted(self.counts.asked), dtype=np.int32)
        starts, ends = (np.searchsorted(cells, asked, side=side) for side in ("left", "right"))
        for cell, start, end in zip(asked.tolist(), starts, ends, strict=True):
            self.counts.known[cell] = CellValues(values[start:end], groups[start:end])
        self.counts.asked.clear()


@dataclass(frozen=True, eq=False)
class OrderedValues:
    """The ascending values of a column's first groups; those that are asked for are found.

    It takes the positions that an array of them takes. In place of a value that is not known yet
    it gives a splitter near it: what an interval asks for next then follows from nearly its ends.
    """

    counts: CellCounts
    groups: int
    below: IntArray

    @classmethod
    def of_first(cls, counts: CellCounts, groups: int) -> OrderedValues:
        """Return the values of the first groups."""
        return cls(counts, groups, counts.below_in_first(groups))

    @property
    def shape(self) -> tuple[int]:
        """Shape of an array of them."""
        return (int(self.below[-1]),)

    @property
    def ndim(self) -> int:
        """Number of dimensions of an array of them."""
        return 1

    def __getitem__(self, index: Any) -> FloatArray:
        """Return the values at positions, whatever is before these in a tuple."""
        positions = np.asarray(index[-1] if isinstance(index, tuple) else index)
        found = [
            self.counts.value_at(int(each) % self.shape[0], self.groups, self.below)
            for each in positions.ravel()
        ]
        return np.reshape(np.array(found), positions.shape)
