"""Probability that an output exceeds a value: its tail, on a logarithmic axis."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.charts.axes import ValueAxis, output_axis
from uqpen.charts.chart import Axis, Chart, LegendKey
from uqpen.charts.marks import END, Band, Dots, Line, Mark, end_of_line, escape_text, interval_notes
from uqpen.core.arrays import BoolArray
from uqpen.core.statistic_dimensions import THRESHOLD
from uqpen.figures.curves import Curve
from uqpen.figures.distributions import output_span
from uqpen.report.sections.leading_design import missing_runs_note
from uqpen.report.sections.limit_marks import limit_marks
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import count_text, estimate_text, percent_text
from uqpen.results.empirical_cdf import ExceedanceTail
from uqpen.results.table import OutputTable, exceedance_label
from uqpen.results.texts import unit_suffix

__all__ = ["exceedance"]


# Lower end of the axis, as a multiple of the smallest share of the runs.
_BELOW = 0.3

_NOT_MET = "Larger values may be possible; these runs have met none."


def exceedance(view: ArchiveView, output: str, curve: Curve) -> Iterator[Chart]:
    """The probability of exceeding each value, if any run exceeds another, with the thresholds."""
    tail = ExceedanceTail.of_design(view, curve.name, output, curve.limits)
    values = tail.values
    if not values.size:
        return
    span = output_span(view, output, [values], [values[0], values[-1]])
    least = _BELOW / max(curve.runs, 10)
    traces, keys = _tail_traces(view, output, curve, tail, least)
    probabilities = view.statistics.get(curve.name, output, "exceedance")
    notes = [_NOT_MET, *missing_runs_note(view, curve.name)]
    summary = (
        f"It falls from 1 to the smallest share of {count_text(curve.runs, 'run')} of {curve.name}."
        f" {tail.largest.sentence}"
    )
    tables: tuple[OutputTable, ...] = ()
    if probabilities is not None:
        rows = _rows(probabilities)
        asked = "; ".join(f"{label}: {cells[0]}" for label, cells in rows)
        summary = f"{asked}. {tail.largest.sentence}"
        tables = (OutputTable(f"Requested probabilities, by {curve.name}", [curve.name], rows),)
        is_shown = _is_threshold_shown(view, output, probabilities, span)
        if is_shown.any():
            traces.append(_threshold_trace(view, output, probabilities[is_shown]))
            keys.append(LegendKey("requested in the study", "ink", "circle"))
        notes = [*interval_notes([probabilities[is_shown]]), *notes]
        if hidden := [label for label, _ in _rows(probabilities[~is_shown])]:
            notes.append(f"In the table only: {', '.join(hidden)}.")
    yield Chart(
        title=f"Probability that {output_title(view, output)} is more than x",
        summary=summary,
        x=output_axis(view, output, span),
        y=Axis("P(more than x)", (np.log10(least).item(), 0.0), is_logarithmic=True),
        marks=(*traces, *limit_marks(view, output, span).rules),
        keys=tuple(keys),
        notes=tuple(notes),
        tables=tables,
        height=280,
    )


def _tail_traces(
    view: ArchiveView, output: str, curve: Curve, tail: ExceedanceTail, least: float
) -> tuple[list[Mark], list[LegendKey]]:
    series = view.series(curve.name)
    unit = unit_suffix(view.unit(output))
    # An end at 0 has no logarithm.
    estimate, lower, upper = np.maximum(tail.band, least).T
    function = Line(
        tail.values,
        estimate,
        series,
        hover=f"P(more than %{{x:.4~g}}{escape_text(unit)}) = %{{y:.3~g}}",
        name=curve.name,
        is_stepped=curve.is_stepped,
    )
    largest = f"{tail.largest.name}: {tail.largest.text}"
    end = end_of_line(float(tail.values[-1]), float(estimate[-1]), series, largest)
    keys = [LegendKey(curve.name, series, "line"), LegendKey(largest, series, END)]
    if not curve.has_band:
        return [function, end], keys
    banded = Band(tail.values, lower, upper, series, is_stepped=curve.is_stepped)
    text = f"simultaneous {percent_text(curve.level)} band"
    return [banded, function, end], [LegendKey(text, series, "band"), *keys]


def _is_threshold_shown(
    view: ArchiveView, output: str, probabilities: xr.DataArray, span: ValueAxis
) -> BoolArray:
    """Return for each requested probability whether it has a logarithm, and lies on the axis."""
    places = view.scale(output).from_si(probabilities["threshold_value"].values)
    is_near = np.array([span.contains(place) for place in places.tolist()])
    return np.asarray(is_near & (probabilities.values[:, 0] > 0))


def _threshold_trace(view: ArchiveView, output: str, probabilities: xr.DataArray) -> Mark:
    places = view.scale(output).from_si(probabilities["threshold_value"].values)
    hovers = [f"{label} = {cells[0]}" for label, cells in _rows(probabilities)]
    # An end at 0 has no logarithm.
    bounds = np.where(probabilities.values > 0, probabilities.values, np.nan)
    return Dots(bounds, places, "ink", hovers=hovers, name="requested", along="y")


def _rows(probabilities: xr.DataArray) -> list[tuple[str, list[str]]]:
    labels = [exceedance_label(str(text)) for text in probabilities[THRESHOLD].values]
    return [
        (label, [estimate_text(*row)])
        for label, row in zip(labels, probabilities.values, strict=True)
    ]
