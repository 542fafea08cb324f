"""Statistics of a sample of more runs than go through memory together."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np
import xarray as xr

from uqpen.core.blocks import BlockedRuns, LoadedDataset, join_blocks
from uqpen.core.catalogue import REQUESTED
from uqpen.core.labels import BOUND, NOTE, REPLICATE, RUN, WEIGHT
from uqpen.core.lookup import resolve
from uqpen.statistics import ANALYSES, ANALYSES_IN_MEMORY, INPUT_ANALYSES, texts
from uqpen.statistics.by_blocks.passes import (
    BlockedColumns,
    Grouping,
    output_column,
    status_sample,
)
from uqpen.statistics.convergence import convergence_of_parts
from uqpen.statistics.distribution_function.probabilities import probabilities_of_statuses
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.user_defined_analysis import UserDefinedAnalysis

# Outputs whose accumulators are in memory together, and their number times that of the groups.
_MOST_OUTPUTS, _MOST_COUNTED = 8, 128


_Statistics = dict[str, xr.DataArray]
# Analyses of runs in memory: takes these, quantities, keys of analyses, and user-defined analyses.
AnalyzeWhole = Callable[..., Mapping[str, _Statistics]]


@dataclass(frozen=True, eq=False)
class LargeSample:
    """A sample whose statistics go by blocks, or take a part of the runs."""

    runs: BlockedRuns
    in_memory: int  # number of runs of that part
    analyze_whole: AnalyzeWhole  # analyses runs in memory

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
            yield from self._by_blocks(scalars, only)
            if only is None or INPUT_ANALYSES & {*only}:
                yield from self._of_part(scalars, INPUT_ANALYSES, (), texts.SENSITIVITIES_IN_MEMORY)
            if tails := self._of_tails(scalars, only):
                yield from self._of_part(tails, ANALYSES_IN_MEMORY, (), texts.TAILS_IN_MEMORY)
            if user_defined:
                yield from self._of_part(scalars, (), user_defined, texts.USER_DEFINED_IN_MEMORY)
        if fields:
            yield from self._of_part(fields, only, (), texts.FIELD_IN_MEMORY)

    def _by_blocks(
        self, quantities: Sequence[QuantityOfInterest], only: Collection[str] | None
    ) -> Iterator[tuple[str, _Statistics, int]]:
        """Yield the statistics of distributions, from passes over the runs."""
        groups = ANALYSES.keys() - INPUT_ANALYSES - ANALYSES_IN_MEMORY
        wanted = [name for name in ANALYSES if name in groups and (only is None or name in only)]
        grouping, coming = Grouping.of_runs(self.runs), iter(quantities)
        most = min(max(_MOST_COUNTED // grouping.groups, 1), _MOST_OUTPUTS)
        while asked := [*islice(coming, most)]:
            outputs = [output_column(self.runs, each.output.name) for each in asked]
            columns = BlockedColumns(self.runs, grouping, outputs)
            found = [_analyze(columns, *each, wanted) for each in enumerate(asked)]
            # What an interval takes may follow from values that had to be collected first.
            while columns.collect():
                found = [_analyze(columns, *each, wanted) for each in enumerate(asked)]
            for number, (quantity, statistics) in enumerate(zip(asked, found, strict=True)):
                used = columns.sample(number, quantity.confidence_level).size
                yield quantity.output.name, statistics, used

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
        if grouping.is_replicated:
            each = self.in_memory // grouping.groups
            starts = (np.cumsum(grouping.sizes) - grouping.sizes).tolist()
            parts = [self.runs.read(start, start + each) for start in starts]
            if not any(np.ptp(part[REPLICATE].values) for part in parts):
                return LoadedDataset(join_blocks(parts, sum(part.sizes[RUN] for part in parts)))
        return LoadedDataset(self.runs.read(0, self.in_memory))


def _analyze(
    columns: BlockedColumns, number: int, quantity: QuantityOfInterest, analyses: Sequence[str]
) -> _Statistics:
    """Return the statistics of an output, as far as what they take is known."""
    grouping, level = columns.grouping, quantity.confidence_level
    sample, found = columns.sample(number, level), dict[str, xr.DataArray]()
    for name in analyses:
        if name == "convergence":
            if len(grouping.parts) > 1:
                parts = [columns.sample(number, level, groups) for groups in grouping.parts]
                found |= dict(convergence_of_parts(parts, grouping.part_points, quantity))
            continue
        for reference in ANALYSES[name]:
            found |= dict(resolve(reference)(sample, quantity))
    return found
