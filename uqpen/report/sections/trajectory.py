"""The trajectory of the model at the nominal inputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.charts.chart import Block
from uqpen.charts.trajectory import (
    find_trajectories,
    quantity_name,
    readable_unit,
    shown_values,
    trajectory_charts,
)
from uqpen.core.arrays import evenly_spread
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import number_text
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import title_with_unit

__all__ = ["trajectory"]

# Points of a line at the most, and rows of a table.
_MOST_POINTS, _ROWS = 300, 11


def trajectory(view: ArchiveView) -> Iterator[Block]:
    """The trajectory at the nominal inputs; of several models, all together."""
    for charts in trajectory_charts(view, _MOST_POINTS):
        tables = (_table(view, *each) for each in find_trajectories(view).items())
        yield replace(charts, tables=tuple(tables))


def _table(view: ArchiveView, model: str, dataset: xr.Dataset) -> OutputTable:
    along = str(next(iter(dataset.dims)))
    title = f"Trajectory of {model}" if model else "Trajectory"
    where = title_with_unit(quantity_name(dataset[along]), view.unit(along))
    table = OutputTable(f"{title}, by {where}", [])
    columns = []
    for name in map(str, dataset.data_vars):
        unit, _ = readable_unit(dataset[name])
        table.columns.append(title_with_unit(quantity_name(dataset[name]), unit))
        x, y, _ = shown_values(view, dataset[name])
        columns.append(y)
    for position in evenly_spread(x.size, _ROWS).tolist():
        values = (y[position] for y in columns)
        cells = [number_text(value) if np.isfinite(value) else NOTHING for value in values]
        table.rows.append((number_text(x[position]), cells))
    return table
