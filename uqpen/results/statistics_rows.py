"""The rows of a table of statistics: runs, losses, moments, quantiles, probabilities."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.labels import (
    CONDITIONAL,
    EXCEEDANCE,
    MISSING,
    MOMENTS,
    QUANTILES,
    RUN,
    RUNS,
    RUNS_SPENT,
    SHARES,
    STATUS_TEXT,
    STATUSES,
    SURROGATES,
    TOLERANCE_LIMITS,
    Status,
)
from uqpen.core.units import Scale
from uqpen.execution import status_counts
from uqpen.results.digits import grouped_number, percent_text, tolerance_limit_text
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
    tree: xr.DataTree
    name: str
    measure: Scale
    is_difference: bool = False

    def add(self) -> None:
        """All rows that the archive has an answer for."""
        as_difference = self.measure.difference_from_si
        as_value = as_difference if self.is_difference else self.measure.from_si
        self._add_moment("mean", "mean", as_value)
        self._add_moment("std", "sd", as_difference)
        stds = self._arrays(MOMENTS, f"{self.name}_std")
        if any(std is not None and math.isnan(std.values[1]) and std.values[0] > 0 for std in stds):
            self._add_moment("half_spread", "half 16–84 % range", as_difference)
        self._add_moment("skewness", "skewness", identity)
        for p, arrays in self._entries(QUANTILES, "probability"):
            self._add_row(quantile_label(p), arrays, as_value)
        for text, arrays in self._entries(EXCEEDANCE, "threshold"):
            self._add_row(exceedance_label(text), arrays, identity)
        for p, arrays in self._entries(TOLERANCE_LIMITS, "hold"):
            cells = [self._tolerance_limit_cell(array) for array in arrays]
            self.table.rows.append((f"not exceeded, {percent_text(p)}", cells))

    def _arrays(self, kind: str, variable: str) -> list[xr.DataArray | None]:
        """A statistic of every source; None where it has none."""
        found = (read_group(self.tree, kind, source) for source in self.table.columns)
        return [dataset.get(variable) for dataset in found]

    def _entries(
        self, kind: str, coordinate: str
    ) -> Iterator[tuple[Any, list[xr.DataArray | None]]]:
        """The entries of a statistic: what each is called, and the estimate of every source."""
        arrays = self._arrays(kind, self.name)
        first = next((array for array in arrays if array is not None), None)
        if first is not None:
            for position, called in enumerate(first[f"{self.name}_{coordinate}"].values):
                yield called, [None if array is None else array[position] for array in arrays]

    def _add_moment(self, statistic: str, label: str, convert: Conversion) -> None:
        self._add_row(label, self._arrays(MOMENTS, f"{self.name}_{statistic}"), convert)

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
    """How many runs a source took: a design its own, a surrogate those it was made of."""
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
    """What became of a design's lost runs, with what that means for its statistics."""
    runs = read_group(tree, RUNS, source)
    if not runs:
        return NOTHING
    counts = [f"{n} {STATUS_TEXT[s]}" for s, n in status_counts(runs).items() if n and s]
    accounts = read_group(tree, STATUSES, source).attrs
    notes = []
    if CONDITIONAL in accounts:
        notes.append(f"statistics are conditional on {accounts[CONDITIONAL]}")
    if MISSING in accounts:
        notes.append(f"statistics are of the runs that came back; {accounts[MISSING]} did not")
    return (", ".join(counts) or "0") + "".join(map(table.note_mark, notes))


def add_statuses(table: OutputTable, tree: xr.DataTree) -> None:
    """A row for each way in which runs were lost: how likely it is."""
    runs = [read_group(tree, RUNS, source) for source in table.columns]
    counts = [status_counts(each) for each in runs if each]
    for status in Status:
        if status is not Status.OK and any(count[status] for count in counts):
            datasets = [read_group(tree, STATUSES, source) for source in table.columns]
            cells = [table.cell(each.get(status.meaning), identity) for each in datasets]
            table.rows.append((f"P({STATUS_TEXT[status]})", cells))


def add_shares(table: OutputTable, tree: xr.DataTree, name: str) -> None:
    """A row for each kind of an output that has kinds."""
    arrays = [read_group(tree, SHARES, source)[name] for source in table.columns]
    for position, label in enumerate(arrays[0][f"{name}_category_label"].values):
        cells = [table.cell(array[position], identity) for array in arrays]
        table.rows.append((f"share {label}", cells))
