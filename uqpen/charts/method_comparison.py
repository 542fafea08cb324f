"""Methods at equal budgets: errors against runs, the rates at which they fall, and coverage."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from uqpen.charts.axes import logarithmic_axis, padded_limits
from uqpen.charts.chart import Axis, Chart, LegendKey
from uqpen.charts.marks import Band, Dots, Line, Mark, Points, Rule, Shade, series_marker
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INTERVAL_LEVEL, REPLICATED, SINGLE
from uqpen.results.archive_view import ArchiveView, output_heading
from uqpen.results.digits import estimate_text, grouped_number, percent_text
from uqpen.results.method_comparison import (
    IS_DOUBTFUL,
    IS_LEVEL,
    WINS,
    ComparedEntry,
    ComparedMethod,
    MethodComparison,
    lowest_expected_coverage,
    percentage_text,
    reference_remarks,
    replicated_verdicts,
    standing_mark,
)
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import capitalized, unit_suffix

_GUIDE = "1/√runs"
_FEW_DECIDE = "no interval, as few of the repeats decide this error"
_HOLLOW = "Hollow: no interval, as few of the repeats decide the error."
# Beside the fewest and the most runs, as a power of ten; between markers at the same number of
# runs, as a factor.
_FREE, _APART = 0.1, 1.035

_VARIANT_TEXTS = {SINGLE: "as single sets", REPLICATED: "in replicates"}
# Pixels of a row, of each method in it, and of what is around all rows.
_ROW_HEIGHT, _METHOD_HEIGHT, _FRAME = 10, 11, 80

# Slope of Monte Carlo.
_MONTE_CARLO_SLOPE = -0.5
_NO_INTERVAL = "no interval, as few of the repeats decide one of its errors"
_NO_SLOPE = "a slope needs errors at two numbers of runs, none of them 0"
SLOPE_NOTE = "Dashed: −0.5, as errors fall with 1/√runs."


# Of figures.


def error_charts(view: ArchiveView) -> Iterator[Chart]:
    """Error of each method against runs, with intervals."""
    comparison = MethodComparison(view)
    for entry in comparison.entries:
        if chart := error_chart(entry, SINGLE):
            notes = [
                "Bars: 95 % intervals of the error over the repeats.",
                *(note for note in chart.notes if note == _HOLLOW),
                "Errors are relative to the reference, or to the standard deviation where that is "
                "about 0.",
            ]
            keys = (*method_keys(comparison.methods_in(SINGLE)), *error_keys([chart]))
            yield replace(chart, keys=keys, notes=tuple(notes))


def slope_charts(view: ArchiveView) -> Iterator[Chart]:
    """Rate at which each method's errors fall with the runs."""
    comparison = MethodComparison(view)
    for chart in of_slopes(comparison, SINGLE):
        keys = method_keys(comparison.methods_in(SINGLE))
        yield replace(chart, keys=keys, notes=(SLOPE_NOTE, *chart.notes))


def coverage_charts(view: ArchiveView) -> Iterator[Chart]:
    """Coverage of the methods' own intervals."""
    comparison = MethodComparison(view)
    for chart in of_coverage(comparison, SINGLE):
        keys = method_keys(comparison.methods_in(SINGLE))
        yield replace(chart, keys=keys, notes=(coverage_note(comparison),))


# Errors against runs.


