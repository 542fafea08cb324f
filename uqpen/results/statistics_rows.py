"""The rows of a table of statistics: runs, losses, moments, quantiles, probabilities."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import CONDITIONAL, MISSING, RUN, RUNS, RUNS_SPENT, STATUS, SURROGATES
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.core.units import Scale
from uqpen.execution import status_counts
from uqpen.results.digits import grouped_number, percent_text, tolerance_limit_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import (
    NOTHING,
    Conversion,
    OutputTable,
    estimate_remark,
    exceedance_label,
    identity,
    quantile_label,
)

__all__ = [
    "StatisticsRows",
    "add_runs",
    "add_shares",
    "add_statuses",
    "failed_runs_cell",
    "runs_spent",
]


@dataclass(frozen=True)
class StatisticsRows:
    """Adds the rows of one output that is a number."""

    table: OutputTable
    statistics: SourceStatistics
    name: str
    measure: Scale

    def add(self) -> None:
        """All rows that the archive has an answer for."""
        as_difference = self.measure.difference_from_si
        as_value = as_difference if self.statistics.is_difference else self.measure.from_si
        self._add_row("mean", self._arrays("mean"), as_value)
        stds = self._arrays("std")
        self._add_row("sd", stds, as_difference)
        if any(std is not None and math.isnan(std.values[1]) and std.values[0] > 0 for std in stds):
            self._add_row("half 16–84 % range", self._arrays("half_spread"), as_difference)
        self._add_row("skewness", self._arrays("skewness"), identity)
        for p, arrays in self._entries("quantile"):
            self._add_row(quantile_label(p), arrays, as_value)
        for text, arrays in self._entries("exceedance"):
            self._add_row(exceedance_label(text), arrays, identity)
        for p, arrays in self._entries("tolerance_limit"):
            cells = [self._tolerance_limit_cell(array) for array in arrays]
            self.table.rows.append((f"not exceeded, {percent_text(p)}", cells))

    def _arrays(self, statistic: str) -> list[xr.DataArray | None]:
        """A statistic of every source; None where it has none."""
        return [self.statistics.get(source, self.name, statistic) for source in self.table.columns]

    def _entries(self, statistic: str) -> Iterator[tuple[Any, list[xr.DataArray | None]]]:
        """The entries of a statistic: what each is called, and the estimate of every source."""
        arrays = self._arrays(statistic)
        first = next((array for array in arrays if array is not None), None)
        if first is not None:
            for position, called in enumerate(first[CATALOGUE[statistic].dims[0]].values):
                yield called, [None if array is None else array[position] for array in arrays]

    def _add_row(self, label: str, arrays: list[xr.DataArray | None], convert: Conversion) -> None:
        cells = [self.table.cell(array, convert) for array in arrays]
        if any(cell != NOTHING for cell in cells):
            self.table.rows.append((label, cells))

    def _tolerance_limit_cell(self, array: xr.DataArray | None) -> str:
        if array is None:
            return NOTHING
        estimate, _, upper = self.measure.from_si(array.values)
        mark = self.table.note_mark(estimate_remark(array))
        if upper > estimate:
            mark += self.table.note_mark("at most: one-sided tolerance bound, 95 % confidence")
        return tolerance_limit_text(estimate, upper) + mark


def runs_spent(tree: xr.DataTree, source: str) -> int | None:
    """Return the runs a source took: a design its own, a surrogate those it was made of."""
    surrogate = read_group(tree, SURROGATES, source)
    if RUNS_SPENT in surrogate.attrs:
        return int(surrogate.attrs[RUNS_SPENT])
    runs = read_group(tree, RUNS, source)
    return int(runs.sizes[RUN]) if runs else None


def add_runs(table: OutputTable, tree: xr.DataTree) -> None:
    """A row of how many runs each source took."""
    spent = [runs_spent(tree, source) for source in table.columns]
    table.rows.append(
        ("runs", [NOTHING if runs is None else grouped_number(runs) for runs in spent])
    )


def failed_runs_cell(tree: xr.DataTree, source: str, table: OutputTable) -> str:
    """Return the cell of a design's failed runs, with what they mean for its statistics."""
    runs = read_group(tree, RUNS, source)
    if not runs:
        return NOTHING
    counts = [f"{n} {STATUS_TEXT[s]}" for s, n in status_counts(runs).items() if n and s]
    chances = SourceStatistics(tree).failures(source).get("probability")
    accounts = {} if chances is None else chances.attrs
    notes = []
    if CONDITIONAL in accounts:
        notes.append(f"statistics are conditional on {accounts[CONDITIONAL]}")
    if MISSING in accounts:
        notes.append(f"statistics are of the runs that came back; {accounts[MISSING]} did not")
    return (", ".join(counts) or "0") + "".join(map(table.note_mark, notes))


def add_statuses(table: OutputTable, tree: xr.DataTree) -> None:
    """Add a row for each way in which runs failed: its probability."""
    runs = [read_group(tree, RUNS, source) for source in table.columns]
    counts = [status_counts(each) for each in runs if each]
    statistics = SourceStatistics(tree)
    chances = [statistics.failures(source).get("probability") for source in table.columns]
    for status in Status:
        if status is not Status.OK and any(count[status] for count in counts):
            cells = [table.cell(_chance(array, status), identity) for array in chances]
            table.rows.append((f"P({STATUS_TEXT[status]})", cells))


def _chance(array: xr.DataArray | None, status: Status) -> xr.DataArray | None:
    """Return the probability of a run status; None where the archive has none."""
    ends = [] if array is None else array[STATUS].values.tolist()
    if array is None or status.meaning not in ends:
        return None
    return array[ends.index(status.meaning)]


def add_shares(table: OutputTable, tree: xr.DataTree, name: str) -> None:
    """A row for each kind of an output that has kinds."""
    statistics = SourceStatistics(tree)
    arrays = [statistics.get(source, name, "share") for source in table.columns]
    first = next((array for array in arrays if array is not None), None)
    if first is not None:
        for position, label in enumerate(first["category_label"].values):
            found = [None if array is None else array[position] for array in arrays]
            cells = [table.cell(array, identity) for array in found]
            table.rows.append((f"share {label}", cells))
