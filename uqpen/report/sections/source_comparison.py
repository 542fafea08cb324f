"""Estimates of the same statistics by all sources, side by side, and their cost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from uqpen.charts.chart import Block
from uqpen.charts.source_comparison import (
    available_statistics,
    compared_sources,
    comparison_charts,
    interval_cost_charts,
    main_statistics,
)
from uqpen.report.blocks import Fold, Table, Text
from uqpen.report.sections.main_outputs import output_blocks
from uqpen.results.archive_view import ArchiveView
from uqpen.results.output_tables import statistics_table

__all__ = ["source_comparison"]

# Outputs that are drawn.
_MOST_OUTPUTS = 6


def source_comparison(view: ArchiveView) -> Iterator[Block]:
    """The statistics of each output by all sources, and the cost of their intervals."""
    outputs = [
        each
        for each in (*view.numeric_outputs, *view.categorical_outputs)
        if available_statistics(view, each)
    ]
    drawn = outputs[:_MOST_OUTPUTS]
    yield from output_blocks(view, {each: _output_blocks(view, each) for each in drawn}, most=1)
    if left := outputs[_MOST_OUTPUTS:]:
        yield Text(f"Without charts, as there are many outputs: {', '.join(left)}.")
        for output in left:
            yield from _tables(view, output, is_folded=True)


def _output_blocks(view: ArchiveView, output: str) -> Iterator[Block]:
    """Yield charts of the main statistics, and all others folded."""
    found = available_statistics(view, output)
    rows = compared_sources(view, found)
    if len(rows) < 2:
        yield Text(f"Only {rows[0]} has estimates, so there is nothing to compare.")
        yield from _tables(view, output, is_folded=True)
        return
    first = main_statistics(found)
    yield comparison_charts(view, output, first, rows)
    others = [each for each in found if each not in first]
    charts = [comparison_charts(view, output, others, rows)] if others else []
    costs = interval_cost_charts(view, output, found)
    yield Fold(
        "All statistics by all methods, and what their intervals cost",
        (
            *charts,
            *_tables(view, output),
            *(replace(each, tables=()) for each in costs),
            *(Table(table) for each in costs for table in each.tables),
        ),
    )


def _tables(view: ArchiveView, output: str, *, is_folded: bool = False) -> Iterator[Table]:
    if table := statistics_table(view.statistics, output):
        yield Table(table, is_folded)
