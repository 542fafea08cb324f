"""Runs of one design: in bins, by category, with their statistics."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.figures.histogram import bin_values, marked_estimates
from uqpen.report.axes import quantity_axis
from uqpen.report.blocks import Axis, Chart, LegendKey
from uqpen.report.counting import count_text
from uqpen.report.marks import bar_trace, dot_trace
from uqpen.report.sections.leading_design import output_title
from uqpen.report.shapes import Shape, shaded_interval, vertical_line
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text, percent_text
from uqpen.results.statistics_rows import add_shares
from uqpen.results.table import OutputTable
from uqpen.results.texts import capitalized, unit_suffix

__all__ = ["histogram", "shares"]

# Dashes of the lines at marked estimates, and in turn of those at other quantiles.
_DASHES = {"mean": "dash", "median": "solid"}
_OTHER_DASHES = ("dot", "dashdot", "2px,5px", "longdash")
_HOVER = "%{customdata[0]} … %{customdata[1]}<br>%{y}"


def histogram(view: ArchiveView, output: str, design: str) -> Chart:
    """Return the chart of a design's completed runs, in bins; of quantiles if not all are shown."""
    values = view.scale(output).from_si(view.shown_values(design, output))
    unit, title = "run", f"{count_text(values.size, 'run')} of {design}"
    if not view.design(design).shows_all_runs:
        unit, title = "quantile", f"{design}, by {count_text(values.size, 'quantile')}"
    counts, edges = bin_values(values)
    outside = values.size - int(counts.sum())
    marked = list(marked_estimates(view, output, design))
    shapes, keys, lacks = _estimate_marks(view, output, marked)
    notes = []
    if outside:
        verb = "lies" if outside == 1 else "lie"
        notes.append(f"{count_text(outside, unit)} {verb} outside of the axis.")
    if len(lacks) < len(marked):
        level = max(float(e.attrs.get(INTERVAL_LEVEL, 0)) for _, e in marked)
        notes.append(f"Shades: {percent_text(level)} intervals of the marked estimates.")
    if lacks:
        notes.append(f"No two-sided interval, so no shade: {', '.join(lacks)}.")
    highest = int(np.argmax(counts))
    series = view.series(design)
    return Chart(
        title=title,
        summary=f"The fullest bin, with {count_text(int(counts[highest]), unit)}, lies between "
        f"{edges[highest]:.4g} and {edges[highest + 1]:.4g}{unit_suffix(view.unit(output))}.",
        x=quantity_axis(view, output, (float(edges[0]), float(edges[-1]))),
        y=Axis(f"{unit}s in a bin"),
        traces=(bar_trace(edges, counts, series, hover=f"{_HOVER} {unit}s"),),
        shapes=tuple(shapes),
        keys=(LegendKey(f"{unit}s", series, "bar"), *keys),
        notes=tuple(notes),
        height=280,
    )


def _estimate_marks(
    view: ArchiveView, output: str, marked: list[tuple[str, xr.DataArray]]
) -> tuple[list[Shape], list[LegendKey], list[str]]:
    """Lines at estimates, shades of their intervals, and the names of those without one."""
    shapes: list[Shape] = []
    keys: list[LegendKey] = []
    lacks: list[str] = []
    others = 0
    for name, estimate in marked:
        bounds = view.scale(output).from_si(estimate.values)
        series: int | str = 1 if name == "mean" else "ink"
        dash = _DASHES.get(name) or _OTHER_DASHES[others % len(_OTHER_DASHES)]
        others += name not in _DASHES
        if np.isfinite(bounds[1:]).all():
            shapes.append(shaded_interval(float(bounds[1]), float(bounds[2]), series))
        else:
            lacks.append(name)
        shapes.append(vertical_line(float(bounds[0]), series, dash))
        text = f"{name} {estimate_text(*bounds)}{unit_suffix(view.unit(output))}"
        keys.append(LegendKey(text, series, "line", dash))
    return shapes, keys, lacks


def shares(view: ArchiveView, output: str, design: str, probabilities: xr.DataArray) -> Chart:
    """Return a chart of the probabilities of an output's categories, along ``category``."""
    title = capitalized(output_title(view, output))
    labels = tuple(map(str, probabilities["category_label"].values))
    table = OutputTable(f"Category probabilities by {design}", [design])
    add_shares(table, view.statistics, output)
    texts = [f"{label}: {cells[0]}" for label, cells in table.rows]
    places, series = np.arange(len(labels)), view.series(design)
    return Chart(
        title=f"{title}: probability of each category, by {design}",
        summary="; ".join(texts),
        x=Axis("probability", (0.0, 1.0)),
        y=Axis("", rows=labels),
        traces=(dot_trace(probabilities.values, places, series, hovers=texts, name=design),),
        tables=(table,),
        height=90 + 34 * len(labels),
    )
