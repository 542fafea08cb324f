"""Columns of the random inputs of a design, read one by one and ordered once."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.blocks import BlockedRuns
from uqpen.core.labels import CODE_LABELS, ROLE, RUN

# Order of the values of a column: it is sorted once, and ranks follow from it.


@dataclass(frozen=True, eq=False)
class Ordering:
    """Values in ascending order."""

    # (run,): numbers of the values, ascending; those of equal values ascend themselves.
    order: IntArray
    # (run,): for each value in that order, True if it is above the one before, or the first of all.
    # None where no two values are equal.
    is_above: BoolArray | None = None

    @classmethod
    def of(cls, values: FloatArray) -> Ordering:
        """Return the order of values, which are not NaN."""
        # Without equal values there is one order, and any sort finds it; a stable one takes longer.
        found = cls._in_order(values, np.argsort(values))
        if found.is_above is None:
            return found
        return cls._in_order(values, np.argsort(values, kind="stable"))

    @classmethod
    def _in_order(cls, values: FloatArray, order: IntArray) -> Ordering:
        ascending = values[order]
        is_above = np.ones(len(order), dtype=np.bool_)
        np.greater(ascending[1:], ascending[:-1], out=is_above[1:])
        return cls(order, None if is_above.all() else is_above)

    def among(self, used: IntArray, values: FloatArray) -> Ordering:
        """Return the order of some of the values.

        Parameters
        ----------
        used : ndarray of int, shape (run,)
            Their numbers.
        values : ndarray, shape (point,)
            All values.
        """
        number = np.full(len(self.order), -1)
        number[used] = np.arange(len(used))
        among = number[self.order]
        kept = among[among >= 0]
        return Ordering(kept) if self.is_above is None else self._in_order(values[used], kept)

    @cached_property
    def level(self) -> IntArray:
        """Number of each value among the ascending distinct ones."""
        level = np.empty(len(self.order), dtype=np.int64)
        if self.is_above is None:
            level[self.order] = np.arange(len(self.order))
        else:
            level[self.order] = np.cumsum(self.is_above) - 1
        return level

    @property
    def mean_ranks(self) -> FloatArray:
        """Ranks from 1; equal values share the mean of theirs."""
        if self.is_above is None:
            return np.add(self.level, 1.0, dtype=np.float64)
        count = np.bincount(self.level)
        ranks: FloatArray = (np.cumsum(count) - (count - 1) / 2)[self.level]
        return ranks

    @cached_property
    def rank_std(self) -> float:
        """Standard deviation of `mean_ranks`."""
        if self.is_above is None:
            return math.sqrt(max(len(self.order) ** 2 - 1, 0) / 12)
        return float(self.mean_ranks.std())


# Rows that are added up together: few enough for a cache.
_ROWS_TOGETHER = 2**14


def sums_above(
    orderings: Sequence[Ordering], factors: FloatArray, values: FloatArray
) -> FloatArray:
    """Return for each run the sum of values over the runs above, weighted over several orders.

    Half of a run itself is added, and half of those that are equal.

    Parameters
    ----------
    orderings : sequence of Ordering
    factors : ndarray, shape (ordering, variable)
        Weight of each order in the sums of a variable.
    values : ndarray, shape (run, variable)

    Returns
    -------
    ndarray, shape (run, variable)
    """
    values = np.ascontiguousarray(values)
    unequal = [ordering.is_above is None for ordering in orderings]
    found = values * (factors[unequal].sum(axis=0) / 2)
    found += factors.sum(axis=0) * values.sum(axis=0)
    up_to = np.zeros((len(values) + 1, values.shape[1]))
    for ordering, factor in zip(orderings, factors, strict=True):
        if not factor.any():
            continue
        # With this mode, `take` writes without a buffer.
        np.take(values, ordering.order, axis=0, out=up_to[1:], mode="clip")
        _cumulate(up_to[1:])
        if ordering.is_above is None:
            middle = up_to[1:]
            middle *= factor
        else:
            start = np.flatnonzero(ordering.is_above)
            middle = (up_to[start] + up_to[np.append(start[1:], len(values))]) * (factor / 2)
        for first in range(0, len(values), _ROWS_TOGETHER):
            rows = slice(first, first + _ROWS_TOGETHER)
            found[rows] -= middle[ordering.level[rows]]
    return found


def _cumulate(values: FloatArray) -> None:
    """Replace rows by their cumulative sums; those of several variables in groups of rows."""
    if values.shape[1] == 1:
        np.cumsum(values, axis=0, out=values)
        return
    # NumPy adds number after number, and whole rows in a fraction of the time.
    size = 16
    groups = values[: len(values) // size * size].reshape(-1, size, values.shape[1])
    for row in range(1, size):
        groups[:, row] += groups[:, row - 1]
    groups[1:] += np.cumsum(groups[:-1, -1], axis=0)[:, np.newaxis]
    rest = values[max(size * len(groups) - 1, 0) :]
    np.cumsum(rest, axis=0, out=rest)


Made = TypeVar("Made")


@dataclass(frozen=True, eq=False)
class InputColumns:
    """Random inputs at all points of a design; what nobody asks for is not read."""

    names: tuple[str, ...]  # the random inputs
    size: int  # number of points
    # Returns the values of an input by name, shape (point,).
    read: Callable[[str], npt.NDArray[np.float64]]
    coded: frozenset[str] = frozenset()  # those whose values are codes of texts, without an order

    @classmethod
    def from_runs(cls, runs: BlockedRuns) -> InputColumns:
        """Return the inputs of runs that vary along them."""
        variables = runs.template.variables
        names = [
            str(name)
            for name in runs.template.data_vars
            if variables[name].attrs.get(ROLE) == "input" and variables[name].dims == (RUN,)
        ]
        coded = frozenset(name for name in names if CODE_LABELS in variables[name].attrs)
        return cls(tuple(names), runs.size, runs.column, coded)

    def is_coded(self, number: int) -> bool:
        """Return True if the values of an input are codes of texts, which have no order."""
        return self.names[number] in self.coded

    @classmethod
    def from_matrix(cls, names: tuple[str, ...], points: FloatArray) -> InputColumns:
        """Return the columns of points, shape (point, input)."""
        return cls(names, len(points), lambda name: points[:, names.index(name)])

    @classmethod
    def none(cls, size: int) -> InputColumns:
        """Return no input of a number of points."""
        return cls.from_matrix((), np.empty((size, 0)))

    def __getitem__(self, number: int) -> FloatArray:
        """Return an input by its number, shape (point,); read-only."""
        return _read_only(self.read(self.names[number]))

    def ordering(self, number: int) -> Ordering:
        """Return the order of an input over all points; it is sorted at the first use."""
        if number not in self._orderings:
            self._orderings[number] = Ordering.of(self[number])
        return self._orderings[number]

    @cached_property
    def _orderings(self) -> dict[int, Ordering]:
        return {}

    def at(self, used: IntArray) -> RunInputs:
        """Return the inputs at some of the points; the same for the same array of numbers."""
        found = self._at.get(id(used))
        if found is None:
            found = self._at[id(used)] = RunInputs(self, used)
        return found

    @cached_property
    def _at(self) -> WeakValueDictionary[int, RunInputs]:
        # What is alive keeps its array of numbers alive, so no other has the same id.
        return WeakValueDictionary()

    @cached_property
    def matrix(self) -> FloatArray:
        """All points, shape (point, input); read-only."""
        if not self.names:
            return np.empty((self.size, 0))
        return _read_only(np.column_stack([self.read(name) for name in self.names]))


@dataclass(frozen=True, eq=False)
class RunInputs:
    """Random inputs of the completed runs.

    Samples of outputs that exist in the same runs have one of these in common, so each input is
    ordered once for all analyses of all outputs. It lives as long as one of the samples.
    """

    columns: InputColumns  # the inputs at all points
    used: IntArray  # (run,): numbers of the points with a completed run

    def __getitem__(self, number: int) -> FloatArray:
        """Return an input by its number, shape (run,)."""
        values = self.columns[number]
        return values if self._is_whole else values[self.used]

    def ordering(self, number: int) -> Ordering:
        """Return the order of an input over the runs."""
        whole = self.columns.ordering(number)
        if self._is_whole:
            return whole
        values = self.columns[number]
        return self.once(("ordering", number), lambda: whole.among(self.used, values))

    @cached_property
    def _is_whole(self) -> bool:
        """True if the runs are all points, in their order."""
        return np.array_equal(self.used, np.arange(self.columns.size))

    def varies(self, number: int) -> bool:
        """Return True if an input is not the same in all runs."""
        return self.once(("varies", number), lambda: bool(np.ptp(self[number]) > 0))

    def once(self, key: Hashable, make: Callable[[], Made]) -> Made:
        """Return what an analysis makes of these inputs alone, which is made at its first use.

        Parameters
        ----------
        key : hashable
            Names it: what it is, and the input by its number.
        make : callable
            Takes nothing.
        """
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    @cached_property
    def _made(self) -> dict[Hashable, Any]:
        return {}


def _read_only(values: FloatArray) -> FloatArray:
    view = values.view()
    view.flags.writeable = False
    return view