def error_chart(entry: ComparedEntry, variant: str) -> Chart | None:
    """Return the errors of an entry in one of the comparisons; None where no method has any."""
    methods, budgets = entry.comparison.methods_in(variant), entry.comparison.budgets
    errors = 100 * np.array([entry.of(method, "error").values for method in methods])
    # A logarithmic axis has no place for an error of 0.
    errors = np.where(np.isfinite(errors) & (errors > 0), errors, np.nan)
    if not np.isfinite(errors[..., 0]).any():
        return None
    runs, own = np.array(budgets, dtype=np.float64), entry.reference_error
    axis = logarithmic_axis("error [%]", errors[np.isfinite(errors)].tolist())
    lower = 10.0 ** axis.ends[0] if axis.ends else 0.0
    marks: list[Mark] = []
    if own > lower:
        marks.append(Band((runs[0] / 2, runs[-1] * 2), [lower / 10] * 2, [own] * 2, "quiet"))
    # A line that falls with the root of the runs, from the largest error at the fewest.
    first = int(np.argmax(np.isfinite(errors[..., 0]).any(axis=0)))
    if first + 1 < runs.size:
        fall = float(np.nanmax(errors[:, first, 0])) * np.sqrt(runs[first] / runs[first:])
        marks.append(Line(runs[first:], fall, "quiet", _GUIDE, _GUIDE, dash="dot", width=1.5))
    for place, (method, bounds) in enumerate(zip(methods, errors, strict=True)):
        hovers = [
            f"{method.source}, {grouped_number(budget)} runs: {estimate_text(*row)} %"
            + ("" if math.isfinite(sum(row[1:])) else f"; {_FEW_DECIDE}")
            for budget, row in zip(budgets, bounds.tolist(), strict=True)
        ]
        places = runs * _APART ** (place - (len(methods) - 1) / 2)
        marker = series_marker(method.series)
        dots = Dots(
            bounds, places, method.series, hovers, method.source, marker, "y", is_joined=True
        )
        marks.append(dots)
    last = [
        f"{method.source} {estimate_text(*bounds[-1])} %"
        for method, bounds in zip(methods, errors.tolist(), strict=True)
        if math.isfinite(bounds[-1][0])
    ]
    return Chart(
        title=f"{entry.label}: {entry.reference_text}",
        summary=f"Errors at {grouped_number(budgets[-1])} runs: {'; '.join(last) or 'none'}.",
        x=Axis(
            "runs",
            (math.log10(budgets[0]) - _FREE, math.log10(budgets[-1]) + _FREE),
            ticks=tuple((float(budget), grouped_number(budget)) for budget in budgets),
            is_logarithmic=True,
        ),
        y=axis,
        marks=tuple(marks),
        notes=tuple(_error_notes(entry, variant, errors, lower)),
        tables=(_error_table(entry, variant),),
        of=entry.output,
    )


def error_keys(charts: Sequence[Chart]) -> Iterator[LegendKey]:
    """Yield the entries of a legend besides the methods."""
    marks = [mark for chart in charts for mark in chart.marks]
    if any(isinstance(mark, Line) for mark in marks):
        yield LegendKey(_GUIDE, "quiet", "line", "dot")
    if any(isinstance(mark, Band) for mark in marks):
        yield LegendKey("no larger than the reference's own error", "quiet", "band")


def method_keys(methods: Sequence[ComparedMethod]) -> tuple[LegendKey, ...]:
    """Return the legend's entries of methods."""
    return tuple(LegendKey(m.source, m.series, series_marker(m.series)) for m in methods)


def _error_notes(
    entry: ComparedEntry, variant: str, errors: FloatArray, lower: float
) -> Iterator[str]:
    scale, reference = entry.error_scale, abs(float(entry.reference.values[0]))
    if not math.isclose(scale, reference) and math.isfinite(reference):
        if not reference and scale == 1:
            yield f"Errors are in % of 1{unit_suffix(entry.units)}, as the reference is 0."
        else:
            yield "Errors are in % of the standard deviation, as the reference is about 0."
    if (np.isfinite(errors[..., 0]) & ~np.isfinite(errors[..., 1:]).all(axis=-1)).any():
        yield _HOLLOW
    for method in entry.comparison.methods_in(variant):
        values = entry.of(method, "error").values[:, 0].tolist()
        pairs = zip(entry.comparison.budgets, values, strict=True)
        if where := [grouped_number(budget) for budget, value in pairs if value == 0]:
            runs = ", ".join(where)
            yield f"{method.source} is exact at {runs} runs; this axis has no place for 0."
    own = entry.reference_error
    shown = f"The reference's own error, {percentage_text(own / 100)} %,"
    if math.isfinite(own) and own <= lower:
        yield f"{shown} is below this axis."
    elif own >= float(np.nanmax(errors[..., 0])):
        yield f"{shown} is as large as any of these."
    remarks = replicated_verdicts if variant == REPLICATED else reference_remarks
    yield from (f"{capitalized(remark)}." for remark in remarks(entry))


