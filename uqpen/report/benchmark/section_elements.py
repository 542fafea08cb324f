"""Axis, legend, headings and numbers that the sections about a benchmark have in common."""

from __future__ import annotations

import math
from collections.abc import Sequence

import xarray as xr

from uqpen.archive.read import read_group
from uqpen.charts.chart import Axis, LegendKey
from uqpen.charts.marks import series_marker
from uqpen.core.labels import METHODS, REPLICATED, SINGLE
from uqpen.results.benchmark_entries import (
    BenchmarkEntry,
    entries,
    output_title,
    reference_attributes,
)
from uqpen.results.benchmark_methods import (
    ArchivedMethod,
    benchmark_budgets,
    benchmark_methods,
)
from uqpen.results.digits import grouped_number
from uqpen.results.table import OutputTable
from uqpen.results.texts import title_with_name

__all__ = [
    "MOST_CHARTS",
    "benchmark_output_heading",
    "budget_axis",
    "entries_by_output",
    "indent_labels",
    "method_keys",
    "reference_error",
    "reference_run_counts",
    "variants",
]

# A section shows the first of more charts, with a note.
MOST_CHARTS = 24

# Beside the fewest and the most runs, as a power of ten.
_FREE = 0.1


def variants(tree: xr.DataTree) -> list[str]:
    """Return the comparisons that differ: only one where no method has replicates."""
    has_replicates = any(
        SINGLE not in each.variants for each in benchmark_methods(tree, REPLICATED)
    )
    return [SINGLE, REPLICATED] if has_replicates else [SINGLE]


def entries_by_output(tree: xr.DataTree) -> dict[str, list[BenchmarkEntry]]:
    """The entries of all statistics of each output."""
    found: dict[str, list[BenchmarkEntry]] = {}
    for entry in entries(tree):
        found.setdefault(entry.output, []).append(entry)
    return found


def benchmark_output_heading(tree: xr.DataTree, output: str) -> str:
    """Return an output's title as a heading has it."""
    return title_with_name(output_title(tree, output), output)


def reference_error(entry: BenchmarkEntry) -> float:
    """Half the reference's interval, in per cent of what errors are relative to; NaN for none."""
    _, lower, upper = entry.reference.values.tolist()
    relative_to = entry.error_scale
    return 100 * (upper - lower) / 2 / relative_to if relative_to > 0 else math.nan


def reference_run_counts(tree: xr.DataTree) -> tuple[int, int]:
    """Return the number of runs that the reference made, and the number that it used."""
    attributes = reference_attributes(tree)
    made = attributes.get("runs", read_group(tree, METHODS).attrs["reference_runs"])
    return int(made), int(attributes["runs_used"])


def budget_axis(tree: xr.DataTree) -> Axis:
    """A logarithmic axis with a tick at each number of runs."""
    budgets = benchmark_budgets(tree)
    ends = (math.log10(budgets[0]) - _FREE, math.log10(budgets[-1]) + _FREE)
    ticks = tuple((float(budget), grouped_number(budget)) for budget in budgets)
    return Axis("runs", ends, ticks=ticks, is_logarithmic=True)


def method_keys(methods: Sequence[ArchivedMethod]) -> tuple[LegendKey, ...]:
    """The legend's entries of methods."""
    return tuple(
        LegendKey(method.source, method.series, series_marker(method.series)) for method in methods
    )


def indent_labels(table: OutputTable) -> OutputTable:
    """Return a table with labels that stay indented on a page."""
    rows = [
        (label.replace("  ", "\u00a0\u00a0\u00a0"), [cell.strip() for cell in cells])
        for label, cells in table.rows
    ]
    return OutputTable(table.title, table.columns, rows, table.notes)
