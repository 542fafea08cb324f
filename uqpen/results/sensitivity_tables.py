"""Tables of the inputs' part in an output: indices, effects, responses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.catalogue import THRESHOLD
from uqpen.core.labels import INPUT, PAIR
from uqpen.core.units import DIMENSIONLESS, Scale, scale
from uqpen.results.best_sources import best_sources
from uqpen.results.measure_labels import (
    ASSOCIATIONS,
    EFFECTS,
    EXCEEDANCE_INDICES,
    INDICES,
    LOGARITHM_INDICES,
    PAIR_INDICES,
    RESPONSES,
    Measure,
)
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import NOTHING, OutputTable, identity

__all__ = ["named_tables", "sensitivity_tables"]


_TABLES = (
    ("shares", "shares of its variance", INDICES),
    ("responses", "responses to its inputs", RESPONSES),
    ("effects", "elementary effects", EFFECTS),
)
_MORE_TABLES = (
    ("shares of the logarithm", "shares of its logarithm's variance", LOGARITHM_INDICES),
    ("associations", "association with its inputs", ASSOCIATIONS),
)


def sensitivity_tables(
    tree: xr.DataTree, output: str, unit: str, *, everything: bool = False
) -> Iterator[OutputTable]:
    """Yield a table for each kind of measure that the archive has of an output.

    First order indices from plain samples are shown where no other source has them. The other
    measures of any sample are shown only where everything is asked for.

    Parameters
    ----------
    tree : DataTree
        The part of an archive on one model.
    output : str
        Its name.
    unit : str
        The unit to show it in.
    everything : bool
        Whether to show all that there is.
    """
    for _, table in named_tables(tree, output, unit, everything=everything):
        yield table


def named_tables(
    tree: xr.DataTree, output: str, unit: str, *, everything: bool = False
) -> Iterator[tuple[str, OutputTable]]:
    """Yield these tables, each after its name, such as "shares", "responses" or "effects"."""
    statistics = SourceStatistics(tree)
    for name, title, measures in (*_TABLES, *(_MORE_TABLES if everything else ())):
        columns = list(_columns(statistics, output, measures))
        if measures is INDICES and not everything:
            columns = _best_columns(tree, columns)
        if columns:
            measured = f" [{unit}]" if measures is EFFECTS and unit != DIMENSIONLESS else ""
            table = _table(f"{output}: {title}{measured}", columns, scale(unit))
            if measures is INDICES:
                _add_claims(table, statistics, output)
            yield name, table
    for column in _columns(statistics, output, PAIR_INDICES):
        yield "pairs", _pairs_table(output, column)
    if everything:
        for table in _exceedance_tables(statistics, output):
            yield "exceedance", table


class _Column(NamedTuple):
    source: str
    measure: Measure
    array: xr.DataArray

    @property
    def header(self) -> str:
        """Stands above its cells."""
        return f"{self.measure.label}\n{self.source}"


def _exceedance_tables(statistics: SourceStatistics, output: str) -> Iterator[OutputTable]:
    """The inputs' part in whether an output exceeds each value."""
    columns = list(_columns(statistics, output, EXCEEDANCE_INDICES))
    written = columns[0].array[THRESHOLD].values if columns else ()
    for position, threshold in enumerate(written):
        at = [each._replace(array=each.array[{THRESHOLD: position}]) for each in columns]
        title = f"{output}: shares of the variance of exceeding {threshold}"
        yield _table(title, at, scale(DIMENSIONLESS))


def _pairs_table(output: str, column: _Column) -> OutputTable:
    """Return the shares that pairs of inputs have together and neither has alone."""
    table = OutputTable(f"{output}: shares of its variance, by pairs", [column.header])
    for position, pair in enumerate(column.array[PAIR].values):
        table.rows.append((str(pair), [table.cell(column.array[position], identity)]))
    return table


def _columns(
    statistics: SourceStatistics, output: str, measures: Sequence[Measure]
) -> Iterator[_Column]:
    for measure in measures:
        for source in statistics.sources:
            array = statistics.get(source, output, measure.statistic)
            if array is not None:
                yield _Column(source, measure, array)


def _best_columns(tree: xr.DataTree, columns: Sequence[_Column]) -> list[_Column]:
    """The columns without those of plain samples, unless there are no others."""
    runs: dict[str, int] = {}
    for column in columns:
        runs.setdefault(column.source, int(column.array.attrs.get("runs", 0)))
    shown = best_sources(tree, runs)
    return [column for column in columns if column.source in shown]


def _table(title: str, columns: Sequence[_Column], measure: Scale) -> OutputTable:
    table = OutputTable(title, [column.header for column in columns])
    inputs = dict.fromkeys(str(name) for column in columns for name in column.array[INPUT].values)
    for name in inputs:
        table.rows.append((name, [_cell(table, column, name, measure) for column in columns]))
    return table


def _add_claims(table: OutputTable, statistics: SourceStatistics, output: str) -> None:
    """A column for each publication that names the largest contribution."""
    for source in statistics.publications:
        if claim := statistics.largest_contribution(source, output):
            table.columns.append(f"the largest to\n{source}")
            for name, cells in table.rows:
                cells.append("this" if name == claim else NOTHING)


def _cell(table: OutputTable, column: _Column, name: str, measure: Scale) -> str:
    known = column.array[INPUT].values.tolist()
    if name not in known:
        return NOTHING
    estimate, factor = column.array[known.index(name)], column.measure.factor
    if column.measure.has_unit:
        return table.cell(estimate, measure.difference_from_si)

    def shown(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return values * factor

    return table.cell(estimate, shown if factor != 1 else identity)