def _error_table(entry: ComparedEntry, variant: str) -> OutputTable:
    title = "Errors in %, with their 95 % intervals"
    if variant == SINGLE:
        title += f"; {WINS} leads, {IS_LEVEL} is level with the best, {IS_DOUBTFUL} is uncertain"
    table = OutputTable(title, [*map(grouped_number, entry.comparison.budgets)])
    for method in entry.comparison.methods_in(variant):
        errors = (100 * entry.of(method, "error").values).tolist()
        cells = []
        for bounds, standing in zip(errors, entry.single_set_standings, strict=True):
            text = NOTHING if math.isnan(bounds[0]) else estimate_text(*bounds)
            mark = standing_mark(method.source, *standing) if variant == SINGLE else ""
            has_interval = math.isfinite(bounds[1]) and math.isfinite(bounds[2])
            note = "" if has_interval or not bounds[0] or math.isnan(bounds[0]) else _FEW_DECIDE
            cells.append(f"{text} {mark}".strip() + table.note_mark(note))
        table.rows.append((method.source, cells))
    return table


# A row for each statistic, and the methods in it.


def of_slopes(comparison: MethodComparison, variant: str) -> Iterator[Chart]:
    """Yield the slopes of each output in one of the comparisons."""
    methods = comparison.methods_in(variant)
    for chart, found, slopes, places in _rows(comparison, variant, "slope", "Slopes of"):
        is_known, has_interval = np.isfinite(slopes[..., 0]), np.isfinite(slopes).all(axis=-1)
        # An axis with all intervals, a slope of 0, and that of Monte Carlo.
        shown = slopes[has_interval] if has_interval.any() else slopes[is_known, :1]
        lower, upper = padded_limits(
            min(float(shown.min()), _MONTE_CARLO_SLOPE), max(float(shown.max()), 0.0), 0.05
        )
        is_outside = is_known & ((slopes[..., 0] < lower) | (slopes[..., 0] > upper))
        outside = [
            f"{found[row].label} by {methods[at].source} {slopes[row, at, 0]:.2f}"
            for row, at in zip(*np.nonzero(is_outside), strict=True)
        ]
        notes = [f"Outside of the axis: {', '.join(outside)}."] if outside else []
        if (is_known & ~has_interval).any():
            notes.append("Hollow: no interval, as few of the repeats decide an error on the line.")
        steepest = [
            f"{entry.label}: steepest by {methods[at].source}, {estimate_text(*row[at])}"
            for entry, row in zip(found, slopes, strict=True)
            for at in ([int(np.nanargmin(row[:, 0]))] if np.isfinite(row[:, 0]).any() else [])
        ]
        dots = []
        for at, method in enumerate(methods):
            hovers = [
                f"{method.source}, {entry.label}: {estimate_text(*row)}"
                + ("" if np.isfinite(row).all() else f"; {_NO_INTERVAL}")
                for entry, row in zip(found, slopes[:, at], strict=True)
            ]
            marker = series_marker(method.series)
            dots.append(
                Dots(slopes[:, at], places[at], method.series, hovers, method.source, marker)
            )
        yield replace(
            chart,
            summary="; ".join(steepest),
            x=Axis("slope of log error over log runs", (lower, upper)),
            marks=(Rule(_MONTE_CARLO_SLOPE, "quiet", "dash"), *dots),
            notes=tuple(notes),
            tables=(_slope_table(found, methods, slopes),),
        )


def _slope_table(
    found: Sequence[ComparedEntry], methods: Sequence[ComparedMethod], slopes: FloatArray
) -> OutputTable:
    table = OutputTable("Slopes, with their 95 % intervals", [m.source for m in methods])
    for entry, row in zip(found, slopes.tolist(), strict=True):
        cells = []
        for bounds in row:
            has_interval = math.isfinite(bounds[1]) and math.isfinite(bounds[2])
            note = _NO_SLOPE if math.isnan(bounds[0]) else "" if has_interval else _NO_INTERVAL
            cells.append(estimate_text(*bounds) + table.note_mark(note))
        table.rows.append((entry.label, cells))
    return table


