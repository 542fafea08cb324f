"""A chart of measures of the inputs' part: a row for each input, a dot for each source."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.estimates import interval_text
from uqpen.core.labels import CHECKED, INPUT, INTERVAL_LABEL, REFUSED, UNCHECKED
from uqpen.core.units import DIMENSIONLESS
from uqpen.figures.measures import MeasureSeries, largest_inputs
from uqpen.report.axes import padded_limits
from uqpen.report.blocks import Axis, Chart, LegendKey
from uqpen.report.marks import Trace, cross_trace, dot_trace, series_marker
from uqpen.report.notes import has_interval, interval_notes
from uqpen.report.shapes import Shape, horizontal_line, vertical_line
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text
from uqpen.results.table import Conversion, OutputTable, estimate_remark
from uqpen.results.texts import unit_suffix

__all__ = ["MeasureChartSpec", "measures_chart"]

FloatArray = npt.NDArray[np.float64]

_MARKERS = {"o": "circle", "s": "square", "D": "diamond", "^": "triangle-up"}
_VERDICTS = (CHECKED, REFUSED, UNCHECKED)
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


class _InputEstimate(NamedTuple):
    """Estimate of a series for an input, in the unit that is shown."""

    name: str
    bounds: FloatArray
    label: str
    note: str

    @property
    def has_interval(self) -> bool:
        return bool(has_interval(self.bounds))

    def text(self, unit: str) -> str:
        return f"{estimate_text(*self.bounds.tolist())}{unit_suffix(unit)}"


def measures_chart(
    view: ArchiveView,
    found: Sequence[MeasureSeries],
    spec: MeasureChartSpec,
    tables: Sequence[OutputTable] = (),
) -> Chart:
    """A chart of at least one measure, each with at least one estimate."""
    inputs, cut = largest_inputs(found)
    estimates = [_estimates(each.array, inputs, spec.convert) for each in found]
    shapes: list[Shape] = [vertical_line(0, "quiet", "dot")]
    shapes += [horizontal_line(row - 0.5, "grid") for row in range(1, len(inputs))]
    notes = [*_notes(found, estimates), *spec.notes]
    if cut:
        notes.append(f"Shown are {cut}; the table has all." if tables else f"Shown are {cut}.")
    return Chart(
        title=spec.title,
        summary=_summary(found, estimates, spec),
        x=Axis(spec.axis, _axis_limits(estimates)),
        y=Axis("", rows=inputs),
        traces=tuple(_traces(view, found, estimates, inputs, spec)),
        shapes=tuple(shapes),
        keys=tuple(_keys(view, found, estimates)),
        notes=tuple(notes),
        tables=tuple(tables),
        height=_FRAME + len(inputs) * (_GAP + _DOT * len(found)),
    )


def _estimates(
    array: xr.DataArray, inputs: Sequence[str], convert: Conversion
) -> list[_InputEstimate]:
    known = array[INPUT].values.tolist()
    return [
        _InputEstimate(
            name,
            np.asarray(convert(estimate.values), dtype=np.float64),
            interval_text(estimate, INTERVAL_LABEL),
            estimate_remark(estimate),
        )
        for name in inputs
        if name in known and np.isfinite((estimate := array[known.index(name)]).values[0])
    ]


def _axis_limits(estimates: Sequence[Sequence[_InputEstimate]]) -> tuple[float, float]:
    every = np.concatenate([[0.0], *(one.bounds for each in estimates for one in each)])
    return padded_limits(float(np.nanmin(every)), float(np.nanmax(every)))


def _series_style(view: ArchiveView, each: MeasureSeries) -> tuple[int, str]:
    """Colour and marker: of the source, or of the measure where there are several."""
    position = view.sources.index(each.source)
    return position, _MARKERS[each.marker] if each.label else series_marker(position)


def _series_name(each: MeasureSeries) -> str:
    return f"{each.label} by {each.source}" if each.label else each.source


def _traces(
    view: ArchiveView,
    found: Sequence[MeasureSeries],
    estimates: Sequence[Sequence[_InputEstimate]],
    inputs: Sequence[str],
    spec: MeasureChartSpec,
) -> Iterator[Trace]:
    room = 1 / (len(found) + 1)
    for number, (each, input_estimates) in enumerate(zip(found, estimates, strict=True)):
        if not input_estimates:
            continue
        places = [inputs.index(one.name) + (number + 1) * room - 0.5 for one in input_estimates]
        bounds = np.array([one.bounds for one in input_estimates])
        colour, marker = _series_style(view, each)
        hovers = [_hover(one, each, spec.unit) for one in input_estimates]
        name = _series_name(each)
        yield dot_trace(bounds, places, colour, hovers=hovers, name=name, marker=marker)
        refused = [at for at, one in enumerate(input_estimates) if one.label == REFUSED]
        if refused:
            yield cross_trace(bounds[refused, 0], np.array(places)[refused], f"{name}, refused")


def _hover(one: _InputEstimate, each: MeasureSeries, unit: str) -> str:
    text = f"{one.name}, {_series_name(each)}: {one.text(unit)}"
    verdict = one.label if one.label in _VERDICTS else ""
    known = ", ".join(filter(None, (verdict, one.note)))
    return f"{text} ({known})" if known else text


def _keys(
    view: ArchiveView, found: Sequence[MeasureSeries], estimates: Sequence[Sequence[_InputEstimate]]
) -> Iterator[LegendKey]:
    every = [one for each in estimates for one in each]
    for each, input_estimates in zip(found, estimates, strict=True):
        colour, marker = _series_style(view, each)
        is_hollow = input_estimates and not any(one.has_interval for one in input_estimates)
        yield LegendKey(_series_name(each), colour, f"{marker}-open" if is_hollow else marker)
    if any(one.label == REFUSED for one in every):
        yield LegendKey("refused", "ink", "x")


def _notes(
    found: Sequence[MeasureSeries], estimates: Sequence[Sequence[_InputEstimate]]
) -> Iterator[str]:
    every = [
        (_series_name(each), one)
        for each, input_estimates in zip(found, estimates, strict=True)
        for one in input_estimates
    ]
    yield from interval_notes((each.array for each in found), ", of each estimate by itself")
    barred = [(name, one) for name, one in every if one.has_interval]
    for text, names in _names_by_text((name, one.note) for name, one in barred if one.note).items():
        yield f"Of the intervals of {', '.join(names)}: {text}."
    hollow = ((name, _missing_interval_reason(one)) for name, one in every if not one.has_interval)
    reasons = _names_by_text(hollow)
    if len(reasons) > _MOST_REASONS:
        yield "Hollow: no interval; the notes of the table say why."
    else:
        for text, names in reasons.items():
            yield f"Hollow, without an interval: {', '.join(names)} ({text})."
    if any(one.label == REFUSED for _, one in every):
        yield "Crossed out: refused, as independent runs contradict it."


def _names_by_text(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """Return the names that each text applies to, each once."""
    found: dict[str, list[str]] = {}
    for name, text in pairs:
        names = found.setdefault(text, [])
        if name not in names:
            names.append(name)
    return found


def _missing_interval_reason(one: _InputEstimate) -> str:
    if one.label in _VERDICTS:
        return f"{one.label}: {one.note}"
    return one.note or "none is told"


def _summary(
    found: Sequence[MeasureSeries],
    estimates: Sequence[Sequence[_InputEstimate]],
    spec: MeasureChartSpec,
) -> str:
    """Return which input has the largest estimate, and whether intervals overlap with it."""
    input_estimates, each, label = _summary_series(found, estimates, spec)
    ordered = sorted(input_estimates, key=lambda one: -float(one.bounds[0]))
    first, *others = ordered
    text = f"By {each.source}, {first.name} has the largest {label}: {first.text(spec.unit)}"
    if others:
        text += f"; that of {others[0].name} comes next: {others[0].text(spec.unit)}"
    verdict = " It is refused, as independent runs contradict it." * (first.label == REFUSED)
    return f"{text}.{verdict}{_order_certainty(first, others)}"


def _summary_series(
    found: Sequence[MeasureSeries],
    estimates: Sequence[Sequence[_InputEstimate]],
    spec: MeasureChartSpec,
) -> tuple[Sequence[_InputEstimate], MeasureSeries, str]:
    """Return the series for the summary: one with intervals if any has, else one not refused."""
    ranked = []
    for position, (each, input_estimates) in enumerate(zip(found, estimates, strict=True)):
        label = each.label or spec.summary_order[0]
        if input_estimates and label in spec.summary_order:
            lacks = not all(one.has_interval for one in input_estimates)
            is_refused = any(one.label == REFUSED for one in input_estimates)
            rank = (lacks, is_refused, spec.summary_order.index(label), position)
            ranked.append((rank, (input_estimates, each, label)))
    return min(ranked, key=lambda entry: entry[0])[1]


def _order_certainty(first: _InputEstimate, others: Sequence[_InputEstimate]) -> str:
    """Return what the intervals say of the order of the first and all others."""
    every = (first, *others)
    if not others:
        return ""
    if not any(one.has_interval for one in every):
        return " None has an interval, so nothing tells how sure this order is."
    if not all(np.isfinite(one.bounds).all() for one in every):
        return " Not all have an interval, so nothing tells how sure this order is."
    near = [one.name for one in others if one.bounds[2] >= first.bounds[1]]
    remark = f" Of it must be known: {first.note}." if first.note else ""
    if not near:
        return f" Its interval overlaps with no other's.{remark}"
    names = ", ".join(near)
    return (
        f" Its interval overlaps with that of {names}, which leaves open which is larger.{remark}"
    )
