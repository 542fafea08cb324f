"""The runs of one design: in bins, by kinds, with what is told of them."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqpen.archive.read import group
from uqpen.figures.histogram import binned, marks_of
from uqpen.figures.part import Part
from uqpen.figures.texts import after_number, capitalized
from uqpen.labels import INTERVAL_LEVEL, SHARES
from uqpen.report.blocks import Axis, Chart, Key
from uqpen.report.counting import counted
from uqpen.report.marks import bars, dots
from uqpen.report.sections.evidence import sample_of, titled
from uqpen.report.shapes import Shape, shade, upright
from uqpen.summary.digits import percent, sensible
from uqpen.summary.statistics_rows import add_shares
from uqpen.summary.table import OutputTable

__all__ = ["histogram", "shares"]


def histogram(part: Part, output: str, design: str) -> Chart:
    """The runs of a design that came back, in bins."""
    values = part.measure(output).from_si(sample_of(part, design, output).values)
    counts, edges = binned(values)
    outside = values.size - int(counts.sum())
    marked = list(marks_of(part, output, design))
    shapes, keys, lacks = _marked(part, output, marked)
    notes = []
    if outside:
        verb = "lies" if outside == 1 else "lie"
        notes.append(f"{counted(outside, 'run')} {verb} outside of the axis.")
    if len(lacks) < len(marked):
        level = max(float(e.attrs.get(INTERVAL_LEVEL, 0)) for _, e in marked)
        notes.append(f"Shades: {percent(level)} intervals of what the lines mark.")
    if lacks:
        notes.append(f"No interval with two ends, so no shade: {', '.join(lacks)}.")
    highest = int(np.argmax(counts))
    return Chart(
        title=f"{counted(values.size, 'run')} of {design}",
        summary=f"The fullest bin, with {counted(int(counts[highest]), 'run')}, lies between "
        f"{edges[highest]:.4g} and {edges[highest + 1]:.4g}{after_number(part.unit(output))}.",
        x=Axis(part.axis(output), (float(edges[0]), float(edges[-1]))),
        y=Axis("runs in a bin"),
        traces=(
            bars(
                edges,
                counts,
                part.sources.index(design),
                hover="%{customdata[0]} … %{customdata[1]}<br>%{y} runs",
            ),
        ),
        shapes=tuple(shapes),
        keys=(Key("runs", part.sources.index(design), "bar"), *keys),
        notes=tuple(notes),
        height=280,
    )


def _marked(
    part: Part, output: str, marked: list[tuple[str, xr.DataArray]]
) -> tuple[list[Shape], list[Key], list[str]]:
    """Lines at estimates and shades of their intervals; what has none."""
    shapes: list[Shape] = []
    keys: list[Key] = []
    lacks: list[str] = []
    for name, estimate in marked:
        bounds = part.measure(output).from_si(estimate.values)
        series, dash = (1, "dash") if name == "mean" else ("ink", "solid")
        dash = "dot" if series == "ink" and name != "median" else dash
        if np.isfinite(bounds[1:]).all():
            shapes.append(shade(float(bounds[1]), float(bounds[2]), series))
        else:
            lacks.append(name)
        shapes.append(upright(float(bounds[0]), series, dash))
        keys.append(Key(f"{name} {sensible(*bounds)}", series, "line", dash))
    return shapes, keys, lacks


def shares(part: Part, output: str, design: str) -> Chart:
    """How likely each kind of an output is."""
    told = group(part.tree, SHARES, design)[output]
    labels = tuple(map(str, told[f"{output}_category_label"].values))
    table = OutputTable(f"Shares by {design}", [design])
    add_shares(table, part.tree, output)
    said = [f"{label}: {cells[0]}" for label, cells in table.rows]
    return Chart(
        title=f"{capitalized(titled(part, output))}: how often each kind comes about, by {design}",
        summary="; ".join(said),
        x=Axis("share", (0.0, 1.0)),
        y=Axis("", rows=labels),
        traces=(
            dots(
                told.values,
                np.arange(len(labels)),
                part.sources.index(design),
                hovers=said,
                name=design,
            ),
        ),
        tables=(table,),
        height=90 + 34 * len(labels),
    )
