"""Sources of the uncertainty: shares of the variance, effects, responses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain

import numpy as np
import xarray as xr

from uqpen.charts.chart import Block, Chart, Charts
from uqpen.core.labels import INPUT
from uqpen.core.statistic_dimensions import CATEGORY
from uqpen.figures.measures import MeasureSeries, measure_series
from uqpen.figures.sensitivity import (
    EFFECTS,
    INDICES,
    best_sources,
    index_series,
    response_measures,
    shown_indices,
)
from uqpen.report.blocks import Fold, Table
from uqpen.report.sections.main_outputs import output_blocks
from uqpen.report.sections.measures import MeasureChartSpec, measures_chart
from uqpen.results.archive_view import ArchiveView
from uqpen.results.index_titles import VarianceTitles, index_titles
from uqpen.results.input_ranking import InputOrder, input_order, input_ranking
from uqpen.results.sensitivity_tables import named_tables
from uqpen.results.table import NOTHING, OutputTable, identity
from uqpen.results.texts import capitalized, title_with_unit

__all__ = ["sensitivity"]

# Indices of a categorical output being in a category: statistic, label and marker.
_CATEGORY_INDICES = (
    ("category_first_order", "first order", "o"),
    ("category_total_order", "total order", "s"),
    ("category_shapley", "Shapley effect", "D"),
)
# Categories of an output with a chart of their own.
_MOST_CATEGORIES = 6


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
    shares = index_titles(view.tree)
    order = input_order(view, output)
    for of, measures in shown_indices(view, output):
        every = index_series(view, output, measures)
        if found := _shown_series(view, output, every):
            notes = tuple(filter(None, (shares.note, _left_out_note(view, every, found))))
            spec = MeasureChartSpec(
                capitalized(shares.title(of)),
                shares.axis,
                identity,
                _summary_order(shares),
                notes=notes,
                order=order,
            )
            name = "shares" if measures is INDICES else "shares of the logarithm"
            yield measures_chart(view, found, spec, tables.pop(name, ()))
    if found := measure_series(view, output, EFFECTS):
        convert, unit = view.scale(output).difference_from_si, view.unit(output)
        axis, labels = title_with_unit("effect", unit), tuple(label for _, label, _ in EFFECTS)
        spec = MeasureChartSpec("Elementary effects", axis, convert, labels, unit, order=order)
        yield measures_chart(view, found, spec, tables.pop("effects", ()))
    if charts := tuple(_responses(view, output, order)):
        yield Charts(charts, tables=tuple(tables.pop("responses", ())))
    for table in chain.from_iterable(tables.values()):
        if _has_estimates(table):
            yield Table(table, is_folded=True)


def _shown_series(
    view: ArchiveView, output: str, every: Sequence[MeasureSeries]
) -> list[MeasureSeries]:
    """Return the indices of the best sources, and of the one that the main results quote."""
    shown = {each.source for each in best_sources(view, list(every))}
    ranking = input_ranking(view, output)
    if ranking is not None and ranking.measure in ("first_order", "shapley"):
        shown.add(ranking.source)
    return [each for each in every if each.source in shown]


def _left_out_note(
    view: ArchiveView, every: Sequence[MeasureSeries], found: Sequence[MeasureSeries]
) -> str:
    """Return a note on indices that the table has, and the chart has not; empty for none."""
    if len(found) == len(every):
        return ""
    others = "other " if any(view.is_sample_design(each.source) for each in found) else ""
    return f"First-order indices by {others}plain samples are in the table only."


def _summary_order(shares: VarianceTitles) -> tuple[str, ...]:
    """Return the measures for the summary of a chart, which takes the first that exists."""
    labels = ("total order", "first order", "Shapley effect")
    return (labels[2], *labels[:2]) if shares.is_dependent else labels


def _has_estimates(table: OutputTable) -> bool:
    return any(not cell.startswith(NOTHING) for _, cells in table.rows for cell in cells)


def _responses(view: ArchiveView, output: str, order: InputOrder) -> Iterator[Chart]:
    for each in response_measures(view, output):
        if found := measure_series(view, output, ((each.statistic, "", "o"),)):
            title = f"{capitalized(each.label)}, near the nominal point"
            spec = MeasureChartSpec(
                title, each.axis, each.convert, (each.label,), each.unit, order=order
            )
            yield measures_chart(view, found, spec)


def _categorical_output_blocks(view: ArchiveView, output: str) -> Iterator[Block]:
    """Shares of the variance of an output being in a category."""
    every, shares = _category_series(view, output), index_titles(view.tree)
    notes = tuple(filter(None, [shares.note]))
    charts = []
    for names, found in _group_categories(view, every)[:_MOST_CATEGORIES]:
        title = capitalized(shares.title(f"the variance of whether it is {' or '.join(names)}"))
        spec = MeasureChartSpec(title, shares.axis, identity, _summary_order(shares), notes=notes)
        charts.append(measures_chart(view, found, spec))
    tables = tuple(
        _category_table(f"{output}: {shares.title(f'the variance of whether it is {kind}')}", each)
        for (_, kind), each in every.items()
    )
    if charts:
        yield Charts(tuple(charts), tables=tables)
    else:
        yield from (Table(table, is_folded=True) for table in tables)


def _category_series(view: ArchiveView, output: str) -> dict[tuple[int, str], list[MeasureSeries]]:
    """Return the measures of all sources for each category, by its position and label."""
    found: dict[tuple[int, str], list[MeasureSeries]] = {}
    statistics = view.statistics
    for source in view.sources if view.source is None else [view.source]:
        for statistic, words, marker in _CATEGORY_INDICES:
            if (array := statistics.get(source, output, statistic)) is not None:
                for category in enumerate(map(str, array["category_label"].values.tolist())):
                    series = MeasureSeries(source, words, marker, array[{CATEGORY: category[0]}])
                    found.setdefault(category, []).append(series)
    return found


def _group_categories(
    view: ArchiveView, every: Mapping[tuple[int, str], Sequence[MeasureSeries]]
) -> list[tuple[list[str], list[MeasureSeries]]]:
    """Return categories and their measures; categories with equal measures are grouped.

    Of two categories, one occurs whenever the other does not.
    """
    kept: list[tuple[list[str], list[MeasureSeries]]] = []
    for (_, label), series in every.items():
        known = [each for each in series if np.isfinite(each.array.values[:, 0]).any()]
        if not (found := best_sources(view, known)):
            continue
        same = (names for names, others in kept if _is_same(others, found))
        if (names := next(same, None)) is not None:
            names.append(label)
        else:
            kept.append(([label], found))
    return kept


def _is_same(one: Sequence[MeasureSeries], other: Sequence[MeasureSeries]) -> bool:
    return len(one) == len(other) and all(
        np.allclose(a.array.values, b.array.values, rtol=1e-9, atol=1e-12, equal_nan=True)
        for a, b in zip(one, other, strict=True)
    )


def _category_table(title: str, series: Sequence[MeasureSeries]) -> OutputTable:
    """A row for each input."""
    table = OutputTable(title, [f"{each.label}\n{each.source}" for each in series])
    for name in dict.fromkeys(str(i) for each in series for i in each.array[INPUT].values):
        table.rows.append((name, [_cell(table, each.array, name) for each in series]))
    return table


def _cell(table: OutputTable, array: xr.DataArray, name: str) -> str:
    known = array[INPUT].values.tolist()
    return table.cell(array[known.index(name)], identity) if name in known else NOTHING
