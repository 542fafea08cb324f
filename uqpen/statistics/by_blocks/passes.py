"""Passes over the runs of a design: groups of them, and the accumulators of columns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.blocks import BlockedRuns, block_ranges
from uqpen.core.labels import ABSENT, REPLICATE, SAMPLING, STATUS
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.statistics.by_blocks.blocked_sample import BlockedSample, ColumnCounts
from uqpen.statistics.convergence import part_sizes

# More replicates are joined, as each group has counts of its own: 67 MB for an input.
_MOST_GROUPS = 1024


@dataclass(frozen=True, eq=False)
class Grouping:
    """Division of the runs of a design.

    A group is a replicate, or as many consecutive ones in each; of other designs, the runs from one
    end of a growing part to the next. So each growing part is the first groups.
    """

    points: int  # number of runs of the design
    sampling: Sampling
    # (group,): number of the first replicate of each group, ascending; empty where the design has
    # one replicate at the most.
    replicates: IntArray
    sizes: IntArray  # (group,): points of each group

    @classmethod
    def of_runs(cls, runs: BlockedRuns) -> Grouping:
        """Return the grouping of a design's runs."""
        sampling, counts = Sampling(runs.attrs[SAMPLING]), np.zeros(0, dtype=np.int64)
        if sampling is Sampling.STRATIFIED and REPLICATE in runs.template.coords:
            for start, stop in block_ranges(runs.size):
                more = np.bincount(runs.part(start, stop, [REPLICATE])[REPLICATE])
                longer = max(len(counts), len(more))
                counts = np.pad(counts, (0, longer - len(counts)))
                counts[: len(more)] += more
        numbers = np.flatnonzero(counts)
        if numbers.size > 1:
            firsts = np.arange(0, numbers.size, -(-numbers.size // _MOST_GROUPS))
            sizes = np.add.reduceat(counts[numbers], firsts)
            return cls(runs.size, sampling, numbers[firsts], sizes)
        ends = part_sizes(runs.size, 0) if sampling is Sampling.INDEPENDENT else [runs.size]
        return cls(runs.size, sampling, numbers[:0], np.diff(ends, prepend=0))

    @property
    def is_replicated(self) -> bool:
        """True if the groups are of replicates."""
        return self.replicates.size > 0

    @property
    def groups(self) -> int:
        """Number of groups."""
        return self.sizes.size

    @cached_property
    def parts(self) -> list[int]:
        """Number of groups in each growing part; the last is the whole."""
        if self.is_replicated:
            return part_sizes(self.points, self.groups)
        return list(range(1, self.groups + 1))

    @property
    def part_points(self) -> list[int]:
        """Number of points of each growing part."""
        return [int(self.sizes[:groups].sum()) for groups in self.parts]

    def grouped_runs(
        self, start: int, stop: int, replicate: npt.NDArray[Any] | None
    ) -> Iterator[tuple[int, Any]]:
        """Yield each group of the runs from one number to another, and their places among these.

        The replicates of these runs are given where the groups are replicates.
        """
        if replicate is None:
            ends = np.cumsum(self.sizes)
            starts = np.maximum(ends - self.sizes, start) - start
            stops = np.minimum(ends, stop) - start
            for group in np.flatnonzero(starts < stops).tolist():
                yield group, slice(starts[group], stops[group])
            return
        groups = np.searchsorted(self.replicates, replicate, side="right") - 1
        for group in np.flatnonzero(np.bincount(groups)).tolist():
            rows = np.flatnonzero(groups == group)
            yield group, slice(None) if rows.size == stop - start else rows


# Columns that follow from those of runs, counted by group.

# Stretches of the runs from which cells are made.
_STRETCHES = 16
# The values between two splitters are what is collected for an order statistic. With many
# replicates there are fewer, so that the counts of an output take 128 MB at most.
_SPLITTERS, _MOST_COUNTS = 32_768, 2**23

_Read = Mapping[str, npt.NDArray[Any]]


class BlockedColumn(NamedTuple):
    """Column of runs that follows from others of the same runs."""

    names: tuple[str, ...]  # the columns that are read, besides the status
    # Takes columns; returns values as floats, and a mask of the runs that have one.
    take: Callable[[_Read], tuple[FloatArray, BoolArray]]


def output_column(runs: BlockedRuns, name: str) -> BlockedColumn:
    """Return an output; some completed runs may have no value of it."""
    may_lack = ABSENT in runs.template[name].attrs

    def take(read: _Read) -> tuple[FloatArray, BoolArray]:
        values = np.ascontiguousarray(read[name], dtype=np.float64)
        used = read[STATUS] == Status.OK
        return values, used & ~np.isnan(values) if may_lack else used

    return BlockedColumn((name,), take)


@dataclass(frozen=True, eq=False)
class BlockedColumns:
    """Columns of runs, with their accumulators."""

    runs: BlockedRuns
    grouping: Grouping
    columns: Sequence[BlockedColumn]
    # (value,): all values that they may have; without it, cells are made from some of the runs.
    values: FloatArray | None = None

    @cached_property
    def counts(self) -> list[ColumnCounts]:
        """The distribution of each column; all runs are read for it."""
        groups = self.grouping.groups
        most = min(_SPLITTERS, _MOST_COUNTS // groups)
        some = self._some_values() if self.values is None else [self.values] * len(self.columns)
        counts = [ColumnCounts.empty(values, most, groups) for values in some]
        for group, number, values, missing in self._parts(range(len(self.columns))):
            counts[number].add(group, values)
            counts[number].missing[group] += missing
        return counts

    def collect(self) -> bool:
        """Read the values that were asked for, if any were; return whether there were some."""
        parts: dict[int, list[tuple[int, FloatArray]]] = {
            number: [] for number, each in enumerate(self.counts) if each.asked
        }
        if parts:
            for group, number, values, _ in self._parts(parts):
                parts[number].append((group, self.counts[number].values_requested(values)))
            for number, collected in parts.items():
                self.counts[number].learn(collected)
        return bool(parts)

    def sample(self, number: int, level: float, groups: int | None = None) -> BlockedSample:
        """Return the sample of a column, over the first groups or all."""
        grouping = self.grouping
        return BlockedSample.of_first(
            groups or grouping.groups,
            self.counts[number],
            grouping.sampling,
            is_replicated=grouping.is_replicated,
            level=level,
        )

    def _some_values(self) -> list[FloatArray]:
        """Return values of some runs, from which cells are made.

        They are as many as a block, in pieces all over the design: a table may be sorted.
        """
        _, block = next(block_ranges(self.runs.size))
        found: list[list[FloatArray]] = [[] for _ in self.columns]
        for stretch in range(_STRETCHES):
            start = stretch * self.runs.size // _STRETCHES
            stop = min(start + block // _STRETCHES, self.runs.size)
            read = self._read(start, stop, range(len(self.columns)))
            for own, column in zip(found, self.columns, strict=True):
                values, used = column.take(read)
                own.append(values[used])
        return [np.concatenate(own) for own in found]

    def _parts(self, numbers: Iterable[int]) -> Iterator[tuple[int, int, FloatArray, int]]:
        """Yield group, column, values and missing runs, in the order of the runs."""
        numbers = [*numbers]
        for start, stop in block_ranges(self.runs.size):
            read = self._read(start, stop, numbers)
            status = read[STATUS]
            is_failed = (status != Status.OK) & (status != Status.INADMISSIBLE)
            taken = [self.columns[number].take(read) for number in numbers]
            for group, rows in self.grouping.grouped_runs(start, stop, read.get(REPLICATE)):
                for number, (values, used) in zip(numbers, taken, strict=True):
                    mine = used[rows]
                    missing = int((is_failed[rows] & ~mine).sum())
                    own = values[rows] if mine.all() else values[rows][mine]
                    yield group, number, own, missing

    def _read(self, start: int, stop: int, numbers: Iterable[int]) -> _Read:
        labels = [STATUS, *([REPLICATE] if self.grouping.is_replicated else [])]
        names = dict.fromkeys(name for each in numbers for name in self.columns[each].names)
        return self.runs.part(start, stop, [*labels, *names])


def status_sample(runs: BlockedRuns, level: float) -> BlockedSample:
    """Return the sample of the runs' statuses, in which no run is missing."""

    def statuses(read: _Read) -> tuple[FloatArray, BoolArray]:
        return read[STATUS].astype(np.float64), np.ones(read[STATUS].shape, dtype=np.bool_)

    columns = [BlockedColumn((), statuses)]
    values = np.array([*Status], dtype=np.float64)
    return BlockedColumns(runs, Grouping.of_runs(runs), columns, values).sample(0, level)
