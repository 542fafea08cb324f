"""Cost of a comparison of methods, its tables, and the reference that errors are relative to."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.estimates import interval_text
from uqpen.archive.read import read_group
from uqpen.charts.chart import Block
from uqpen.core.labels import BUDGET, INTERVAL, METHODS
from uqpen.core.units import scale
from uqpen.report.benchmark.section_elements import (
    benchmark_output_heading,
    entries_by_output,
    indent_labels,
    reference_error,
    reference_run_counts,
)
from uqpen.report.blocks import Table, Text
from uqpen.report.sections.archive import provenance_table, study_blocks
from uqpen.results.archive_view import ArchiveView
from uqpen.results.benchmark_entries import BenchmarkEntry
from uqpen.results.benchmark_tables import LEGEND, entry_comparisons, methods_table, percentage_text
from uqpen.results.digits import grouped_number, number_text
from uqpen.results.table import NOTHING, OutputTable, estimate_remark
from uqpen.results.texts import unit_suffix

__all__ = ["cost", "provenance", "reference", "tables"]


def cost(tree: xr.DataTree) -> Iterator[Block]:
    """Yield the runs that each method makes of those that it is given."""
    yield Table(indent_labels(methods_table(tree)))
    methods = read_group(tree, METHODS)
    charged = int(methods["runs"].sum()) * int(methods.attrs["repeats"])
    yield Text(
        f"All repeats together cost {grouped_number(charged)} runs, and the reference "
        f"{grouped_number(int(methods.attrs['reference_runs']))}."
    )
    if (methods["runs"] < methods[BUDGET]).where(methods["runs"] > 0, other=False).any():
        yield Text(
            "Some methods make fewer runs than the budget, as no further block or replicate fits. "
            "Their errors are drawn at the budget; slopes are over the runs made."
        )


def tables(tree: xr.DataTree) -> Iterator[Block]:
    """The tables that the command line shows, with their legend."""
    yield Text(LEGEND)
    for comparison in entry_comparisons(tree):
        yield Table(indent_labels(comparison.table), is_folded=True)


def reference(tree: xr.DataTree) -> Iterator[Block]:
    """The reference values, and their own errors."""
    run_count, used = reference_run_counts(tree)
    completed = grouped_number(used) if used < run_count else "all"
    yield Text(f"Of its {grouped_number(run_count)} runs, {completed} completed.")
    for output, found in entries_by_output(tree).items():
        yield Table(_values(tree, output, found))


def _values(tree: xr.DataTree, output: str, found: list[BenchmarkEntry]) -> OutputTable:
    columns = ["value", "its own error", "errors are relative to", "method of its interval"]
    table = OutputTable(f"Reference of {benchmark_output_heading(tree, output)}", columns)
    for entry in found:
        truth = entry.reference
        value = entry.reference_text if math.isfinite(truth.values[0]) else NOTHING
        value += table.note_mark(estimate_remark(truth))
        own = reference_error(entry)
        own_text = NOTHING if math.isnan(own) else f"{percentage_text(own / 100)} %"
        method = interval_text(truth, INTERVAL) or NOTHING
        table.rows.append((entry.label, [value, own_text, _error_scale_text(entry), method]))
    return table


def _error_scale_text(entry: BenchmarkEntry) -> str:
    unit = entry.display_units
    value = float(np.asarray(scale(unit).difference_from_si(entry.error_scale)))
    if not math.isfinite(value + float(entry.reference.values[0])):
        return NOTHING
    return f"{number_text(value)}{unit_suffix(unit)}"


def provenance(tree: xr.DataTree) -> Iterator[Block]:
    """The study's text, and the provenance of the archive."""
    view = ArchiveView(tree, "")
    yield from study_blocks(view)
    yield Table(provenance_table(view))
