"""Rates at which errors fall with the runs."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.charts.axes import padded_limits
from uqpen.charts.chart import Axis, Block, Chart, Charts
from uqpen.charts.marks import Dots, Mark, Rule, series_marker
from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import SINGLE
from uqpen.report.benchmark.row_charts import (
    chart_height,
    method_positions,
    method_values,
    omitted_charts_note,
    variant_text,
)
from uqpen.report.benchmark.section_elements import (
    MOST_CHARTS,
    benchmark_output_heading,
    entries_by_output,
    method_keys,
    variants,
)
from uqpen.results.benchmark_entries import BenchmarkEntry
from uqpen.results.benchmark_methods import ArchivedMethod, benchmark_methods
from uqpen.results.digits import estimate_text
from uqpen.results.table import OutputTable

__all__ = ["convergence_rates"]


# Slope of Monte Carlo.
_MONTE_CARLO_SLOPE = -0.5
_NO_INTERVAL = "no interval, as few of the repeats decide one of its errors"
_NO_SLOPE = "a slope needs errors at two numbers of runs, none of them 0"


def convergence_rates(tree: xr.DataTree) -> Iterator[Block]:
    """Slopes with their intervals."""
    charts = [
        _slope_chart(tree, output, variant, found)
        for variant in variants(tree)
        for output, found in entries_by_output(tree).items()
        if np.isfinite(method_values(tree, variant, found, "slope")[..., 0]).any()
    ]
    if charts:
        yield Charts(
            tuple(charts[:MOST_CHARTS]),
            keys=method_keys(benchmark_methods(tree, SINGLE)),
            notes=("Dashed: −0.5, as errors fall with 1/√runs.", *omitted_charts_note(charts)),
        )


def _slope_chart(
    tree: xr.DataTree, output: str, variant: str, found: list[BenchmarkEntry]
) -> Chart:
    slopes = method_values(tree, variant, found, "slope")
    methods = benchmark_methods(tree, variant)
    has_interval = np.asarray(np.isfinite(slopes).all(axis=-1))
    lower, upper = _axis_limits(slopes, has_interval)
    outside = [
        f"{found[row].label} by {methods[at].source} {slopes[row, at, 0]:.2f}"
        for row, at in zip(*np.nonzero(_is_outside(slopes, lower, upper)), strict=True)
    ]
    notes = [f"Outside of the axis: {', '.join(outside)}."] if outside else []
    if (np.isfinite(slopes[..., 0]) & ~has_interval).any():
        notes.append("Hollow: no interval, as few of the repeats decide an error on the line.")
    return Chart(
        title=f"Slopes of {benchmark_output_heading(tree, output)}{variant_text(tree, variant)}",
        summary="; ".join(_steepest_sentences(found, methods, slopes)),
        x=Axis("slope of log error over log runs", (lower, upper)),
        y=Axis("", rows=tuple(entry.label for entry in found)),
        marks=(
            Rule(_MONTE_CARLO_SLOPE, "quiet", "dash"),
            *(
                _dots(method, slopes[:, at], found, method_positions(at, len(methods), len(found)))
                for at, method in enumerate(methods)
            ),
        ),
        notes=tuple(notes),
        tables=(_slope_table(found, methods, slopes),),
        height=chart_height(len(methods), len(found)),
    )


def _axis_limits(slopes: FloatArray, has_interval: BoolArray) -> tuple[float, float]:
    """Return the limits of an axis with all intervals, a slope of 0, and that of Monte Carlo."""
    shown = slopes[has_interval] if has_interval.any() else slopes[np.isfinite(slopes[..., 0]), :1]
    lower, upper = min(float(shown.min()), _MONTE_CARLO_SLOPE), max(float(shown.max()), 0.0)
    return padded_limits(lower, upper, 0.05)


def _is_outside(slopes: FloatArray, lower: float, upper: float) -> BoolArray:
    with np.errstate(invalid="ignore"):
        outside: BoolArray = (slopes[..., 0] < lower) | (slopes[..., 0] > upper)
    return outside


def _steepest_sentences(
    found: list[BenchmarkEntry], methods: list[ArchivedMethod], slopes: FloatArray
) -> Iterator[str]:
    for entry, row in zip(found, slopes, strict=True):
        if np.isfinite(row[:, 0]).any():
            at = int(np.nanargmin(row[:, 0]))
            yield f"{entry.label}: steepest by {methods[at].source}, {estimate_text(*row[at])}"


def _dots(
    method: ArchivedMethod, slopes: FloatArray, found: list[BenchmarkEntry], places: FloatArray
) -> Mark:
    hovers = [
        f"{method.source}, {entry.label}: {estimate_text(*row)}"
        + ("" if np.isfinite(row).all() else f"; {_NO_INTERVAL}")
        for entry, row in zip(found, slopes, strict=True)
    ]
    return Dots(
        slopes,
        places,
        method.series,
        hovers=hovers,
        name=method.source,
        marker=series_marker(method.series),
    )


def _slope_table(
    found: list[BenchmarkEntry], methods: list[ArchivedMethod], slopes: FloatArray
) -> OutputTable:
    table = OutputTable("Slopes, with their 95 % intervals", [m.source for m in methods])
    for entry, row in zip(found, slopes, strict=True):
        cells = []
        for bounds in row.tolist():
            has_interval = math.isfinite(bounds[1]) and math.isfinite(bounds[2])
            note = _NO_SLOPE if math.isnan(bounds[0]) else "" if has_interval else _NO_INTERVAL
            cells.append(estimate_text(*bounds) + table.note_mark(note))
        table.rows.append((entry.label, cells))
    return table
