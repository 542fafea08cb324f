"""Accumulators of several outputs that have a value in the same runs, and their passes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics.by_blocks.cell_counts import CellCounts, Collector
from uqpen.statistics.by_blocks.cell_sums import INPUT_SPLITTERS, CellSums, Totals
from uqpen.statistics.by_blocks.output_variables import OutputVariables
from uqpen.statistics.by_blocks.passes import Chunk, RunTable
from uqpen.statistics.by_blocks.power_sums import PowerSums
from uqpen.statistics.by_blocks.products import Products
from uqpen.statistics.by_blocks.rank_scores import mean_shares
from uqpen.statistics.by_blocks.replicate_sums import ReplicateSums
from uqpen.statistics.by_blocks.score_tables import ScoreTables
from uqpen.statistics.by_blocks.splitters import Splitters

__all__ = ["OutputSet"]

# Of an output: the values between two of them are what is collected for an order statistic.
_OUTPUT_SPLITTERS = 32_768
# With many replicates there are fewer, so that the counts of an output take 128 MB at most.
_MOST_COUNTS = 2**23
# Cells of an output that share their rank where it is one of a batch.
_CELLS_OF_A_BATCH = 16

_Cells = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class OutputSet:
    """Outputs over the same runs: the accumulators of a first and of a second pass.

    Parameters
    ----------
    table : RunTable
    variables : tuple of OutputVariables
        What indices are wanted of, for each output.
    with_inputs : bool
        False where no sensitivity measure is wanted, so that inputs are not read.
    """

    table: RunTable
    variables: tuple[OutputVariables, ...]
    with_inputs: bool

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The columns: inputs, as far as they are read, and outputs."""
        return (*self.inputs, *self.table.outputs)

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """The inputs that are read."""
        return self.table.inputs if self.with_inputs else ()

    @cached_property
    def _some_columns(self) -> dict[str, FloatArray]:
        return self.table.some_columns(self.names)

    @cached_property
    def splitters(self) -> dict[str, Splitters]:
        """Splitters of each column."""
        return {
            name: Splitters.from_values(
                values, INPUT_SPLITTERS if name in self.inputs else self._output_splitters
            )
            for name, values in self._some_columns.items()
        }

    @property
    def _output_splitters(self) -> int:
        return min(_OUTPUT_SPLITTERS, _MOST_COUNTS // self.table.grouping.groups)

    @cached_property
    def _centres(self) -> FloatArray:
        """Centre and scale of each column, about which products are added; shape (2, column)."""
        columns = [self._some_columns[name] for name in self.names]
        spread = [each.std() if each.size else 0.0 for each in columns]
        centre = [each.mean() if each.size else 0.0 for each in columns]
        return np.array([centre, np.where(np.isfinite(spread) & (np.array(spread) > 0), spread, 1)])

    @cached_property
    def missing_counts(self) -> IntArray:
        """Missing runs of each group."""
        return np.zeros(self.table.grouping.groups, dtype=np.int64)

    @cached_property
    def cells(self) -> dict[str, CellCounts]:
        """The distribution of each column, by group."""
        groups = self.table.grouping.groups
        return {name: CellCounts.empty(self.splitters[name], groups) for name in self.names}

    @cached_property
    def powers(self) -> dict[str, PowerSums]:
        """Power sums of each output and of its logarithm, by group."""
        groups = self.table.grouping.groups
        names = [each.output for each in self.variables]
        logs = [each.log_name for each in self.variables if each.has_logarithm]
        return {name: PowerSums.empty(groups) for name in (*names, *logs)}

    @cached_property
    def products(self) -> Products:
        """Products of the columns, by batch."""
        return Products.empty(self.table.grouping.batches, len(self.names))

    @cached_property
    def totals(self) -> Totals:
        """Sums of the variables, by batch."""
        return Totals.empty(self.table.grouping.batches, self._variable_count)

    @cached_property
    def sums(self) -> dict[str, CellSums | ReplicateSums]:
        """Sums of the variables over the cells of each input."""
        grouping, variables, inputs = self.table.grouping, self._variable_count, self.inputs
        found: dict[str, CellSums | ReplicateSums] = {}
        for name in inputs:
            of, batches = self.splitters[name].cells, grouping.batches
            if grouping.is_replicated:
                found[name] = ReplicateSums.empty(of, variables, batches, len(inputs))
            else:
                found[name] = CellSums.empty(of, variables, batches, grouping.points)
        return found

    @property
    def _variable_count(self) -> int:
        return sum(each.count for each in self.variables)

    def first_pass(self) -> None:
        """Read all columns, and add what needs nothing but cells."""
        for chunk in self.table.chunks(self.names):
            self._add_outputs(chunk)
            if self.inputs:
                self._add_inputs(chunk)

    def _add_outputs(self, chunk: Chunk) -> None:
        self.missing_counts[chunk.group] += chunk.missing
        for each in self.variables:
            values = chunk.columns[each.output]
            cells = self.splitters[each.output].locate(values)
            count = self.cells[each.output].add(chunk.group, cells)
            self._batch_counts[each.output][chunk.batch] += _coarse(count)
            self.powers[each.output].add(chunk.group, values)
            if each.has_logarithm:
                self.powers[each.log_name].add(chunk.group, each.logarithm(values))

    def _add_inputs(self, chunk: Chunk) -> None:
        rows = [each.rows(chunk.columns[each.output]) for each in self.variables]
        variables = np.concatenate(rows) if len(rows) > 1 else rows[0]
        self.totals.add(chunk.batch, variables)
        columns = np.stack([chunk.columns[name] for name in self.names])
        centre, scale = self._centres[..., np.newaxis]
        self.products.add(chunk.batch, (columns - centre) / scale)
        for name in self.inputs:
            cells = self.splitters[name].locate(chunk.columns[name])
            count = self.cells[name].add(chunk.group, cells)
            self._batch_counts[name][chunk.batch] += _coarse(count)
            self.sums[name].add(chunk.batch, cells, count, variables)

    @cached_property
    def _batch_counts(self) -> dict[str, IntArray]:
        """Counts of coarse cells of each column, by batch."""
        batches = self.table.grouping.batches
        return {
            name: np.zeros((batches, self.splitters[name].cells // _CELLS_OF_A_BATCH + 1), np.int64)
            for name in self.names
        }

    def second_pass(self) -> None:
        """Read all columns again: add products of ranks, and collect the values asked for."""
        if not self.inputs:
            self.collect()
            return
        collectors = self._collectors()
        for chunk in self.table.chunks(self.names):
            cells = {n: self.splitters[n].locate(chunk.columns[n]) for n in self.names}
            for name, collector in collectors.items():
                collector.add(chunk.group, chunk.columns[name], cells[name])
            self._add_ranks(chunk, cells)
            self.scores.add(cells)
        for collector in collectors.values():
            collector.finish()

    def collect(self) -> bool:
        """Collect the values asked for, if any were; return whether there were some."""
        collectors = self._collectors()
        if collectors:
            for chunk in self.table.chunks([*collectors]):
                for name, collector in collectors.items():
                    values = chunk.columns[name]
                    collector.add(chunk.group, values, self.splitters[name].locate(values))
            for collector in collectors.values():
                collector.finish()
        return bool(collectors)

    def _collectors(self) -> dict[str, Collector]:
        asked = {name: self.cells[name] for name in self.table.outputs if self.cells[name].asked}
        return {name: cells.collector() for name, cells in asked.items()}

    @cached_property
    def rank_products(self) -> tuple[Products, Products]:
        """Products of ranks among all runs, as one batch, and of ranks within each batch."""
        columns, batches = len(self.names), self.table.grouping.batches
        return Products.empty(1, columns), Products.empty(batches, columns)

    def _add_ranks(self, chunk: Chunk, cells: dict[str, _Cells]) -> None:
        among_all, within = self.rank_products
        ranks = np.empty((len(self.names), next(iter(cells.values())).size))
        for row, name in zip(ranks, self.names, strict=True):
            self._scores[name].take(cells[name], out=row, mode="clip")
        among_all.add(0, ranks)
        for row, name in zip(ranks, self.names, strict=True):
            coarse = cells[name] // _CELLS_OF_A_BATCH
            self._batch_scores[name][chunk.batch].take(coarse, out=row, mode="clip")
        within.add(chunk.batch, ranks)

    @cached_property
    def _scores(self) -> dict[str, FloatArray]:
        counts = {name: self.cells[name].counts.sum(axis=0) for name in self.names}
        return {name: mean_shares(each) - 0.5 for name, each in counts.items()}

    @cached_property
    def _batch_scores(self) -> dict[str, FloatArray]:
        return {name: mean_shares(self._batch_counts[name]) - 0.5 for name in self.names}

    @cached_property
    def scores(self) -> ScoreTables:
        """Counts of the outputs' cells by classes of the inputs."""
        shares = {name: self._scores[name] + 0.5 for name in self.names}
        used = int(self.cells[self.names[-1]].counts.sum())
        return ScoreTables.empty(shares, self.inputs, self.table.outputs, used)


def _coarse(count: IntArray) -> IntArray:
    """Return the runs of coarse cells from those of cells."""
    found: IntArray = np.add.reduceat(count, np.arange(0, count.size, _CELLS_OF_A_BATCH))
    return found
