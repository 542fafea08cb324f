"""Errors of each method, over its number of runs."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.charts.axes import logarithmic_axis
from uqpen.charts.chart import Block, Chart, Charts, LegendKey
from uqpen.charts.marks import Band, Dots, Line, Mark, series_marker
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import REPLICATED, SINGLE
from uqpen.report.benchmark.section_elements import (
    MOST_CHARTS,
    benchmark_output_heading,
    budget_axis,
    method_keys,
    reference_error,
    variants,
)
from uqpen.report.blocks import Heading, Text
from uqpen.results.benchmark_entries import BenchmarkEntry
from uqpen.results.benchmark_methods import ArchivedMethod, benchmark_budgets, benchmark_methods
from uqpen.results.benchmark_tables import (
    IS_DOUBTFUL,
    IS_LEVEL,
    WINS,
    EntryComparison,
    entry_comparisons,
    percentage_text,
    standing_mark,
)
from uqpen.results.digits import estimate_text, grouped_number
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import capitalized, unit_suffix

__all__ = ["error_charts", "replicate_error_charts"]


_GUIDE = "1/√runs"
_FEW_DECIDE = "no interval, as few of the repeats decide this error"
# Between markers at the same number of runs, as a factor.
_APART = 1.035
_HEIGHT = 300


def error_charts(tree: xr.DataTree) -> Iterator[Block]:
    """Error against runs, of single sets of points."""
    yield from _variant_charts(tree, SINGLE)


def replicate_error_charts(tree: xr.DataTree) -> Iterator[Block]:
    """Yield the error charts of replicated sets, where any method has them."""
    if REPLICATED in variants(tree):
        yield from _variant_charts(tree, REPLICATED)


def _variant_charts(tree: xr.DataTree, variant: str) -> Iterator[Block]:
    charts: dict[str, list[Chart]] = {}
    without: list[str] = []
    count = 0
    for comparison in entry_comparisons(tree):
        entry = comparison.entry
        count += 1
        if count - len(without) > MOST_CHARTS:
            continue
        if chart := _chart(comparison, variant):
            charts.setdefault(entry.output, []).append(chart)
        else:
            without.append(f"{entry.output}, {entry.label}")
    if not charts:
        return
    for output, found in charts.items():
        yield Heading(benchmark_output_heading(tree, output))
        yield Charts(
            tuple(found), keys=(*method_keys(benchmark_methods(tree, variant)), *_keys(found))
        )
    drawn = sum(map(len, charts.values()))
    if without:
        yield Text(f"Not drawn, as no error is above 0: {'; '.join(without)}.")
    if drawn + len(without) < count:
        first = f"These are the first {drawn} of {count} statistics"
        yield Text(f"{first}; the tables further down have all.")


def _keys(charts: list[Chart]) -> Iterator[LegendKey]:
    marks = [mark for chart in charts for mark in chart.marks]
    if any(isinstance(mark, Line) and mark.name == _GUIDE for mark in marks):
        yield LegendKey(_GUIDE, "quiet", "line", "dot")
    if any(isinstance(mark, Band) for mark in marks):
        yield LegendKey("no larger than the reference's own error", "quiet", "band")


def _chart(comparison: EntryComparison, variant: str) -> Chart | None:
    """Error against runs of one statistic; None where no method has an error."""
    entry = comparison.entry
    methods = benchmark_methods(entry.tree, variant)
    method_bounds = {method: entry.percent_errors(method.position) for method in methods}
    known = np.array([bounds[:, 0] for bounds in method_bounds.values()])
    if not np.isfinite(known).any():
        return None
    budgets = np.array(benchmark_budgets(entry.tree), dtype=np.float64)
    own = reference_error(entry)
    every = np.array(list(method_bounds.values()))
    axis = logarithmic_axis("error [%]", every[np.isfinite(every)].tolist())
    lower = 10.0 ** axis.ends[0] if axis.ends else 0.0
    traces: list[Mark] = []
    if own > lower:
        sides = budgets[0] / 2, budgets[-1] * 2
        traces.append(Band(sides, [lower / 10] * 2, [own] * 2, "quiet"))
    traces += _guide(known, budgets)
    for place, (method, bounds) in enumerate(method_bounds.items()):
        shift = _APART ** (place - (len(method_bounds) - 1) / 2)
        traces.append(_line(entry, method, bounds, budgets * shift))
    return Chart(
        title=f"{entry.label}: {entry.reference_text}",
        summary=_summary(entry, methods, method_bounds),
        x=budget_axis(entry.tree),
        y=axis,
        marks=tuple(traces),
        notes=tuple(_notes(comparison, variant, method_bounds, own, lower)),
        tables=(_table(entry, variant),),
        height=_HEIGHT,
    )


def _guide(known: FloatArray, budgets: FloatArray) -> Iterator[Mark]:
    """Yield a line that falls with the root of the runs, from the largest error at the fewest."""
    first = next((at for at in range(budgets.size) if np.isfinite(known[:, at]).any()), 0)
    if first + 1 < budgets.size:
        runs = budgets[first:]
        fall = float(np.nanmax(known[:, first])) * np.sqrt(runs[0] / runs)
        yield Line(runs, fall, "quiet", hover=_GUIDE, name=_GUIDE, dash="dot", width=1.5)


def _line(
    entry: BenchmarkEntry, method: ArchivedMethod, bounds: FloatArray, places: FloatArray
) -> Mark:
    hovers = [
        f"{method.source}, {grouped_number(budget)} runs: {_error_text(row)}"
        for budget, row in zip(benchmark_budgets(entry.tree), bounds, strict=True)
    ]
    return Dots(
        bounds,
        places,
        method.series,
        hovers=hovers,
        name=method.source,
        marker=series_marker(method.series),
        along="y",
        is_joined=True,
    )


def _error_text(bounds: FloatArray) -> str:
    text = f"{estimate_text(*map(float, bounds))} %"
    return text if np.isfinite(bounds[1:]).all() else f"{text}; {_FEW_DECIDE}"


def _summary(
    entry: BenchmarkEntry, methods: list[ArchivedMethod], bounds: dict[ArchivedMethod, FloatArray]
) -> str:
    most = grouped_number(benchmark_budgets(entry.tree)[-1])
    found = [
        f"{method.source} {estimate_text(*map(float, bounds[method][-1]))} %"
        for method in methods
        if math.isfinite(bounds[method][-1, 0])
    ]
    return f"Errors at {most} runs: {'; '.join(found) or 'none'}."


def _notes(
    comparison: EntryComparison,
    variant: str,
    bounds: dict[ArchivedMethod, FloatArray],
    own: float,
    lower: float,
) -> Iterator[str]:
    entry = comparison.entry
    yield from (f"{capitalized(note)}." for note in _scale_note(entry))
    if any(
        (np.isfinite(b[:, 0]) & ~np.isfinite(b[:, 1:]).all(axis=1)).any() for b in bounds.values()
    ):
        yield "Hollow: no interval, as few of the repeats decide the error."
    for method in bounds:
        values = entry.variable("error").values[method.position, :, 0]
        if where := [
            n for n, v in zip(benchmark_budgets(entry.tree), values, strict=True) if v == 0
        ]:
            runs = ", ".join(map(grouped_number, where))
            yield f"{method.source} is exact at {runs} runs; this axis has no place for 0."
    shown = f"The reference's own error, {percentage_text(own / 100)} %,"
    if math.isfinite(own) and own <= lower:
        yield f"{shown} is below this axis."
    elif own >= max(float(np.nanmax(b[:, 0], initial=0.0)) for b in bounds.values()):
        yield f"{shown} is as large as any of these."
    if variant == REPLICATED:
        yield from (f"{capitalized(note)}." for note in comparison.replicated_verdicts)
    else:
        yield from (f"{capitalized(note)}." for note in comparison.notes)


def _scale_note(entry: BenchmarkEntry) -> Iterator[str]:
    """Yield a note on what errors are relative to, where that is not the reference."""
    scale, truth = entry.error_scale, abs(float(entry.reference.values[0]))
    if math.isclose(scale, truth) or not math.isfinite(truth):
        return
    if not truth and scale == 1:
        unit = unit_suffix(entry.units)
        yield f"errors are in % of 1{unit}, as the reference is 0"
    else:
        yield "errors are in % of the standard deviation, as the reference is about 0"


def _table(entry: BenchmarkEntry, variant: str) -> OutputTable:
    budgets = benchmark_budgets(entry.tree)
    title = "Errors in %, with their 95 % intervals"
    if variant == SINGLE:
        title += f"; {WINS} leads, {IS_LEVEL} is level with the best, {IS_DOUBTFUL} is uncertain"
    table = OutputTable(title, [*map(grouped_number, budgets)])
    array = entry.variable("error")
    for method in benchmark_methods(entry.tree, variant):
        cells = []
        for bounds, level_and_bound in zip(
            array.values[method.position], entry.single_set_standings, strict=True
        ):
            estimate, lower, upper = (100 * float(bound) for bound in bounds)
            text = NOTHING if math.isnan(estimate) else estimate_text(estimate, lower, upper)
            mark = standing_mark(method.source, *level_and_bound) if variant == SINGLE else ""
            has_interval = math.isfinite(lower) and math.isfinite(upper)
            note = "" if has_interval or math.isnan(estimate) or not estimate else _FEW_DECIDE
            cells.append(f"{text} {mark}".strip() + table.note_mark(note))
        table.rows.append((method.source, cells))
    return table
