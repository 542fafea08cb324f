"""An archive as tables: one for each output, a column for each source of figures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import xarray as xr

from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.labels import DIFFERENCES, RUNS, SURROGATES
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.failure_tables import failure_tables
from uqpen.results.outside_rows import OutputUnit, add_outside_rows
from uqpen.results.sensitivity_tables import sensitivity_tables
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.statistics_rows import (
    StatisticsRows,
    add_runs,
    add_shares,
    add_statuses,
    failed_runs_cell,
)
from uqpen.results.surrogate_fits import fit_diagnostics, fitted_outputs
from uqpen.results.table import NOTHING, OutputTable, output_names
from uqpen.surrogates.storage import unfitted_outputs

__all__ = ["difference_tables", "fit_table", "output_tables", "statistics_table"]


def output_tables(tree: xr.DataTree, *, everything: bool = False) -> Iterator[OutputTable]:
    """Yield tables for each output of each model, with those of the inputs' part in it.

    Parameters
    ----------
    tree : DataTree
        An archive.
    everything : bool
        Whether to show all that it has on the inputs' part.
    """
    for name, model in model_trees(tree).items():
        head = f"{name}: " if name else ""
        first = read_group(model, RUNS, group_names(model, RUNS)[0])
        for output in output_names(first):
            if table := statistics_table(model, output, first[output].attrs):
                yield replace(table, title=head + table.title)
            unit = str(first[output].attrs.get("display_units", DIMENSIONLESS))
            for table in sensitivity_tables(model, output, unit, everything=everything):
                yield replace(table, title=head + table.title)
        for table in failure_tables(model):
            yield replace(table, title=head + table.title)
        for surrogate in group_names(model, SURROGATES):
            table = fit_table(surrogate, model.children[SURROGATES].children[surrogate])
            yield replace(table, title=head + table.title)
    yield from difference_tables(tree)


def statistics_table(
    tree: xr.DataTree, name: str, described: Mapping[str, Any]
) -> OutputTable | None:
    """Return the statistics of one output, from all sources that have any.

    Parameters
    ----------
    tree : DataTree
        The part of an archive on one model.
    name : str
        The output's.
    described : mapping
        Its attributes.

    Returns
    -------
    OutputTable or None
        None where no source has any.
    """
    is_categorical = "flag_meanings" in described
    statistics = SourceStatistics(tree)
    sources = statistics.sources_of(name, "share" if is_categorical else "mean")
    if not sources:
        return None
    unit = _shown_unit(described)
    table = OutputTable(_with_unit(name, unit), sources)
    add_runs(table, tree)
    table.rows.append(("lost", [failed_runs_cell(tree, source, table) for source in sources]))
    add_statuses(table, tree)
    if is_categorical:
        add_shares(table, tree, name)
    else:
        StatisticsRows(table, statistics, name, scale(unit)).add()
    in_si = str(described.get("units", DIMENSIONLESS))
    add_outside_rows(table, statistics, name, OutputUnit(in_si, scale(unit)))
    return table


def difference_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the differences of the other models from the first, a table for each output."""
    for other in group_names(tree, DIFFERENCES):
        yield from _differences(tree, other)


def _differences(tree: xr.DataTree, other: str) -> Iterator[OutputTable]:
    """Yield the differences of another model's outputs from the first's, a table for each."""
    statistics = SourceStatistics.of_differences(tree, other)
    runs = model_trees(tree)[other]
    described = read_group(runs, RUNS, group_names(runs, RUNS)[0])
    for name in output_names(described):
        sources = statistics.sources_of(name, "mean")
        if not sources:
            continue
        unit = _shown_unit(described[name].attrs)
        first = statistics.minus(sources[0])
        table = OutputTable(_with_unit(f"{other} minus {first}: {name}", unit), sources)
        StatisticsRows(table, statistics, name, scale(unit)).add()
        yield table


def _shown_unit(described: Mapping[str, Any]) -> str:
    return str(described.get("display_units", DIMENSIONLESS))


def _with_unit(title: str, unit: str) -> str:
    return title if unit == DIMENSIONLESS else f"{title} [{unit}]"


# What is told of a surrogate's fit to an output: attribute, and what a person reads.
_FIT_ROWS = (
    ("order", "order"),
    ("terms", "terms"),
    ("q2", "Q², runs left out"),
    ("check_q2_of_output", "Q², check runs"),
)


def fit_table(name: str, made: xr.DataTree) -> OutputTable:
    """Return the fit of a surrogate to each output, or why it could not be fitted."""
    title = f"{name}: fit to {made.attrs['runs_used']} runs, check by {made.attrs['check']}"
    table = OutputTable(title, [label for _, label in _FIT_ROWS])
    for output in fitted_outputs(made):
        diagnostics = fit_diagnostics(made, output)
        table.rows.append((output, [_fit_number(diagnostics[name]) for name, _ in _FIT_ROWS]))
    for output, reason in unfitted_outputs(made).items():
        cells = [f"not fitted{table.note_mark(reason)}", *[NOTHING] * (len(_FIT_ROWS) - 1)]
        table.rows.append((output, cells))
    return table


def _fit_number(value: float) -> str:
    return NOTHING if math.isnan(value) else f"{value:.5g}"
