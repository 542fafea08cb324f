"""Sections of a benchmark of methods: errors, rates, coverage, cost, the reference, and tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from uqpen.archive.estimates import interval_text
from uqpen.charts.chart import Block, Chart, Charts
from uqpen.charts.method_comparison import (
    SLOPE_NOTE,
    coverage_note,
    error_chart,
    error_keys,
    method_keys,
    of_coverage,
    of_slopes,
)
from uqpen.core.labels import INTERVAL, REPLICATED, SINGLE
from uqpen.core.units import scale
from uqpen.report.benchmark.answer import MOST_CHARTS
from uqpen.report.blocks import Heading, Table, Text
from uqpen.results.archive_view import ArchiveView, output_heading
from uqpen.results.benchmark_tables import LEGEND, entry_table, methods_table, percentage_text
from uqpen.results.digits import grouped_number, number_text
from uqpen.results.method_comparison import ComparedEntry, MethodComparison
from uqpen.results.table import NOTHING, OutputTable, estimate_remark
from uqpen.results.texts import unit_suffix

__all__ = [
    "cost",
    "coverage",
    "errors",
    "rates",
    "reference",
    "replicates",
    "tables",
]


def errors(view: ArchiveView) -> Iterator[Block]:
    """Error against runs, of single sets of points."""
    yield from _error_blocks(MethodComparison(view), SINGLE)


def replicates(view: ArchiveView) -> Iterator[Block]:
    """Yield the error charts of replicated sets, where any method has them."""
    comparison = MethodComparison(view)
    if REPLICATED in comparison.variants:
        yield from _error_blocks(comparison, REPLICATED)


def _error_blocks(comparison: MethodComparison, variant: str) -> Iterator[Block]:
    charts: dict[str, list[Chart]] = {}
    without: list[str] = []
    for count, entry in enumerate(comparison.entries, 1):
        if count - len(without) > MOST_CHARTS:
            continue
        if chart := error_chart(entry, variant):
            charts.setdefault(entry.output, []).append(chart)
        else:
            without.append(f"{entry.output}, {entry.label}")
    if not charts:
        return
    keys = method_keys(comparison.methods_in(variant))
    for output, found in charts.items():
        yield Heading(output_heading(comparison.view, output))
        yield Charts(tuple(found), keys=(*keys, *error_keys(found)))
    drawn = sum(map(len, charts.values()))
    if without:
        yield Text(f"Not drawn, as no error is above 0: {'; '.join(without)}.")
    if drawn + len(without) < len(comparison.entries):
        first = f"These are the first {drawn} of {len(comparison.entries)} statistics"
        yield Text(f"{first}; the tables further down have all.")


def rates(view: ArchiveView) -> Iterator[Block]:
    """Slopes with their intervals."""
    comparison = MethodComparison(view)
    charts = [chart for variant in comparison.variants for chart in of_slopes(comparison, variant)]
    yield from _row_blocks(comparison, charts, [SLOPE_NOTE])


def coverage(view: ArchiveView) -> Iterator[Block]:
    """Share of the repeats in which a method's own interval contains the reference."""
    comparison = MethodComparison(view)
    charts = [each for variant in comparison.variants for each in of_coverage(comparison, variant)]
    covered = {
        method.source
        for method in comparison.methods
        for entry in comparison.entries
        if np.isfinite(entry.of(method, "coverage").values).any()
    }
    sources = dict.fromkeys(method.source for method in comparison.methods)
    without = [f"{each} has no intervals of its own." for each in sources if each not in covered]
    yield from _row_blocks(comparison, charts, [coverage_note(comparison), *without])


def _row_blocks(
    comparison: MethodComparison, charts: Sequence[Chart], notes: Sequence[str]
) -> Iterator[Block]:
    if not charts:
        return
    if len(charts) > MOST_CHARTS:
        omitted = f"The first {MOST_CHARTS} of {len(charts)} charts; more outputs are not drawn."
        notes = [*notes, omitted]
    keys = method_keys(comparison.methods_in(SINGLE))
    yield Charts(tuple(charts[:MOST_CHARTS]), keys=keys, notes=tuple(notes))


def cost(view: ArchiveView) -> Iterator[Block]:
    """Yield the runs that each method makes of those that it is given."""
    comparison = MethodComparison(view)
    yield Table(_indented(methods_table(comparison)))
    charged = sum(sum(method.runs) for method in comparison.methods) * comparison.repeats
    yield Text(
        f"All repeats together cost {grouped_number(charged)} runs, and the reference "
        f"{grouped_number(comparison.reference_runs)}."
    )
    if any(
        0 < runs < budget
        for method in comparison.methods
        for runs, budget in zip(method.runs, comparison.budgets, strict=True)
    ):
        yield Text(
            "Some methods make fewer runs than the budget, as no further block or replicate fits. "
            "Their errors are drawn at the budget; slopes are over the runs made."
        )


def tables(view: ArchiveView) -> Iterator[Block]:
    """The tables that the command line shows, with their legend."""
    yield Text(LEGEND)
    for entry in MethodComparison(view).entries:
        yield Table(_indented(entry_table(entry)), is_folded=True)


def reference(view: ArchiveView) -> Iterator[Block]:
    """The reference values, and their own errors."""
    comparison = MethodComparison(view)
    run_count, used = comparison.reference_runs, comparison.reference_runs_used
    completed = grouped_number(used) if used < run_count else "all"
    yield Text(f"Of its {grouped_number(run_count)} runs, {completed} completed.")
    columns = ["value", "its own error", "errors are relative to", "method of its interval"]
    for output, found in comparison.by_output.items():
        table = OutputTable(f"Reference of {output_heading(comparison.view, output)}", columns)
        for entry in found:
            truth, own = entry.reference, entry.reference_error
            value = entry.reference_text if math.isfinite(truth.values[0]) else NOTHING
            value += table.note_mark(estimate_remark(truth))
            own_text = NOTHING if math.isnan(own) else f"{percentage_text(own / 100)} %"
            method = interval_text(truth, INTERVAL) or NOTHING
            table.rows.append((entry.label, [value, own_text, _error_scale_text(entry), method]))
        yield Table(table)


def _error_scale_text(entry: ComparedEntry) -> str:
    unit = entry.display_units
    value = float(np.asarray(scale(unit).difference_from_si(entry.error_scale)))
    if not math.isfinite(value + float(entry.reference.values[0])):
        return NOTHING
    return f"{number_text(value)}{unit_suffix(unit)}"


def _indented(table: OutputTable) -> OutputTable:
    """Return a table with labels that stay indented on a page."""
    rows = [
        (label.replace("  ", "\u00a0\u00a0\u00a0"), [cell.strip() for cell in cells])
        for label, cells in table.rows
    ]
    return OutputTable(table.title, table.columns, rows, table.notes)
