"""Measures of the inputs' part in an output by source, and a panel of some of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.labels import INPUT
from uqpen.figures.estimate_dots import EstimateDot, draw_dots
from uqpen.figures.panel import Axes, Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.source_style import GREY, SourceStyle
from uqpen.results.table import Conversion

__all__ = ["MeasureSeries", "largest_inputs", "measure_series", "measures_panel"]


# Inputs that are shown, those with the largest estimates of all.
_MOST_INPUTS = 15
_ROW, _GAP, _FRAME = 0.12, 0.12, 0.75


class MeasureSeries(NamedTuple):
    """One sensitivity measure of all inputs by one source: an array along input and bound."""

    source: str
    label: str
    marker: str
    array: xr.DataArray


def measure_series(
    view: ArchiveView, output: str, measures: Sequence[tuple[str, str, str]]
) -> list[MeasureSeries]:
    """Return some measures by all sources, without those that have no estimate.

    Each is given as a `Measure`: the statistic, its name in a legend, and its marker.
    """
    found = [
        MeasureSeries(source, label, marker, array)
        for name, label, marker in measures
        for source, array in view.estimates(output, name).items()
        if np.isfinite(array.values[:, 0]).any()
    ]
    return sorted(found, key=lambda each: view.sources.index(each.source))


def measures_panel(
    view: ArchiveView, title: str, axis: str, found: Sequence[MeasureSeries], convert: Conversion
) -> Panel:
    """Return a panel with a row for each input, and in that a dot for each series."""
    inputs, note = largest_inputs(found)
    height = _FRAME + len(inputs) * (_GAP + _ROW * len(found))
    dots = list(_dots(view, found, inputs, convert))
    return Panel(title, partial(_draw, axis, dots, note), height, inputs)


def largest_inputs(found: Sequence[MeasureSeries]) -> tuple[tuple[str, ...], str]:
    """Return the inputs with the largest estimates, in the study's order, and a note if not all."""
    largest: dict[str, float] = {}
    for each in found:
        sizes = np.nan_to_num(np.abs(each.array.values[:, 0])).tolist()
        for name, size in zip(each.array[INPUT].values.tolist(), sizes, strict=True):
            largest[name] = max(size, largest.get(name, 0.0))
    kept = sorted(largest, key=lambda name: -largest[name])[:_MOST_INPUTS]
    inputs = tuple(name for name in largest if name in kept)
    if len(inputs) == len(largest):
        return inputs, ""
    return inputs, f"the {len(inputs)} inputs with the largest estimates, of {len(largest)}"


def _draw(axis: str, dots: list[EstimateDot], note: str, axes: Axes) -> Iterator[str]:
    axes.axvline(0, color=GREY, linewidth=0.8)
    for row in range(1, len(axes.get_yticks())):
        axes.axhline(row - 0.5, color=GREY, linewidth=0.4, alpha=0.4)
    axes.set_xlabel(axis)
    yield from draw_dots(axes, dots)
    if note:
        yield note


def _dots(
    view: ArchiveView, found: Sequence[MeasureSeries], inputs: tuple[str, ...], convert: Conversion
) -> Iterator[EstimateDot]:
    room = 1 / (len(found) + 1)
    for number, each in enumerate(found):
        known = each.array[INPUT].values.tolist()
        shown = view.look(each.source)
        appearance = SourceStyle(shown.colour, each.marker if each.label else shown.marker, "-")
        label = ", ".join(filter(None, (each.label, each.source)))
        for row, name in enumerate(inputs):
            if name in known and np.isfinite(each.array.values[known.index(name), 0]):
                estimate = each.array[known.index(name)]
                place = row + (number + 1) * room - 0.5
                yield EstimateDot.from_array(estimate, convert, place, appearance, label)
                label = ""
