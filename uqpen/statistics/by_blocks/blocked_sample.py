"""A sample without its values: it answers analyses of distributions from counts and sums."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.sampling import Sampling
from uqpen.statistics import texts
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.sample import Column, ErrorModel, Sample, SampleShape, Tally

# Distribution of a column by group of its runs.

_Groups = npt.NDArray[np.int16]


@dataclass(frozen=True, eq=False)
class ColumnCounts:
    """Counts of a column between ascending values, its splitters, and sums of its powers.

    With k splitters there are 2 k + 1 cells, in ascending order: below the first splitter, at it,
    between it and the second, and so on. So a value that many runs share has a cell of its own.
    """

    splitters: FloatArray  # (splitter,): ascending, all different
    counts: IntArray  # (group, cell)
    # (4, group): sums of the first to the fourth powers of the distances from `origin`, over
    # `unit`. It is among the values, so that they lose no digits.
    powers: FloatArray
    # (2, group): the smallest and the largest value; infinite for a group without runs.
    ends: FloatArray
    missing: IntArray  # (group,): failed runs, but for those at inadmissible points
    # Cells whose values were asked for and are not known.
    asked: set[int] = field(default_factory=set)
    # The ascending values of a cell, and the group of the run of each.
    known: dict[int, tuple[FloatArray, _Groups]] = field(default_factory=dict)

    @classmethod
    def empty(cls, some: FloatArray, most: int, groups: int) -> ColumnCounts:
        """Return the counts of no runs, with evenly spread order statistics as splitters.

        Parameters
        ----------
        some : ndarray, shape (value,)
            Some of the values.
        most : int
            Largest number of splitters.
        groups : int
            Number of groups.
        """
        splitters = np.unique(some)
        if splitters.size > most:
            places = (np.arange(most) + 0.5) / most * some.size
            splitters = np.unique(np.sort(some)[places.astype(np.int64)])
        ends = np.array([[np.inf], [-np.inf]]).repeat(groups, axis=1)
        counts = np.zeros((groups, 2 * splitters.size + 1), dtype=np.int64)
        return cls(splitters, counts, np.zeros((4, groups)), ends, np.zeros(groups, dtype=np.int64))

    @cached_property
    def origin(self) -> float:
        """Value from which distances are."""
        return float(self.splitters[self.splitters.size // 2]) if self.splitters.size else 0.0

    @cached_property
    def unit(self) -> float:
        """The largest distance of a splitter: powers over it neither overflow nor vanish."""
        return float(np.abs(self.splitters - self.origin).max(initial=0.0)) or 1.0

    def add(self, group: int, values: FloatArray) -> None:
        """Add completed runs to a group, in place."""
        if not values.size:
            return
        self.counts[group] += np.bincount(self.cells_of(values), minlength=self.counts.shape[1])
        steps = (values - self.origin) / self.unit
        squares = steps * steps
        sums = [each.sum() for each in (steps, squares, squares * steps, squares * squares)]
        self.powers[:, group] += sums
        self.ends[0, group] = min(self.ends[0, group], values.min())
        self.ends[1, group] = max(self.ends[1, group], values.max())

    def cells_of(self, values: FloatArray) -> IntArray:
        """Return the cell of each value; an even one lies between splitters."""
        at = np.searchsorted(self.splitters, values)
        cells: IntArray = 2 * at + (np.append(self.splitters, np.nan)[at] == values)
        return cells

    def values_requested(self, values: FloatArray) -> FloatArray:
        """Return those of some values that lie in the cells asked for."""
        is_asked = np.zeros(self.counts.shape[1], dtype=np.bool_)
        is_asked[[*self.asked]] = True
        return values[is_asked[self.cells_of(values)]]

    def learn(self, parts: Iterable[tuple[int, FloatArray]]) -> None:
        """Take all values of the cells asked for, with the group of each part of them."""
        numbers, columns = zip(*parts, strict=True)
        groups = np.repeat(numbers, [each.size for each in columns]).astype(np.int16)
        values = np.concatenate(columns)
        order = np.argsort(values, kind="stable")
        values, groups = values[order], groups[order]
        cells = self.cells_of(values)  # they ascend with the values
        for cell in self.asked:
            own = slice(*np.searchsorted(cells, (cell, cell + 1)))
            self.known[cell] = values[own], groups[own]
        self.asked.clear()

    def value_at(self, position: int, groups: int) -> float:
        """Return an order statistic of the first groups; a splitter near it, if it is not known.

        What an interval asks for next then follows from nearly its ends.
        """
        below = self._below_in_first(groups)
        cell = int(np.searchsorted(below, position, side="right")) - 1
        if cell % 2:
            return float(self.splitters[cell // 2])
        if cell in self.known:
            values, own_groups = self.known[cell]
            return float(values[own_groups < groups][position - below[cell]])
        self.asked.add(cell)
        splitters = self.splitters
        return float(splitters[min(cell // 2, splitters.size - 1)]) if splitters.size else np.nan

    def counts_below(self, value: float, *, or_equal: bool) -> IntArray:
        """Return the runs below a value, or at it too, by group; below its cell, if not known."""
        if np.isnan(value):
            return np.zeros(len(self.counts), dtype=np.int64)
        cell = int(self.cells_of(np.array([value]))[0])
        if cell % 2:
            return self._below[:, cell + or_equal]
        before = self._below[:, cell]
        if not self.counts[:, cell].any():
            return before
        if cell not in self.known:
            self.asked.add(cell)
            return before
        values, groups = self.known[cell]
        end = np.searchsorted(values, value, side="right" if or_equal else "left")
        return before + np.bincount(groups[:end], minlength=len(self.counts))

    @cached_property
    def _below(self) -> IntArray:
        """Number of runs below each cell, by group; known when all runs are counted."""
        return np.pad(np.cumsum(self.counts, axis=1), ((0, 0), (1, 0)))

    def _below_in_first(self, groups: int) -> IntArray:
        """Return the same for the first groups together; a growing part is asked several times."""
        if groups not in self._below_in:
            self._below_in[groups] = self._below[:groups].sum(axis=0)
        return self._below_in[groups]

    @cached_property
    def _below_in(self) -> dict[int, IntArray]:
        return {}


@dataclass(frozen=True, eq=False, kw_only=True)
class BlockedSample(Sample):
    """A sample of the first groups of a column's runs, whose values are in no array.

    In place of what is not known yet it gives what is known near it, and asks for it: after a
    further pass over the runs, the same analysis finds it.
    """

    column: ColumnCounts  # the distribution, by group
    sizes: IntArray  # (group,): the completed runs of each group
    missing_counts: IntArray  # (group,): the missing runs of each group

    @classmethod
    def of_first(
        cls,
        groups: int,
        column: ColumnCounts,
        sampling: Sampling,
        *,
        is_replicated: bool,
        level: float = LEVEL,
    ) -> BlockedSample:
        """Return the sample of the first groups, which may be replicates of a stratified design."""
        none = np.empty(0, dtype=np.int64)
        missing_counts = column.missing[:groups]
        return cls(
            values=np.empty(0),
            used=none,
            missing=np.broadcast_to(np.int64(0), int(missing_counts.sum())),
            columns=InputColumns.none(0),
            replicates=np.arange(groups) if is_replicated else none,
            sampling=sampling,
            level=level,
            column=column,
            sizes=column.counts[:groups].sum(axis=1),
            missing_counts=missing_counts,
        )

    def with_missing(self) -> BlockedSample:
        """Return the sample with its missing runs; of its values nothing is known then."""
        none = self.missing_counts[:0]
        sizes = self.sizes + self.missing_counts
        return replace(self, sizes=sizes, missing_counts=none, missing=none)

    def event(self, compare: Callable[[Any, Any], Any], value: npt.ArrayLike) -> Tally:
        """Return whether each value compares so with a number, from counts."""
        (number,) = np.ravel(np.asarray(value, dtype=np.float64)).tolist()
        below, up_to = (
            self.column.counts_below(number, or_equal=or_equal)[: len(self.sizes)]
            for or_equal in (False, True)
        )
        counts = {
            operator.lt: below,
            operator.le: up_to,
            operator.eq: up_to - below,
            operator.gt: self.sizes - up_to,
            operator.ge: self.sizes - below,
        }[compare]
        return Tally.of_events(*map(self.by_replicate, (self.sizes, counts)))

    def events_with_missing(self, events: Column, *, happened: bool) -> Tally:
        """Return an event over the runs of `with_missing`, with one outcome of the missing ones."""
        assert isinstance(events, Tally)
        return events.with_missing(self.by_replicate(self.missing_counts), happened=happened)

    def by_replicate(self, of_groups: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return sums over groups by replicate; independent draws are one."""
        is_replicated = self.error_model is ErrorModel.REPLICATED
        return of_groups if is_replicated else of_groups.sum(keepdims=True)

    def counts_by_replicate(self, values: FloatArray) -> Iterator[IntArray]:
        """Yield the counts of `count_up_to` of all replicates, shape (replicate, value)."""
        groups = len(self.sizes)
        columns = [self.column.counts_below(each, or_equal=True)[:groups] for each in values]
        yield np.stack(columns, axis=1)[self.sizes > 0]

    def count_up_to(self, values: FloatArray) -> IntArray:
        """Count the runs at or below each value, shape (value,)."""
        return next(self.counts_by_replicate(values)).sum(axis=0)

    def ordered(self, positions: IntArray) -> FloatArray:
        """Return the values at positions from 0 among the ascending ones."""
        groups = len(self.sizes)
        found = [self.column.value_at(each, groups) for each in positions.ravel().tolist()]
        return np.reshape(np.array(found), positions.shape)

    @cached_property
    def replicate_sizes(self) -> IntArray:
        """Number of runs of each replicate that has any."""
        sizes = self.by_replicate(self.sizes)
        return sizes[sizes > 0]

    @property
    def size(self) -> int:
        """Number of completed runs."""
        return int(self.sizes.sum())

    @cached_property
    def is_constant(self) -> BoolArray:
        """True where all values are equal."""
        return np.asarray(self.smallest == self.largest)

    @property
    def smallest(self) -> FloatArray:
        """The smallest value."""
        return self.column.ends[0, : len(self.sizes)].min()

    @property
    def largest(self) -> FloatArray:
        """The largest value."""
        return self.column.ends[1, : len(self.sizes)].max()

    @property
    def residual_method(self) -> str:
        """Name of an interval of one stratified set: no residuals are at hand."""
        return texts.STUDENT_AS_INDEPENDENT

    @cached_property
    def shape(self) -> SampleShape:
        """Deviations from the mean, and the influence of few runs on them."""
        return _BlockedShape(replace(self))


