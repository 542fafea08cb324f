"""Estimates of the same statistics by all sources, side by side, and their cost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from uqpen.core.units import DIMENSIONLESS
from uqpen.figures.source_comparison import ComparedStatistic, compared_statistics
from uqpen.report.blocks import Axis, Block, Chart, Charts, Fold, LegendKey, Table, Text
from uqpen.report.marks import Trace, dot_trace, series_marker
from uqpen.report.notes import has_interval, interval_notes
from uqpen.report.sections.interval_costs import interval_costs, main_statistics
from uqpen.report.sections.leading_design import output_title
from uqpen.report.sections.main_outputs import output_blocks
from uqpen.results.archive_view import ArchiveView
from uqpen.results.output_tables import statistics_table
from uqpen.results.table import identity, shown_estimate
from uqpen.results.texts import title_with_unit, unit_suffix

__all__ = ["source_comparison"]

# Outputs that are drawn, and rows of a chart in CSS pixels.
_MOST_OUTPUTS = 6
_ROW, _FRAME = 22, 66


def source_comparison(view: ArchiveView) -> Iterator[Block]:
    """The statistics of each output by all sources, and the cost of their intervals."""
    outputs = [
        each
        for each in (*view.numeric_outputs, *view.categorical_outputs)
        if _available_statistics(view, each)
    ]
    drawn = outputs[:_MOST_OUTPUTS]
    yield from output_blocks(view, {each: _output_blocks(view, each) for each in drawn}, most=1)
    if left := outputs[_MOST_OUTPUTS:]:
        yield Text(f"Without charts, as there are many outputs: {', '.join(left)}.")
        for output in left:
            yield from _tables(view, output, is_folded=True)


def _output_blocks(view: ArchiveView, output: str) -> Iterator[Block]:
    """Yield charts of the main statistics, and all others folded."""
    found = _available_statistics(view, output)
    rows = _rows(view, found)
    if len(rows) < 2:
        yield Text(f"Only {rows[0]} has estimates, so there is nothing to compare.")
        yield from _tables(view, output, is_folded=True)
        return
    first = main_statistics(view, output, found)
    yield _comparison_charts(view, output, first, rows)
    others = [each for each in found if each not in first]
    charts = (_comparison_charts(view, output, others, rows),) if others else ()
    tables = _tables(view, output)
    yield Fold(
        "All statistics by all methods, and what their intervals cost",
        (*charts, *tables, *interval_costs(view, output, found)),
    )


def _available_statistics(view: ArchiveView, output: str) -> list[ComparedStatistic]:
    return [each for each in compared_statistics(view, output) if each.available_estimates]


def _rows(view: ArchiveView, found: Sequence[ComparedStatistic]) -> tuple[str, ...]:
    return tuple(
        name for name in view.sources if any(name in each.available_estimates for each in found)
    )


def _tables(view: ArchiveView, output: str, *, is_folded: bool = False) -> Iterator[Table]:
    if table := statistics_table(view.statistics, output):
        yield Table(table, is_folded)


def _comparison_charts(
    view: ArchiveView, output: str, found: Sequence[ComparedStatistic], rows: tuple[str, ...]
) -> Charts:
    every = [estimate for each in found for estimate in each.available_estimates.values()]
    keys = []
    if not all(has_interval(each.values) for each in every):
        keys.append(LegendKey("no interval", "ink", "circle-open"))
    return Charts(
        charts=tuple(_chart(view, output, each, rows) for each in found),
        keys=tuple(keys),
        notes=tuple(interval_notes(every)),
    )


def _chart(
    view: ArchiveView, output: str, statistic: ComparedStatistic, rows: tuple[str, ...]
) -> Chart:
    traces: list[Trace] = []
    texts = []
    unit = DIMENSIONLESS if statistic.convert is identity else view.unit(output)
    for source, estimate in statistic.available_estimates.items():
        is_log = view.is_logarithmic(output) and statistic.convert is not identity
        shown = shown_estimate(estimate, statistic.convert, is_logarithmic=is_log)
        texts.append(f"{source} {shown}{unit_suffix(unit)}")
        bounds = np.asarray([statistic.convert(estimate.values)], dtype=np.float64)
        place, position = [rows.index(source)], view.series(source)
        marker = series_marker(position)
        traces.append(
            dot_trace(bounds, place, position, hovers=texts[-1:], name=source, marker=marker)
        )
    return Chart(
        title=statistic.label,
        summary=f"Of {output_title(view, output)}: {'; '.join(texts)}.",
        x=Axis(title_with_unit(statistic.label, unit)),
        y=Axis("", rows=rows),
        traces=tuple(traces),
        height=_FRAME + _ROW * len(rows),
    )
