"""An archive as tables: one for each output, a column for each design."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import xarray as xr

from uqpen.archive.read import group, names_in
from uqpen.archive.told import told
from uqpen.evaluation import status_counts
from uqpen.labels import (
    CONDITIONAL,
    EXCEEDANCE,
    HOLDS,
    INTERVAL_LABEL,
    MISSING,
    MOMENTS,
    NOTE,
    QUANTILES,
    ROLE,
    RUN,
    RUNS,
    SHARES,
    STATUS_TEXT,
    STATUSES,
    Status,
)
from uqpen.summary.digits import SUPERSCRIPTS, grouped, held, percent, sensible
from uqpen.units import DIMENSIONLESS, Scale, scale

__all__ = ["OutputTable", "output_names", "output_tables"]

Conversion = Callable[[Any], Any]


@dataclass
class OutputTable:
    """One output of a study, a column for each design.

    Parameters
    ----------
    title : str
        What the output is, with the unit of the figures.
    columns : list of str
        Designs.
    rows : list
        A label, and a cell for each column.
    notes : list of str
        What the superscript numbers in cells refer to, in order.
    """

    title: str
    columns: list[str]
    rows: list[tuple[str, list[str]]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def mark(self, note: str) -> str:
        """The superscript of a note, noted if it is new; nothing for no note."""
        if not note:
            return ""
        if note not in self.notes:
            self.notes.append(note)
        return " " + str(self.notes.index(note) + 1).translate(SUPERSCRIPTS)


def output_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """A table for each output of a study.

    Parameters
    ----------
    tree : DataTree
        An archive.
    """
    designs = names_in(tree, RUNS)
    runs = {design: group(tree, RUNS, design) for design in designs}
    first = runs[designs[0]]
    for name in output_names(first):
        unit = str(first[name].attrs.get("display_units", DIMENSIONLESS))
        table = OutputTable(name if unit == DIMENSIONLESS else f"{name} [{unit}]", designs)
        table.rows.append(("runs", [grouped(runs[design].sizes[RUN]) for design in designs]))
        table.rows.append(("lost", [_lost(tree, design, table) for design in designs]))
        _add_statuses(table, tree)
        if "flag_meanings" in first[name].attrs:
            _add_shares(table, tree, name)
        else:
            _Rows(table, tree, name, scale(unit)).add()
        yield table


def output_names(runs: xr.Dataset) -> list[str]:
    """The outputs among the variables of a runs dataset."""
    return [str(name) for name, v in runs.data_vars.items() if v.attrs.get(ROLE) == "output"]


def _lost(tree: xr.DataTree, design: str, table: OutputTable) -> str:
    counts = status_counts(group(tree, RUNS, design))
    lost = [f"{n} {STATUS_TEXT[s]}" for s, n in counts.items() if n and s is not Status.OK]
    accounts = group(tree, STATUSES, design).attrs
    notes = []
    if CONDITIONAL in accounts:
        notes.append(f"statistics are conditional on {accounts[CONDITIONAL]}")
    if MISSING in accounts:
        notes.append(f"statistics are of the runs that came back; {accounts[MISSING]} did not")
    return (", ".join(lost) or "0") + "".join(map(table.mark, notes))


def _add_statuses(table: OutputTable, tree: xr.DataTree) -> None:
    """A row for each way in which runs were lost: how likely it is."""
    counts = [status_counts(group(tree, RUNS, design)) for design in table.columns]
    for status in Status:
        if status is not Status.OK and any(count[status] for count in counts):
            arrays = [group(tree, STATUSES, design)[status.meaning] for design in table.columns]
            cells = [_cell(table, array) for array in arrays]
            table.rows.append((f"P({STATUS_TEXT[status]})", cells))


def _add_shares(table: OutputTable, tree: xr.DataTree, name: str) -> None:
    arrays = [group(tree, SHARES, design)[name] for design in table.columns]
    for position, label in enumerate(arrays[0][f"{name}_category_label"].values):
        cells = [_cell(table, array[position]) for array in arrays]
        table.rows.append((f"share {label}", cells))


@dataclass(frozen=True)
class _Rows:
    """Adds the rows of one output that is a number."""

    table: OutputTable
    tree: xr.DataTree
    name: str
    measure: Scale

    def add(self) -> None:
        """All rows that the archive has an answer for."""
        as_value, as_difference = self.measure.from_si, self.measure.difference_from_si
        self._moment("mean", "mean", as_value)
        self._moment("std", "sd", as_difference)
        stds = self._arrays(MOMENTS, f"{self.name}_std")
        if any(math.isnan(std.values[1]) and std.values[0] > 0 for std in stds):
            self._moment("half_spread", "half 16–84 % range", as_difference)
        self._moment("skewness", "skewness", _unchanged)
        for p, arrays in self._along(QUANTILES, "probability"):
            label = "median" if p == 0.5 else f"{percent(p)} quantile"
            self._row(label, arrays, as_value)
        for text, arrays in self._along(EXCEEDANCE, "threshold"):
            self._row(f"P(> {text})", arrays, _unchanged)
        for p, arrays in self._along(HOLDS, "hold"):
            cells = [self._held(array) for array in arrays]
            self.table.rows.append((f"not exceeded, {percent(p)}", cells))

    def _arrays(self, kind: str, variable: str) -> list[xr.DataArray]:
        """A statistic of every design; empty where it was not asked."""
        found = (group(self.tree, kind, design) for design in self.table.columns)
        return [dataset[variable] for dataset in found if variable in dataset]

    def _along(self, kind: str, coordinate: str) -> Iterator[tuple[Any, list[xr.DataArray]]]:
        """The entries of a statistic: what each is called, and the estimate of every design."""
        arrays = self._arrays(kind, self.name)
        if arrays:
            for position, called in enumerate(arrays[0][f"{self.name}_{coordinate}"].values):
                yield called, [array[position] for array in arrays]

    def _moment(self, statistic: str, label: str, convert: Conversion) -> None:
        self._row(label, self._arrays(MOMENTS, f"{self.name}_{statistic}"), convert)

    def _row(self, label: str, arrays: list[xr.DataArray], convert: Conversion) -> None:
        shown = [array.copy(data=convert(array.values)) for array in arrays]
        self.table.rows.append((label, [_cell(self.table, array) for array in shown]))

    def _held(self, array: xr.DataArray) -> str:
        estimate, _, upper = self.measure.from_si(array.values)
        mark = self.table.mark(_remark(array))
        if upper > estimate:
            mark += self.table.mark("at most: one-sided tolerance bound, 95 % confidence")
        return held(estimate, upper) + mark


def _unchanged(values: Any) -> Any:
    """What has no unit is shown as it is, whatever unit its output is shown in."""
    return values


def _cell(table: OutputTable, array: xr.DataArray) -> str:
    return sensible(*(float(value) for value in array.values)) + table.mark(_remark(array))


def _remark(array: xr.DataArray) -> str:
    """What a reader must know of an estimate; empty for nothing."""
    note = told(array, NOTE)
    if not note and told(array, INTERVAL_LABEL) == "conservative":
        return "conservative: the interval may be wider than it need be"
    return note
