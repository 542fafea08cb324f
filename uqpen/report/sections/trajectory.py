"""The trajectory of the model at the nominal inputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import xarray as xr

from uqpen.charts.chart import Axis, Block, Chart, Charts, LegendKey
from uqpen.charts.marks import Line, Mark, escape_text, series_dash
from uqpen.core.arrays import FloatArray, evenly_spread
from uqpen.figures.trajectory import (
    find_trajectories,
    quantity_name,
    quantity_symbol,
    readable_unit,
    shared_panels,
)
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import number_text
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import capitalized, title_with_unit, unit_suffix

__all__ = ["trajectory"]

Trajectories = Mapping[str, xr.Dataset]

# Points of a line at the most, and rows of a table.
_MOST_POINTS, _ROWS = 300, 11


def trajectory(view: ArchiveView) -> Iterator[Block]:
    """The trajectory at the nominal inputs; of several models, all together."""
    trajectories = find_trajectories(view)
    if not trajectories:
        return
    first = next(iter(trajectories.values()))
    every = [each.model for each in view.model_views]
    notes = ["One run at the nominal inputs: it has no scatter, so there are no intervals."]
    if lacking := [name for name in every if name not in trajectories]:
        notes.append(f"Without a trajectory: {', '.join(lacking)}.")
    yield Charts(
        tuple(_chart(view, trajectories, names) for names in shared_panels(first)),
        keys=tuple(LegendKey(name, every.index(name), "line") for name in trajectories if name),
        notes=tuple(notes),
        tables=tuple(_table(view, name, dataset) for name, dataset in trajectories.items()),
    )


def _chart(view: ArchiveView, trajectories: Trajectories, names: list[str]) -> Chart:
    first = next(iter(trajectories.values()))
    along = str(next(iter(first.dims)))
    unit, _ = readable_unit(first[names[0]])
    every = [each.model for each in view.model_views]
    notes = []
    if len(names) > 1:
        patterns = zip(names, ("solid", "dashed", "dotted", *["dashed"] * len(names)), strict=False)
        notes = [f"{pattern}: {quantity_name(first[name])}" for name, pattern in patterns]
    return Chart(
        title=capitalized("; ".join(quantity_name(first[name]) for name in names)),
        summary=" ".join(
            _ends_sentence(view, model, dataset, names) for model, dataset in trajectories.items()
        ),
        x=Axis(title_with_unit(quantity_name(first[along]), view.unit(along))),
        y=Axis(title_with_unit(", ".join(quantity_symbol(first[name]) for name in names), unit)),
        marks=tuple(
            _line(view, dataset, name, (model, every.index(model) if model else number), number)
            for model, dataset in trajectories.items()
            for number, name in enumerate(names)
            if name in dataset
        ),
        notes=(f"{capitalized('; '.join(notes))}.",) if notes else (),
        height=250,
    )


def _line(
    view: ArchiveView, dataset: xr.Dataset, name: str, of: tuple[str, int], number: int
) -> Mark:
    """A quantity of a model, in a colour and with dashes."""
    model, series = of
    along = str(next(iter(dataset.dims)))
    x, y, unit = _shown_values(view, dataset, name)
    chosen = evenly_spread(x.size, _MOST_POINTS)
    head = f"{escape_text(model, 40)}<br>" if model else ""
    where, what = (escape_text(quantity_name(dataset[each]), 50) for each in (along, name))
    here = f"{where} %{{x:.4~g}}{escape_text(unit_suffix(view.unit(along)))}"
    return Line(
        x[chosen],
        y[chosen],
        series,
        hover=f"{head}{here}<br>{what} %{{y:.4~g}}{escape_text(unit)}",
        name=f"{model} {name}".strip(),
        dash=series_dash(number),
    )


def _shown_values(
    view: ArchiveView, dataset: xr.Dataset, name: str
) -> tuple[FloatArray, FloatArray, str]:
    """Return the values along the axis, those of a quantity, and the suffix of its unit."""
    along = str(next(iter(dataset.dims)))
    unit, factor = readable_unit(dataset[name])
    x = np.asarray(view.scale(along).from_si(dataset[along].values), dtype=np.float64)
    return x, np.asarray(dataset[name].values * factor, dtype=np.float64), unit_suffix(unit)


def _ends_sentence(view: ArchiveView, model: str, dataset: xr.Dataset, names: list[str]) -> str:
    texts = []
    for name in (each for each in names if each in dataset):
        _, y, unit = _shown_values(view, dataset, name)
        known = y[np.isfinite(y)]
        if known.size:
            goes = f"goes from {number_text(known[0])} to {number_text(known[-1])}{unit}"
            most = number_text(known.max())
            texts.append(f"{quantity_name(dataset[name])} {goes}, and is {most} at most")
    text = "; ".join(texts) or "no values"
    return f"By {model}, {text}." if model else f"{capitalized(text)}."


def _table(view: ArchiveView, model: str, dataset: xr.Dataset) -> OutputTable:
    along = str(next(iter(dataset.dims)))
    title = f"Trajectory of {model}" if model else "Trajectory"
    where = title_with_unit(quantity_name(dataset[along]), view.unit(along))
    table = OutputTable(f"{title}, by {where}", [])
    columns = []
    for name in map(str, dataset.data_vars):
        unit, _ = readable_unit(dataset[name])
        table.columns.append(title_with_unit(quantity_name(dataset[name]), unit))
        x, y, _ = _shown_values(view, dataset, name)
        columns.append(y)
    for position in evenly_spread(x.size, _ROWS).tolist():
        values = (y[position] for y in columns)
        cells = [number_text(value) if np.isfinite(value) else NOTHING for value in values]
        table.rows.append((number_text(x[position]), cells))
    return table
