"""An archive as tables: one for each output, a column for each design."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from uqpen.archive.read import group, names_in
from uqpen.labels import (
    CONDITIONAL,
    EXCEEDANCE,
    HOLDS,
    MOMENTS,
    QUANTILES,
    ROLE,
    RUN,
    RUNS,
    SHARES,
    STATUS,
    STATUS_TEXT,
    STATUSES,
    Status,
)
from uqpen.summary.digits import SUPERSCRIPTS, grouped, held, percent, sensible
from uqpen.units import DIMENSIONLESS, Scale, scale

__all__ = ["OutputTable", "output_names", "output_tables", "status_counts"]


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


def status_counts(runs: xr.Dataset) -> dict[Status, int]:
    """How many runs ended with each status."""
    counts = np.bincount(runs[STATUS].values.astype(np.int64), minlength=len(Status))
    return {status: int(counts[status]) for status in Status}


def _lost(tree: xr.DataTree, design: str, table: OutputTable) -> str:
    counts = status_counts(group(tree, RUNS, design))
    lost = [f"{n} {STATUS_TEXT[s]}" for s, n in counts.items() if n and s is not Status.OK]
    given = group(tree, MOMENTS, design).attrs.get(CONDITIONAL)
    note = f"statistics are of the law given {given}" if given else ""
    return (", ".join(lost) or "0") + table.mark(note)


def _add_statuses(table: OutputTable, tree: xr.DataTree) -> None:
    """A row for each way in which runs were lost: how likely it is."""
    groups = [group(tree, STATUSES, design) for design in table.columns]
    for status in Status:
        if any(status.meaning in statuses for statuses in groups):
            cells = [
                _cell(table, statuses[status.meaning]) if status.meaning in statuses else "–"
                for statuses in groups
            ]
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
        self._moment("mean", "mean")
        self._moment("std", "sd")
        stds = self._arrays(MOMENTS, f"{self.name}_std")
        if any(math.isnan(std.values[1]) and std.values[0] > 0 for std in stds):
            self._moment("half_spread", "half spread 16–84 %")
        self._moment("skewness", "skewness")
        quantiles = self._arrays(QUANTILES, self.name)
        for position, p in enumerate(quantiles[0][f"{self.name}_probability"].values):
            label = "median" if p == 0.5 else f"{percent(p)} quantile"
            self._row(label, [array[position] for array in quantiles])
        exceedance = self._arrays(EXCEEDANCE, self.name)
        if exceedance:
            for position, text in enumerate(exceedance[0][f"{self.name}_threshold"].values):
                self._row(f"P(> {text})", [array[position] for array in exceedance])
        holds = self._arrays(HOLDS, self.name)
        if holds:
            for position, p in enumerate(holds[0][f"{self.name}_hold"].values):
                cells = [self._held(array[position], p) for array in holds]
                self.table.rows.append((f"held with {percent(p)}", cells))

    def _arrays(self, kind: str, variable: str) -> list[xr.DataArray]:
        """A statistic of every design; empty where it was not asked."""
        found = (group(self.tree, kind, design) for design in self.table.columns)
        return [dataset[variable] for dataset in found if variable in dataset]

    def _moment(self, statistic: str, label: str) -> None:
        is_difference = statistic in ("std", "half_spread")
        arrays = self._arrays(MOMENTS, f"{self.name}_{statistic}")
        self._row(label, arrays, difference=is_difference)

    def _row(self, label: str, arrays: list[xr.DataArray], *, difference: bool = False) -> None:
        convert = self.measure.difference_from_si if difference else self.measure.from_si
        shown = [
            array
            if array.attrs["units"] == DIMENSIONLESS
            else array.copy(data=convert(array.values))
            for array in arrays
        ]
        self.table.rows.append((label, [_cell(self.table, array) for array in shown]))

    def _held(self, array: xr.DataArray, probability: float) -> str:
        estimate, _, upper = self.measure.from_si(array.values)
        note = str(array.attrs.get("note", ""))
        if math.isnan(upper) and not note:
            needed = grouped(int(array[f"{self.name}_runs_needed"]))
            note = f"a bound on the {percent(probability)} value takes at least {needed} runs"
        return held(estimate, upper) + self.table.mark(note)


def _cell(table: OutputTable, array: xr.DataArray) -> str:
    note = str(array.attrs.get("note", ""))
    if array.attrs["interval_label"] == "conservative":
        note = note or "conservative: the interval is wider than it need be"
    return sensible(*(float(value) for value in array.values)) + table.mark(note)