@dataclass(frozen=True)
class _BlockedShape(SampleShape):
    """The shape of a sample's tail, from sums of powers."""

    sample: BlockedSample

    @property
    def _powers(self) -> FloatArray:
        return self.sample.column.powers[:, : len(self.sample.sizes)]

    @cached_property
    def _centre(self) -> float:
        """Distance of the mean from the origin of the powers, over their unit."""
        return float(self._powers[0].sum()) / self.sample.size

    @cached_property
    def mean(self) -> FloatArray:
        """The mean."""
        if not self.sample.size:
            return np.asarray(np.nan)
        column = self.sample.column
        mean = column.origin + column.unit * self._centre
        return np.where(self.sample.is_constant, self.sample.smallest, mean)

    @property
    def _factor(self) -> float:
        """The unit of the powers over the largest deviation."""
        return float(self.sample.column.unit / self.scale) if self.scale > 0 else 0.0

    def powers(self, power: int) -> Tally:
        """Return the deviations over `scale`, or their squares; the smallest one is then 0."""
        sizes, centre, (first, second) = self.sample.sizes, self._centre, self._powers[:2]
        if power == 1:
            sums = first - sizes * centre
            return self._tally(self._factor * sums, self._central(2), *self._ends)
        sums = second - 2 * centre * first + sizes * centre**2
        scatter = self._central(4) - self._central(2) ** 2 / self.sample.size
        largest = float(np.square(self._ends).max())
        return self._tally(self._factor**2 * sums, max(scatter, 0.0), 0.0, largest)

    @property
    def _ends(self) -> tuple[float, float]:
        scale = self.scale if self.scale > 0 else 1.0
        sample = self.sample
        return float((sample.smallest - self.mean) / scale), float(
            (sample.largest - self.mean) / scale
        )

    def _tally(self, sums: FloatArray, squares: float, smallest: float, largest: float) -> Tally:
        sizes, by_replicate = map(self.sample.by_replicate, (self.sample.sizes, sums))
        return Tally(sizes, by_replicate, squares, smallest, largest)

    def _central(self, power: int) -> float:
        """Sum of a power of the deviations over `scale`."""
        second, third, fourth = self._powers[1:].sum(axis=1).tolist()
        centre, runs = self._centre, self.sample.size
        if power == 2:
            found = second - runs * centre**2
        elif power == 3:
            found = third - 3 * centre * second + 2 * runs * centre**3
        else:
            found = fourth - 4 * centre * third + 6 * centre**2 * second - 3 * runs * centre**4
        return float(self._factor**power * found)

    def moment(self, power: int) -> FloatArray:
        """Mean of a power of the deviations over `scale`; NaN where these are all 0."""
        is_known = self.sample.size > 0 and self.scale > 0
        return np.asarray(self._central(power) / self.sample.size if is_known else np.nan)