def of_coverage(comparison: MethodComparison, variant: str) -> Iterator[Chart]:
    """Yield the coverage of the methods' own intervals of each output, likewise."""
    if not comparison.entries:
        return
    methods, budgets = comparison.methods_in(variant), list(map(grouped_number, comparison.budgets))
    level = _nominal_level(comparison)
    least = lowest_expected_coverage(level, comparison.repeats)
    behind = Shade(100 * least, 100, "quiet"), Rule(100 * level, "quiet", "dash")
    for chart, found, shares, places in _rows(comparison, variant, "coverage", "Intervals of"):
        points = []
        for at, method in enumerate(methods):
            rows, columns = np.nonzero(np.isfinite(shares[:, at]))
            known = 100 * shares[rows, at, columns]
            texts = [
                f"{method.source}, {found[row].label}, {budgets[column]} runs: "
                f"coverage {share:.1f} %"
                for row, column, share in zip(rows, columns, known, strict=True)
            ]
            mark = Points(known, places[at][rows], method.series, "%{text}", method.source, texts)
            points.append(replace(mark, marker=series_marker(method.series), size=7))
        table = OutputTable("Coverage of the reference, in %", budgets)
        for entry, of_entry in zip(found, shares.tolist(), strict=True):
            for method, row in zip(methods, of_entry, strict=True):
                cells = [NOTHING if math.isnan(share) else f"{100 * share:.0f}" for share in row]
                table.rows.append((f"{entry.label}, {method.source}", cells))
        ends = np.nanmin(shares), np.nanmax(shares)
        lowest, highest = (percent_text(round(float(share), 3)) for share in ends)
        yield replace(
            chart,
            summary=f"The coverage is between {lowest} and {highest}; it should be "
            f"{percent_text(level)}.",
            x=Axis("coverage [%]", (min(78.0, 100 * ends[0]) - 2, 102)),
            marks=(*behind, *points),
            tables=(table,),
        )


# A chart without marks, its entries, the values of each by each method, and the places of each
# method's marks.
_Rows = tuple[Chart, Sequence[ComparedEntry], FloatArray, FloatArray]


def _rows(comparison: MethodComparison, variant: str, what: str, title: str) -> Iterator[_Rows]:
    """Yield the rows of a chart for each output that has any values."""
    methods = comparison.methods_in(variant)
    taken = f", {_VARIANT_TEXTS[variant]}" if len(comparison.variants) > 1 else ""
    for output, found in comparison.by_output.items():
        values = np.array([[each.of(m, what).values for m in methods] for each in found])
        if not np.isfinite(values).any():
            continue
        height = _FRAME + (_ROW_HEIGHT + _METHOD_HEIGHT * max(2, len(methods))) * len(found)
        chart = Chart(
            f"{title} {output_heading(comparison.view, output)}{taken}",
            summary="",
            x=Axis(""),
            y=Axis("", rows=tuple(entry.label for entry in found)),
            marks=(),
            height=height,
            of=output,
        )
        # One below the other in each row.
        shifts = (np.arange(len(methods)) - (len(methods) - 1) / 2) * 0.8 / len(methods)
        yield chart, found, values, np.arange(len(found)) + shifts[:, np.newaxis]


def coverage_note(comparison: MethodComparison) -> str:
    """Return what charts of coverage show besides, and which shares are as they should be."""
    level, repeats = _nominal_level(comparison), comparison.repeats
    least = f"{100 * lowest_expected_coverage(level, repeats):.0f} %"
    return (
        f"Each marker is for one number of runs. Shaded: shares from {least}, which {repeats} "
        f"intervals with a coverage of {percent_text(level)} may well have by chance. Estimates "
        f"without an interval do not count, so a share may be from fewer than {repeats}."
    )


def _nominal_level(comparison: MethodComparison) -> float:
    """Return the nominal level of the methods' own intervals: that of the reference's."""
    references = (entry.reference.attrs for entry in comparison.entries)
    return float(
        next((each[INTERVAL_LEVEL] for each in references if INTERVAL_LEVEL in each), 0.95)
    )
