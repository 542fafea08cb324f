"""All statistics of the outputs of a design whose runs are too many for memory."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

import numpy as np
import xarray as xr

from uqpen.core.blocks import BlockedRuns
from uqpen.core.labels import ABSENT, DEPENDENCE, INTERVAL
from uqpen.core.lookup import resolve
from uqpen.statistics import ANALYSES, ANALYSES_IN_MEMORY, INPUT_ANALYSES, texts
from uqpen.statistics.by_blocks.blocked_sample import BlockedSample
from uqpen.statistics.by_blocks.grouping import Grouping
from uqpen.statistics.by_blocks.output_sensitivity import OutputSensitivity
from uqpen.statistics.by_blocks.output_set import OutputSet
from uqpen.statistics.by_blocks.output_variables import OutputVariables
from uqpen.statistics.by_blocks.passes import RunTable
from uqpen.statistics.convergence import convergence_of_parts
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample

__all__ = ["BlockedAnalysis"]

_Array = tuple[str, xr.DataArray]
_Analysis = Callable[[Sample, QuantityOfInterest], Iterable[_Array]]

# Outputs whose accumulators are in memory together, their number times that of the inputs, and
# that of the groups.
_MOST_OUTPUTS, _MOST_PAIRS, _MOST_COUNTED = 8, 256, 128


@dataclass(frozen=True, eq=False)
class BlockedAnalysis:
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
            table = RunTable(self.runs, self._grouping, tuple(each.output.name for each in asked))
            first = table.some_columns(table.outputs)
            variables = tuple(
                OutputVariables.from_values(each, first[each.output.name]) for each in asked
            )
            yield from self._of_set(OutputSet(table, variables, self._wants(INPUT_ANALYSES)))

    @cached_property
    def _grouping(self) -> Grouping:
        return Grouping.of_runs(self.runs)

    def _wants(self, names: Collection[str]) -> bool:
        return self.only is None or bool({*names} & {*self.only})

    def _sets(
        self, quantities: Sequence[QuantityOfInterest]
    ) -> Iterator[Sequence[QuantityOfInterest]]:
        """Yield quantities whose outputs have a value in the same runs, few at a time."""
        inputs = len(InputColumns.from_runs(self.runs).names)
        few = min(_MOST_PAIRS // max(inputs, 1), _MOST_COUNTED // self._grouping.groups)
        most = min(max(few, 1), _MOST_OUTPUTS)
        everywhere = []
        for each in quantities:
            if ABSENT in self.runs.template[each.output.name].attrs:
                yield [each]
            else:
                everywhere.append(each)
        coming = iter(everywhere)
        while taken := list(islice(coming, most)):
            yield taken

    def _of_set(self, found: OutputSet) -> Iterator[tuple[str, dict[str, xr.DataArray], int]]:
        found.first_pass()
        self._of_distributions(found)  # asks for the values that it needs
        found.second_pass()
        statistics = self._of_distributions(found)
        # What an interval takes may follow from values that had to be collected first.
        while found.collect():
            statistics = self._of_distributions(found)
        for variables in found.variables:
            sample, own = self._sample(found, variables), statistics[variables.output]
            if self._wants(INPUT_ANALYSES):
                own |= dict(OutputSensitivity(found, variables, sample).arrays())
            yield variables.output, own, sample.size

    def _of_distributions(self, found: OutputSet) -> dict[str, dict[str, xr.DataArray]]:
        """Return the statistics that follow from distributions, as far as these are known."""
        statistics: dict[str, dict[str, xr.DataArray]] = {}
        for variables in found.variables:
            sample, quantity = self._sample(found, variables), variables.quantity
            own = statistics[variables.output] = {}
            for threshold in quantity.thresholds:
                _ = sample.values > threshold.value  # indices of the event take its probability
            for name, references in ANALYSES.items():
                if name in INPUT_ANALYSES | ANALYSES_IN_MEMORY or not self._wants([name]):
                    continue
                if name == "convergence":
                    own |= dict(self._convergence(found, variables))
                    continue
                for reference in references:
                    analysis: _Analysis = resolve(reference)
                    own |= {key: _named(array) for key, array in analysis(sample, quantity)}
        return statistics

    def _convergence(self, found: OutputSet, variables: OutputVariables) -> Iterator[_Array]:
        grouping = self._grouping
        if len(grouping.parts) > 1:
            parts = [self._part(found, variables, groups) for groups in grouping.parts]
            yield from convergence_of_parts(parts, grouping.part_points, variables.quantity)

    def _sample(self, found: OutputSet, variables: OutputVariables) -> BlockedSample:
        whole = self._part(found, variables, self._grouping.groups)
        dependence = str(self.runs.attrs.get(DEPENDENCE, ""))
        columns = replace(whole.columns, names=found.inputs)
        return replace(whole, columns=columns, dependence=dependence)

    def _part(self, found: OutputSet, variables: OutputVariables, groups: int) -> BlockedSample:
        name = variables.output
        return BlockedSample.of_first(
            groups,
            found.cells[name],
            found.powers[name],
            found.missing_counts,
            self._grouping.sampling,
            is_replicated=self._grouping.is_replicated,
            level=variables.quantity.confidence_level,
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
