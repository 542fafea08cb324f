"""Statistics of a sample of more runs than go through memory together."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.blocks import BlockedRuns, LoadedDataset, block_ranges, join_blocks
from uqpen.core.catalogue import REQUESTED
from uqpen.core.labels import ABSENT, BOUND, INTERVAL, NOTE, REPLICATE, RUN, STATUS, WEIGHT
from uqpen.core.lookup import resolve
from uqpen.core.status import Status
from uqpen.statistics import ANALYSES, ANALYSES_IN_MEMORY, INPUT_ANALYSES, texts
from uqpen.statistics.by_blocks.blocked_sample import BlockedSample, PowerSums
from uqpen.statistics.by_blocks.cells import CellCounts, Splitters
from uqpen.statistics.by_blocks.grouping import Grouping
from uqpen.statistics.by_blocks.tabulated import status_sample
from uqpen.statistics.convergence import convergence_of_parts
from uqpen.statistics.distribution_function.probabilities import probabilities_of_statuses
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample
from uqpen.statistics.user_defined_analysis import UserDefinedAnalysis

__all__ = ["LargeSample"]

# Stretches of the runs from which cells are made.
_STRETCHES = 16
# The values between two splitters are what is collected for an order statistic. With many
# replicates there are fewer, so that the counts of an output take 128 MB at most.
_SPLITTERS, _MOST_COUNTS = 32_768, 2**23


class _Chunk(NamedTuple):
    """Completed runs of one group that have a value of each output.

    Attributes
    ----------
    group : int
        Its number.
    columns : dict of str to ndarray, shape (run,)
        The outputs.
    missing : int
        Number of failed runs, but for those at inadmissible points.
    """

    group: int
    columns: dict[str, FloatArray]
    missing: int


@dataclass(frozen=True, eq=False)
class _OutputColumns:
    """Outputs that have a value in the same runs, with their accumulators.

    Parameters
    ----------
    runs : BlockedRuns
    grouping : Grouping
    outputs : tuple of str
        Their names.
    """

    runs: BlockedRuns
    grouping: Grouping
    outputs: tuple[str, ...]

    @cached_property
    def missing_counts(self) -> IntArray:
        """Missing runs of each group."""
        return np.zeros(self.grouping.groups, dtype=np.int64)

    @cached_property
    def cells(self) -> dict[str, CellCounts]:
        """The distribution of each output, by group."""
        groups = self.grouping.groups
        most = min(_SPLITTERS, _MOST_COUNTS // groups)
        return {
            name: CellCounts.empty(Splitters.from_values(values, most), groups)
            for name, values in self._some_columns().items()
        }

    @cached_property
    def powers(self) -> dict[str, PowerSums]:
        """Power sums of each output, by group."""
        return {name: PowerSums.empty(self.grouping.groups) for name in self.outputs}

    def count(self) -> None:
        """Read the runs, and add them to all accumulators."""
        for chunk in self._chunks(self.outputs):
            self.missing_counts[chunk.group] += chunk.missing
            for name, values in chunk.columns.items():
                cells = self.cells[name]
                cells.add(chunk.group, cells.splitters.locate(values))
                self.powers[name].add(chunk.group, values)

    def collect(self) -> bool:
        """Read the values that were asked for, if any were; return whether there were some."""
        collectors = {name: cells.collector() for name, cells in self.cells.items() if cells.asked}
        if collectors:
            for chunk in self._chunks([*collectors]):
                for name, collector in collectors.items():
                    values = chunk.columns[name]
                    located = self.cells[name].splitters.locate(values)
                    collector.add(chunk.group, values, located)
            for collector in collectors.values():
                collector.finish()
        return bool(collectors)

    def _some_columns(self) -> dict[str, FloatArray]:
        """Return columns of some completed runs, from which cells are made.

        They are as many as a block, in pieces all over the design: a table may be sorted.
        """
        parts: list[dict[str, FloatArray]] = []
        _, block = next(block_ranges(self.runs.size))
        for number in range(_STRETCHES):
            start = number * self.runs.size // _STRETCHES
            stop = start + block // _STRETCHES
            read = self._read(start, min(stop, self.runs.size), self.outputs)
            used = self._used(read)
            parts.append({name: _floats(read[name][used]) for name in self.outputs})
        return {name: np.concatenate([part[name] for part in parts]) for name in self.outputs}

    def _chunks(self, names: Sequence[str]) -> Iterator[_Chunk]:
        """Yield columns chunk after chunk, in the order of the runs."""
        for start, stop in block_ranges(self.runs.size):
            read = self._read(start, stop, names)
            used, status = self._used(read), read[STATUS]
            is_missing = (status != Status.OK) & (status != Status.INADMISSIBLE)
            for group, rows in self.grouping.grouped_runs(start, stop, read.get(REPLICATE)):
                mine = used[rows]
                taken = slice(None) if mine.all() else mine
                columns = {name: _floats(read[name][rows][taken]) for name in names}
                yield _Chunk(group, columns, int(is_missing[rows].sum()))

    def _read(self, start: int, stop: int, names: Sequence[str]) -> dict[str, npt.NDArray[Any]]:
        labels = [STATUS, *([REPLICATE] if self.grouping.is_replicated else [])]
        return self.runs.part(start, stop, [*labels, *{*names, *self._with_gaps}])

    @cached_property
    def _with_gaps(self) -> list[str]:
        """The outputs that some completed runs may have no value of."""
        return [name for name in self.outputs if ABSENT in self.runs.template[name].attrs]

    def _used(self, read: dict[str, npt.NDArray[Any]]) -> BoolArray:
        used: BoolArray = read[STATUS] == Status.OK
        for name in self._with_gaps:
            used = used & ~np.isnan(read[name])
        return used


def _floats(values: npt.NDArray[Any] | IntArray) -> FloatArray:
    return np.ascontiguousarray(values, dtype=np.float64)


_Array = tuple[str, xr.DataArray]
_Analysis = Callable[[Sample, QuantityOfInterest], Iterable[_Array]]

# Outputs whose accumulators are in memory together, and their number times that of the groups.
_MOST_OUTPUTS, _MOST_COUNTED = 8, 128


@dataclass(frozen=True, eq=False)
class _BlockedAnalysis:
    """Statistics of outputs, from passes over the runs of a design.

    Parameters
    ----------
    runs : BlockedRuns
    only : collection of str, optional
        Keys of `ANALYSES`, where not all of them are wanted.
    """

    runs: BlockedRuns
    only: Collection[str] | None = None

    def statistics(
        self, quantities: Sequence[QuantityOfInterest]
    ) -> Iterator[tuple[str, dict[str, xr.DataArray], int]]:
        """Yield arrays of each output by statistic, and its runs used, set after set of outputs."""
        for asked in self._sets(quantities):
            columns = _OutputColumns(
                self.runs, self._grouping, tuple(each.output.name for each in asked)
            )
            columns.count()
            statistics = self._of_columns(columns, asked)
            # What an interval takes may follow from values that had to be collected first.
            while columns.collect():
                statistics = self._of_columns(columns, asked)
            for quantity, own in zip(asked, statistics, strict=True):
                used = self._part(columns, quantity, self._grouping.groups).size
                yield quantity.output.name, own, used

    @cached_property
    def _grouping(self) -> Grouping:
        return Grouping.of_runs(self.runs)

    def _sets(
        self, quantities: Sequence[QuantityOfInterest]
    ) -> Iterator[Sequence[QuantityOfInterest]]:
        """Yield quantities whose outputs have a value in the same runs, few at a time."""
        most = min(max(_MOST_COUNTED // self._grouping.groups, 1), _MOST_OUTPUTS)
        everywhere = []
        for each in quantities:
            if ABSENT in self.runs.template[each.output.name].attrs:
                yield [each]
            else:
                everywhere.append(each)
        coming = iter(everywhere)
        while taken := list(islice(coming, most)):
            yield taken

    def _of_columns(
        self, columns: _OutputColumns, quantities: Sequence[QuantityOfInterest]
    ) -> list[dict[str, xr.DataArray]]:
        """Return the statistics of each output, as far as what they take is known."""
        found = []
        for quantity in quantities:
            sample = self._part(columns, quantity, self._grouping.groups)
            own: dict[str, xr.DataArray] = {}
            for name, references in ANALYSES.items():
                if name in INPUT_ANALYSES | ANALYSES_IN_MEMORY or not self._wants(name):
                    continue
                if name == "convergence":
                    own |= dict(self._convergence(columns, quantity))
                    continue
                for reference in references:
                    analysis: _Analysis = resolve(reference)
                    own |= {key: _named(array) for key, array in analysis(sample, quantity)}
            found.append(own)
        return found

    def _wants(self, name: str) -> bool:
        return self.only is None or name in self.only

    def _convergence(
        self, columns: _OutputColumns, quantity: QuantityOfInterest
    ) -> Iterator[_Array]:
        grouping = self._grouping
        if len(grouping.parts) > 1:
            parts = [self._part(columns, quantity, groups) for groups in grouping.parts]
            yield from convergence_of_parts(parts, grouping.part_points, quantity)

    def _part(
        self, columns: _OutputColumns, quantity: QuantityOfInterest, groups: int
    ) -> BlockedSample:
        name = quantity.output.name
        return BlockedSample.of_first(
            groups,
            columns.cells[name],
            columns.powers[name],
            columns.missing_counts,
            self._grouping.sampling,
            is_replicated=self._grouping.is_replicated,
            level=quantity.confidence_level,
        )


def _named(array: xr.DataArray) -> xr.DataArray:
    """Return an array whose intervals are said to be those of independent draws, where they are.

    No residuals are at hand for one stratified set, and the error of independent draws is larger.
    """
    own = array.coords.get(INTERVAL)
    if own is None or not (own.values == texts.STUDENT_ON_RESIDUALS).any():
        return array
    written = np.array(own.values, dtype=object)
    written[written == texts.STUDENT_ON_RESIDUALS] = texts.STUDENT_AS_INDEPENDENT
    return array.assign_coords({INTERVAL: (own.dims, written)})


_Statistics = dict[str, xr.DataArray]
# Analyses of runs in memory: takes these, quantities, keys of analyses, and user-defined analyses.
AnalyzeWhole = Callable[..., Mapping[str, _Statistics]]


@dataclass(frozen=True, eq=False)
class LargeSample:
    """A sample whose statistics go by blocks, or take a part of the runs.

    Parameters
    ----------
    runs : BlockedRuns
    in_memory : int
        Number of runs of that part.
    analyze_whole : callable
        Analyses runs in memory.
    """

    runs: BlockedRuns
    in_memory: int
    analyze_whole: AnalyzeWhole

    def statistics(
        self,
        quantities: Sequence[QuantityOfInterest],
        only: Collection[str] | None,
        user_defined: Sequence[UserDefinedAnalysis],
    ) -> Iterator[tuple[str, _Statistics, int]]:
        """Yield arrays of an output by statistic, and the runs used; -1 where arrays state them."""
        is_weighted = WEIGHT in self.runs.template.coords
        scalars = [quantity for quantity in quantities if not quantity.output.dims]
        fields = [quantity for quantity in quantities if quantity.output.dims]
        if is_weighted:
            yield from self._of_part(scalars, only, user_defined, texts.WEIGHTS_IN_MEMORY)
        else:
            yield from _BlockedAnalysis(self.runs, only).statistics(scalars)
            if only is None or INPUT_ANALYSES & {*only}:
                yield from self._of_part(scalars, INPUT_ANALYSES, (), texts.SENSITIVITIES_IN_MEMORY)
            if tails := self._of_tails(scalars, only):
                yield from self._of_part(tails, ANALYSES_IN_MEMORY, (), texts.TAILS_IN_MEMORY)
            if user_defined:
                yield from self._of_part(scalars, (), user_defined, texts.USER_DEFINED_IN_MEMORY)
        if fields:
            yield from self._of_part(fields, only, (), texts.FIELD_IN_MEMORY)

    def _of_tails(
        self, quantities: Sequence[QuantityOfInterest], only: Collection[str] | None
    ) -> list[QuantityOfInterest]:
        """Return the quantities with requests that take all values at once."""
        if only is not None and ANALYSES_IN_MEMORY.isdisjoint(only):
            return []
        asked = [each for each in REQUESTED if each.takes_all_values]
        return [each for each in quantities if any(map(each.requested, asked))]

    def _of_part(
        self,
        quantities: Sequence[QuantityOfInterest],
        only: Collection[str] | None,
        user_defined: Sequence[UserDefinedAnalysis],
        reason: str,
    ) -> Iterator[tuple[str, _Statistics, int]]:
        found = self.analyze_whole(self.part, quantities, only, user_defined)
        for name, statistics in found.items():
            yield name, self.with_note(statistics, reason), -1

    def with_note(self, statistics: _Statistics, reason: str) -> _Statistics:
        """Return statistics of the part, with a note that says so at each estimate."""
        return {name: self._with_note(array, reason) for name, array in statistics.items()}

    def status_probabilities(
        self, level: float, attributes: Mapping[str, int | str]
    ) -> xr.DataArray:
        """Return the probability of each status but ok, of all runs, with some attributes."""
        sample = status_sample(self.runs, level)
        return probabilities_of_statuses(sample).assign_attrs(attributes)

    def _with_note(self, array: xr.DataArray, reason: str) -> xr.DataArray:
        if BOUND not in array.dims:
            return array
        own = array.coords[NOTE]
        added = texts.OF_PART.format(part=self.part.size, of=self.runs.size, reason=reason)
        join = np.frompyfunc(lambda note: "; ".join(filter(None, (note, added))), 1, 1)
        return array.assign_coords({NOTE: (own.dims, np.asarray(join(own.values), dtype=object))})

    @cached_property
    def part(self) -> LoadedDataset:
        """The first runs, or the first ones of each replicate: equal parts of these are alike."""
        grouping = Grouping.of_runs(self.runs)
        each = self.in_memory // max(grouping.replicates.size, 1)
        starts = (np.cumsum(grouping.sizes) - grouping.sizes).tolist()
        parts = [self.runs.read(start, start + each) for start in starts]
        if not parts or any(np.ptp(part[REPLICATE].values) for part in parts):
            return LoadedDataset(self.runs.read(0, self.in_memory))
        return LoadedDataset(join_blocks(parts, sum(part.sizes[RUN] for part in parts)))
