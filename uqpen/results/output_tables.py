"""An archive as tables: one for each output, a column for each source of estimates."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from typing import Any

import xarray as xr

from uqpen.archive.read import group_names, model_trees
from uqpen.core.catalogue import REQUESTED
from uqpen.core.labels import CONFIDENCE_LEVEL, DIFFERENCES, SURROGATES
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.correction_tables import correction_tables
from uqpen.results.design_groups import group_tables
from uqpen.results.digits import percent_text
from uqpen.results.field_places import label_at_place
from uqpen.results.logarithmic_scale import is_logarithmic, linear_scale_note
from uqpen.results.missing_run_tables import missing_run_tables
from uqpen.results.sensitivity_tables import generalized_table, named_tables
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.statistics_rows import (
    StatisticsRows,
    add_absent_runs,
    add_decisions,
    add_failed_runs,
    add_runs,
    add_shares,
)
from uqpen.results.surrogate_fits import fitted_outputs
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    field_names,
    first_runs,
    label_with_unit,
    scalar_output_names,
)
from uqpen.results.user_defined_rows import OutputUnit, add_user_defined_rows
from uqpen.surrogates.diagnostics import shown_diagnostics, shown_titles
from uqpen.surrogates.field_fit import FIT_TEXT
from uqpen.surrogates.storage import refuted_outputs, unfitted_outputs

__all__ = [
    "difference_tables",
    "fit_table",
    "output_tables",
    "statistics_table",
    "statistics_tables",
]


def output_tables(tree: xr.DataTree, *, everything: bool = False) -> Iterator[OutputTable]:
    """Yield the tables of each output of each model, with its sensitivity tables.

    Parameters
    ----------
    tree : DataTree
        An archive.
    everything : bool
        Whether to show all sensitivity measures of the archive.
    """
    level = _level_text(tree)
    for name, model in model_trees(tree).items():
        head = f"{name}: " if name else ""
        for table in _model_tables(model, everything=everything):
            yield replace(table, title=f"{head}{table.title}{level}")
        for surrogate in group_names(model, SURROGATES):
            table = fit_table(surrogate, model.children[SURROGATES].children[surrogate])
            yield replace(table, title=head + table.title)
            for table in correction_tables(model, surrogate):
                yield replace(table, title=f"{head}{table.title}{level}")
            for table in missing_run_tables(model, surrogate):
                yield replace(table, title=head + table.title)
    yield from group_tables(tree, is_of_model=False)


def statistics_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the statistics of each output of each model of an archive."""
    level = _level_text(tree)
    for name, model in model_trees(tree).items():
        head = f"{name}: " if name else ""
        statistics = SourceStatistics(model)
        for output, attributes in _outputs(model).items():
            if table := statistics_table(statistics, output, attributes):
                yield replace(table, title=f"{head}{table.title}{level}")


def _level_text(tree: xr.DataTree) -> str:
    """Return the confidence level for a title, where it is not the usual one."""
    level = tree.attrs.get(CONFIDENCE_LEVEL)
    return "" if level is None else f", {percent_text(float(level))} intervals"


def _model_tables(model: xr.DataTree, *, everything: bool) -> Iterator[OutputTable]:
    fields = field_names(first_runs(model))
    # Of several fields, each has a line of its own first; who selects one sees its shares.
    for output in fields if everything or len(fields) == 1 else ():
        if table := generalized_table(model, output):
            yield table
    statistics = SourceStatistics(model)
    for output, attributes in _outputs(model).items():
        if table := statistics_table(statistics, output, attributes):
            yield table
        unit = _shown_unit(attributes)
        measures = named_tables(statistics, output, unit, everything=everything)
        yield from (table for _, table in measures)
    yield from group_tables(model, is_of_model=True)


def _outputs(model: xr.DataTree) -> dict[str, Mapping[Any, Any]]:
    """Return the scalar outputs of a model with their attributes, which its first runs have."""
    runs = first_runs(model)
    return {name: runs[name].attrs for name in scalar_output_names(runs)}


def statistics_table(
    statistics: SourceStatistics, name: str, described: Mapping[str, Any]
) -> OutputTable | None:
    """Return the statistics of one output from all sources; None where no source has any.

    Parameters
    ----------
    statistics : SourceStatistics
        Of one model.
    name : str
        The output's.
    described : mapping
        The output's attributes.
    """
    is_categorical = "flag_meanings" in described
    sources = list(statistics.by_source(name, "share" if is_categorical else "mean"))
    sources += _designs_of_tails(statistics, name, sources)
    if not sources:
        return None
    unit = _shown_unit(described)
    label = label_at_place(name, first_runs(statistics.tree)[name])
    table = OutputTable(label_with_unit(label, unit), sources)
    table.title += table.note_mark(statistics.caveat(sources[0], name))
    add_runs(table, statistics)
    add_failed_runs(table, statistics)
    add_absent_runs(table, statistics, name)
    if is_categorical:
        add_shares(table, statistics, name)
    else:
        is_log = is_logarithmic(statistics, name)
        StatisticsRows(table, statistics, name, scale(unit), is_log).add()
        table.title += table.note_mark(linear_scale_note(statistics, name, scale(unit), unit))
        add_decisions(table, statistics, name)
    in_si = str(described.get("units", DIMENSIONLESS))
    add_user_defined_rows(table, statistics, name, OutputUnit(in_si, scale(unit)))
    return table


def _designs_of_tails(
    statistics: SourceStatistics, output: str, others: Collection[str]
) -> list[str]:
    """Return the designs that have values far out of an output, and no mean."""
    asked = (statistics.by_source(output, each.name) for each in REQUESTED)
    found = {source for arrays in asked for source in arrays}
    return [
        source
        for source in statistics.sources
        if source in found.difference(others) and statistics.kind(source) == "design"
    ]


def difference_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the differences of the other models from the first, a table for each output."""
    for other in group_names(tree, DIFFERENCES):
        statistics = SourceStatistics.of_differences(tree, other)
        for name, attributes in _outputs(model_trees(tree)[other]).items():
            sources = list(statistics.by_source(name, "mean"))
            if sources:
                unit = _shown_unit(attributes)
                title = f"{other} minus {statistics.minus(sources[0])}: {name}"
                title = label_with_unit(title, unit) + _level_text(tree)
                table = OutputTable(title, sources)
                StatisticsRows(table, statistics, name, scale(unit)).add()
                yield table


def _shown_unit(described: Mapping[Any, Any]) -> str:
    return str(described.get("display_units", DIMENSIONLESS))


def fit_table(name: str, made: xr.DataTree) -> OutputTable:
    """Return the fit of a surrogate to each output, or the reason if there is none."""
    title = f"{name}: fit to {made.attrs['runs_used']} runs, check by {made.attrs['check']}"
    fits = {output: shown_diagnostics(made.children[output]) for output in fitted_outputs(made)}
    columns = shown_titles(made.children[output] for output in fits)
    table = OutputTable(title, columns)
    refuted = refuted_outputs(made)
    for output, diagnostics in fits.items():
        texts = {each.title: each.text for each in diagnostics}
        cells = [texts.get(column) or NOTHING for column in columns]
        if said := str(made.children[output].attrs.get(FIT_TEXT, "")):
            cells[-1] += table.note_mark(said)
        cells[-1] += table.note_mark(refuted.get(output, ""))
        table.rows.append((output, cells))
    for output, reason in unfitted_outputs(made).items():
        cells = [f"not fitted{table.note_mark(reason)}", *[NOTHING] * (len(columns) - 1)]
        table.rows.append((output, cells))
    return table
