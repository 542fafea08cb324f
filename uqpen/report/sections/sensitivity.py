"""Sources of the uncertainty: shares of the variance, effects, responses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

from uqpen.charts.chart import Block, Charts
from uqpen.charts.measures import (
    MeasureSeries,
    category_charts,
    category_series,
    effect_charts,
    index_charts,
    responses,
)
from uqpen.core.labels import INPUT
from uqpen.report.blocks import Fold, Table
from uqpen.report.sections.main_outputs import output_blocks
from uqpen.results.archive_view import ArchiveView
from uqpen.results.input_measures import index_titles, named_tables
from uqpen.results.table import NOTHING, OutputTable, identity

__all__ = ["sensitivity"]


def sensitivity(view: ArchiveView) -> Iterator[Block]:
    """Yield the sources of the uncertainty: shares of the variance, effects, responses."""
    found = {output: _numeric_output_blocks(view, output) for output in view.numeric_outputs}
    found |= {each: _categorical_output_blocks(view, each) for each in view.categorical_outputs}
    yield from output_blocks(view, found)


def _numeric_output_blocks(view: ArchiveView, output: str) -> Iterator[Block]:
    """Yield the first measure that the archive has, and the others folded."""
    measures = tuple(_measure_blocks(view, output))
    yield from measures[:1]
    if further := measures[1:]:
        yield Fold("Other measures", further)


def _measure_blocks(view: ArchiveView, output: str) -> Iterator[Block]:
    tables: dict[str, list[OutputTable]] = {}
    for name, table in named_tables(view.statistics, output, view.unit(output), everything=True):
        tables.setdefault(name, []).append(table)
    charts = [*index_charts(view, output, tables), *effect_charts(view, output, tables)]
    yield from charts
    if changes := tuple(responses(view, output)):
        yield Charts(changes, tables=tuple(tables.pop("responses", ())))
    drawn = [table for chart in charts for table in chart.tables]
    for table in chain.from_iterable(tables.values()):
        if table not in drawn and any(
            not cell.startswith(NOTHING) for _, cells in table.rows for cell in cells
        ):
            yield Table(table, is_folded=True)


def _categorical_output_blocks(view: ArchiveView, output: str) -> Iterator[Block]:
    """Shares of the variance of an output being in a category."""
    shares = index_titles(view.tree)
    tables = tuple(
        _category_table(f"{output}: {shares.title(f'the variance of whether it is {kind}')}", each)
        for kind, each in category_series(view, output).items()
    )
    if charts := tuple(category_charts(view, output)):
        yield Charts(charts, tables=tables)
    else:
        yield from (Table(table, is_folded=True) for table in tables)


def _category_table(title: str, series: Sequence[MeasureSeries]) -> OutputTable:
    """A row for each input."""
    table = OutputTable(title, [f"{each.label}\n{each.source}" for each in series])
    known = [each.array[INPUT].values.tolist() for each in series]
    for name in dict.fromkeys(name for inputs in known for name in inputs):
        cells = [
            table.cell(each.array[inputs.index(name)], identity) if name in inputs else NOTHING
            for each, inputs in zip(series, known, strict=True)
        ]
        table.rows.append((str(name), cells))
    return table
