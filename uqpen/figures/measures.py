"""Measures of the inputs' part in an output: who tells which, and a panel of some of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.figures.estimates import Dot, draw_dots
from uqpen.figures.panel import Panel
from uqpen.figures.part import Part
from uqpen.figures.style import GREY, Look
from uqpen.labels import INPUT, SENSITIVITY
from uqpen.summary.table import Conversion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Series", "panel_of", "series", "shown_inputs"]

FloatArray = npt.NDArray[np.float64]

# Inputs that are shown, those with the largest estimates of all.
_MOST_INPUTS = 15
_ROW, _GAP, _FRAME = 0.12, 0.12, 0.75


class Series(NamedTuple):
    """One measure of all inputs, told by one source; an array along input and bound."""

    source: str
    label: str
    marker: str
    array: xr.DataArray


def series(part: Part, output: str, measures: Sequence[tuple[str, str, str]]) -> list[Series]:
    """What all sources tell of some measures.

    Parameters
    ----------
    part : Part
    output : str
    measures : sequence of tuple
        How each one's variable's name ends, what a person reads, and its marker.
    """
    return [
        Series(source, label, marker, told[f"{output}_{suffix}"])
        for source, told in part.told(SENSITIVITY)
        for suffix, label, marker in measures
        if f"{output}_{suffix}" in told
        and np.isfinite(told[f"{output}_{suffix}"].values[:, 0]).any()
    ]


def panel_of(
    part: Part,
    title: str,
    axis: str,
    found: Sequence[Series],
    convert: Conversion,
) -> Panel:
    """A panel with a row for each input, and in that a dot for each series."""
    inputs, note = shown_inputs(found)
    height = _FRAME + len(inputs) * (_GAP + _ROW * len(found))
    draw = partial(_draw, part, axis, found, inputs, note, convert)
    return Panel(title, draw, height, inputs)


def shown_inputs(found: Sequence[Series]) -> tuple[tuple[str, ...], str]:
    """The inputs with the largest estimates, in the study's order, and what is said if not all."""
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


def _draw(
    part: Part,
    axis: str,
    found: Sequence[Series],
    inputs: tuple[str, ...],
    note: str,
    convert: Conversion,
    axes: Axes,
) -> Iterator[str]:
    axes.axvline(0, color=GREY, linewidth=0.8)
    for row in range(1, len(inputs)):
        axes.axhline(row - 0.5, color=GREY, linewidth=0.4, alpha=0.4)
    axes.set_xlabel(axis)
    yield from draw_dots(axes, list(_dots(part, found, inputs, convert)))
    if note:
        yield note


def _dots(
    part: Part,
    found: Sequence[Series],
    inputs: tuple[str, ...],
    convert: Conversion,
) -> Iterator[Dot]:
    room = 1 / (len(found) + 1)
    for number, each in enumerate(found):
        known = each.array[INPUT].values.tolist()
        shown = part.look(each.source)
        appearance = Look(shown.colour, each.marker if each.label else shown.marker, "-")
        label = ", ".join(filter(None, (each.label, each.source)))
        for row, name in enumerate(inputs):
            if name in known and np.isfinite(each.array.values[known.index(name), 0]):
                figure = each.array[known.index(name)]
                place = row + (number + 1) * room - 0.5
                yield Dot.of(figure, convert, place, appearance, label)
                label = ""
