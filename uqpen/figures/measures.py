"""Measures of the inputs' part in an output by source, and a panel of some of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.labels import INPUT
from uqpen.core.statistic import Measure, Statistic
from uqpen.figures.estimate_dots import EstimateDot, draw_dots
from uqpen.figures.panel import Axes, Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.input_measures import without_arbitrary_zeros
from uqpen.results.source_style import GREY, SourceStyle
from uqpen.results.table import Conversion, estimate_remark

__all__ = ["MeasureSeries", "RankedInputs", "measure_series", "measures_panel", "rank_inputs"]


# Inputs that are shown, those with the largest estimates of all.
_MOST_INPUTS = 15
_ROW, _GAP, _FRAME = 0.12, 0.12, 0.75


class MeasureSeries(NamedTuple):
    """One sensitivity measure of all inputs by one source: an array along input and bound.

    It has a label where a chart has several measures.
    """

    source: str
    label: str
    measure: Measure
    array: xr.DataArray


def measure_series(
    view: ArchiveView, output: str, measures: Sequence[Statistic]
) -> list[MeasureSeries]:
    """Return some measures by all sources, without those that have no estimate."""
    found = [
        MeasureSeries(source, each.measure.label if len(measures) > 1 else "", each.measure, array)
        for each in measures
        for source, estimates in view.estimates(output, each.name).items()
        for array in [without_arbitrary_zeros(view.tree, output, each, estimates)]
        if np.isfinite(array.values[:, 0]).any()
    ]
    return sorted(found, key=lambda each: view.sources.index(each.source))


def measures_panel(
    view: ArchiveView,
    title: str,
    axis: str,
    found: Sequence[MeasureSeries],
    convert: Conversion,
    note: str = "",
) -> Panel:
    """Return a panel with a row for each input, and in that a dot for each series."""
    inputs = rank_inputs(found)
    height = _FRAME + len(inputs.names) * (_GAP + _ROW * len(found))
    dots = list(_dots(view, found, inputs.names, convert))
    notes = (*inputs.notes, *filter(None, [note]))
    return Panel(title, partial(_draw, axis, dots, notes), height, inputs.names)


class RankedInputs(NamedTuple):
    """The inputs of a chart, the one with the largest estimate first.

    Attributes
    ----------
    names : tuple of str
        Those that are shown.
    total : int
        How many have an estimate.
    without : mapping of str to str
        Those without an estimate, with the reasons.
    """

    names: tuple[str, ...]
    total: int
    without: Mapping[str, str]

    @property
    def cut(self) -> str:
        """Note on the inputs that are shown, if not all that have an estimate; else empty."""
        if len(self.names) == self.total:
            return ""
        return f"the {len(self.names)} inputs with the largest estimates, of {self.total}"

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the inputs that the chart leaves out."""
        return tuple(filter(None, (self.cut, self.missing)))

    @property
    def missing(self) -> str:
        """Note on the inputs without an estimate, with the reasons; empty for none."""
        by_reason: dict[str, list[str]] = {}
        for name, reason in self.without.items():
            by_reason.setdefault(reason, []).append(name)
        texts = [
            f"{', '.join(names)}{f' ({reason})' * bool(reason)}"
            for reason, names in by_reason.items()
        ]
        return f"not shown: {'; '.join(texts)}" if texts else ""


def rank_inputs(found: Sequence[MeasureSeries]) -> RankedInputs:
    """Return the inputs of a chart by their largest estimates, or Shapley effects if there are any.

    These divide a variance, also where inputs depend on each other.
    """
    dividing = {id(each) for each in found if each.measure.share == "divided"}
    largest: dict[str, float] = {}
    reasons: dict[str, str] = {}
    for each in found:
        sizes = np.nan_to_num(np.abs(each.array.values[:, 0]), nan=-1.0)
        if dividing and id(each) not in dividing:
            sizes = np.minimum(sizes, 0.0)
        for name, size in zip(map(str, each.array[INPUT].values), sizes.tolist(), strict=True):
            largest[name] = max(size, largest.get(name, -1.0))
        for entry in each.array:
            reasons.setdefault(str(entry[INPUT].item()), estimate_remark(entry))
    ranked = sorted(largest, key=lambda name: -largest[name])
    known = [name for name in ranked if largest[name] >= 0]
    without = {name: reasons[name] for name in ranked if name not in known}
    return RankedInputs(tuple(known[:_MOST_INPUTS]), len(known), without)


def _draw(axis: str, dots: list[EstimateDot], notes: tuple[str, ...], axes: Axes) -> Iterator[str]:
    axes.axvline(0, color=GREY, linewidth=0.8)
    for row in range(1, len(axes.get_yticks())):
        axes.axhline(row - 0.5, color=GREY, linewidth=0.4, alpha=0.4)
    axes.set_xlabel(axis)
    yield from draw_dots(axes, dots)
    yield from notes


def _dots(
    view: ArchiveView, found: Sequence[MeasureSeries], inputs: tuple[str, ...], convert: Conversion
) -> Iterator[EstimateDot]:
    room = 1 / (len(found) + 1)
    for number, each in enumerate(found):
        known = each.array[INPUT].values.tolist()
        shown = view.look(each.source)
        appearance = SourceStyle(
            shown.colour, each.measure.marker if each.label else shown.marker, "-"
        )
        label = ", ".join(filter(None, (each.label, each.source)))
        for row, name in enumerate(inputs):
            if name in known and np.isfinite(each.array.values[known.index(name), 0]):
                estimate = each.array[known.index(name)]
                place = row + (number + 1) * room - 0.5
                yield EstimateDot.from_array(estimate, convert, place, appearance, label)
                label = ""
