"""A chart of measures of the inputs' part: a row for each input, a dot for each source."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uqpen.charts.axes import padded_limits
from uqpen.charts.chart import Axis, Chart, LegendKey
from uqpen.charts.marks import (
    Dots,
    Mark,
    Rule,
    has_interval,
    interval_notes,
    key_marker,
    series_marker,
)
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INPUT
from uqpen.core.units import DIMENSIONLESS
from uqpen.figures.measures import MeasureSeries, rank_inputs
from uqpen.results.archive_view import ArchiveView
from uqpen.results.input_ranking import InputOrder, input_label
from uqpen.results.table import (
    Conversion,
    OutputTable,
    estimate_remark,
    shown_bounds,
    shown_estimate,
)
from uqpen.results.texts import capitalized, unit_suffix

__all__ = ["MeasureChartSpec", "measures_chart"]


_MARKERS = {"o": "circle", "s": "square", "D": "diamond", "^": "triangle-up"}
# Heights in CSS pixels: of all but the rows, between rows, and of a dot.
_FRAME, _GAP, _DOT = 62, 14, 11
# Reasons for having no interval that are written out below a chart.
_MOST_REASONS = 3


@dataclass(frozen=True)
class MeasureChartSpec:
    """Content of a chart of measures."""

    title: str
    axis: str
    convert: Conversion  # out of SI units
    # Labels of the measures that the summary may name the largest input by, the better ones first.
    summary_order: tuple[str, ...]
    unit: str = DIMENSIONLESS
    notes: tuple[str, ...] = ()
    order: InputOrder = InputOrder()


class _InputEstimate(NamedTuple):
    """Estimate of a series for an input, in the unit that is shown."""

    name: str
    bounds: FloatArray
    note: str
    written: str  # as in the table

    @property
    def has_interval(self) -> bool:
        return bool(has_interval(self.bounds))

    def text(self, unit: str) -> str:
        return f"{self.written}{unit_suffix(unit)}"


class _PlottedSeries(NamedTuple):
    """Series of a measure with its name, colour and marker, and its estimates by input."""

    of: MeasureSeries
    name: str
    colour: int
    marker: str
    estimates: list[_InputEstimate]


def measures_chart(
    view: ArchiveView,
    found: Sequence[MeasureSeries],
    spec: MeasureChartSpec,
    tables: Sequence[OutputTable] = (),
) -> Chart:
    """A chart of at least one measure, each with at least one estimate."""
    ranked = rank_inputs(found)
    inputs = tuple(spec.order.sort(ranked.names))
    rows = tuple(input_label(view, name) for name in inputs)
    every = [_plotted_series(view, each, inputs, spec.convert) for each in found]
    bounds = np.concatenate([[0.0], *(one.bounds for each in every for one in each.estimates)])
    rules = [Rule(0, "quiet", "dot")]
    rules += [Rule(row - 0.5, "grid", is_horizontal=True) for row in range(1, len(inputs))]
    notes = [*_notes(every), *spec.notes]
    if ranked.cut:
        all_of_them = "; the table has all" if tables else ""
        notes.append(f"Shown are {ranked.cut}{all_of_them}.")
    if ranked.missing:
        notes.append(f"{capitalized(ranked.missing)}.")
    return Chart(
        title=spec.title,
        summary=_summary(every, spec),
        x=Axis(spec.axis, padded_limits(float(np.nanmin(bounds)), float(np.nanmax(bounds)))),
        y=Axis("", rows=rows),
        marks=(*_traces(every, rows, spec.unit), *rules),
        keys=tuple(_keys(every)),
        notes=tuple(notes),
        tables=tuple(tables),
        height=_FRAME + len(inputs) * (_GAP + _DOT * len(found)),
    )


def _plotted_series(
    view: ArchiveView, of: MeasureSeries, inputs: Sequence[str], convert: Conversion
) -> _PlottedSeries:
    """Give a series the colour of its source, and its own marker where there are several."""
    position, known = view.series(of.source), of.array[INPUT].values.tolist()
    entries = {name: of.array[known.index(name)] for name in inputs if name in known}
    estimates = [
        _InputEstimate(
            input_label(view, name),
            np.array(shown_bounds(entry, convert)),
            estimate_remark(entry),
            shown_estimate(entry, convert),
        )
        for name, entry in entries.items()
        if np.isfinite(entry.values[0])
    ]
    if of.label:
        name, marker = f"{of.label} by {of.source}", _MARKERS[of.marker]
    else:
        name, marker = of.source, series_marker(position)
    return _PlottedSeries(of, name, position, marker, estimates)


def _traces(every: Sequence[_PlottedSeries], rows: Sequence[str], unit: str) -> Iterator[Mark]:
    room = 1 / (len(every) + 1)
    for number, (_, name, colour, marker, estimates) in enumerate(every, 1):
        if not estimates:
            continue
        places = np.array([rows.index(one.name) + number * room - 0.5 for one in estimates])
        bounds = np.array([one.bounds for one in estimates])
        hovers = [_hover(one, name, unit) for one in estimates]
        yield Dots(bounds, places, colour, hovers=hovers, name=name, marker=marker)


def _hover(one: _InputEstimate, series: str, unit: str) -> str:
    text = f"{one.name}, {series}: {one.text(unit)}"
    return f"{text} ({one.note})" if one.note else text


def _keys(every: Sequence[_PlottedSeries]) -> Iterator[LegendKey]:
    for _, name, colour, marker, estimates in every:
        if estimates:
            marker = key_marker(marker, np.array([one.bounds for one in estimates]))
        yield LegendKey(name, colour, marker)


def _notes(every: Sequence[_PlottedSeries]) -> Iterator[str]:
    named = [(each.name, one) for each in every for one in each.estimates]
    yield from interval_notes((each.of.array for each in every), ", for each estimate by itself")
    barred = [(name, one) for name, one in named if one.has_interval]
    for text, names in _names_by_text((name, one.note) for name, one in barred if one.note).items():
        yield f"Note on {', '.join(names)}: {text}."
    hollow = (
        (name, one.note or "no reason is known") for name, one in named if not one.has_interval
    )
    reasons = _names_by_text(hollow)
    if len(reasons) > _MOST_REASONS:
        yield "Hollow: no interval; the reasons are notes of the table."
    else:
        for text, names in reasons.items():
            yield f"Hollow, no interval: {', '.join(names)} ({text})."


def _names_by_text(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """Return the names that each text applies to, each once."""
    found: dict[str, list[str]] = {}
    for name, text in pairs:
        names = found.setdefault(text, [])
        if name not in names:
            names.append(name)
    return found


def _summary(every: Sequence[_PlottedSeries], spec: MeasureChartSpec) -> str:
    """Return a sentence on the largest estimate and on the intervals that overlap with it."""
    each, label = _summary_series(every, spec.summary_order)
    first, *others = sorted(each.estimates, key=lambda one: -float(one.bounds[0]))
    text = f"By {each.of.source}, {first.name} has the largest {label}: {first.text(spec.unit)}"
    if others:
        text += f"; {others[0].name} comes next: {others[0].text(spec.unit)}"
    return f"{text}.{_order_certainty(first, others)}"


def _summary_series(
    every: Sequence[_PlottedSeries], order: Sequence[str]
) -> tuple[_PlottedSeries, str]:
    """Return the series for the summary: one with intervals if any has."""
    labelled = ((each, each.of.label or order[0]) for each in every if each.estimates)

    def rank(entry: tuple[_PlottedSeries, str]) -> tuple[bool, int]:
        each, label = entry
        return not all(one.has_interval for one in each.estimates), order.index(label)

    return min((entry for entry in labelled if entry[1] in order), key=rank)


def _order_certainty(first: _InputEstimate, others: Sequence[_InputEstimate]) -> str:
    """Return a sentence on the order of the first input and the others, by their intervals."""
    every = (first, *others)
    if not others:
        return ""
    if not any(one.has_interval for one in every):
        return " None has an interval, so this order is uncertain."
    if not all(np.isfinite(one.bounds).all() for one in every):
        return " Not all have an interval, so this order is uncertain."
    near = [one.name for one in others if one.bounds[2] >= first.bounds[1]]
    remark = f" Note on this interval: {first.note}." if first.note else ""
    if not near:
        return f" Its interval overlaps with no other's.{remark}"
    names = ", ".join(near)
    return f" Its interval overlaps with that of {names}, so this order is uncertain.{remark}"
