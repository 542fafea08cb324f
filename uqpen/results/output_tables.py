"""An archive as tables: one for each output, a column for each source of figures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import xarray as xr

from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.labels import DIFFERENCES, MOMENTS, RUNS, SHARES, SURROGATES
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.failure_tables import failure_tables
from uqpen.results.sensitivity_tables import sensitivity_tables
from uqpen.results.statistics_rows import (
    StatisticsRows,
    add_runs,
    add_shares,
    add_statuses,
    failed_runs_cell,
)
from uqpen.results.table import NOTHING, OutputTable, output_names

__all__ = ["difference_tables", "fit_table", "output_tables", "statistics_table"]

_NOT_FITTED = "_not_fitted"


def output_tables(tree: xr.DataTree, *, everything: bool = False) -> Iterator[OutputTable]:
    """A table for each output of each model of a study, and what tells its inputs' part in it.

    Parameters
    ----------
    tree : DataTree
        An archive.
    everything : bool
        Whether to show all that it tells of the inputs' part.
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
            table = fit_table(surrogate, read_group(model, SURROGATES, surrogate))
            yield replace(table, title=head + table.title)
    yield from difference_tables(tree)


def statistics_table(
    tree: xr.DataTree, name: str, described: Mapping[str, Any]
) -> OutputTable | None:
    """The statistics of one output, from all sources that have any.

    Parameters
    ----------
    tree : DataTree
        What an archive tells of one model.
    name : str
        The output's.
    described : mapping
        Its attributes.

    Returns
    -------
    OutputTable or None
        None where no source has any.
    """
    kind = SHARES if "flag_meanings" in described else MOMENTS
    sources = _sources(tree, kind, name)
    if not sources:
        return None
    unit = _shown_unit(described)
    table = OutputTable(_with_unit(name, unit), sources)
    add_runs(table, tree)
    table.rows.append(("lost", [failed_runs_cell(tree, source, table) for source in sources]))
    add_statuses(table, tree)
    if kind == SHARES:
        add_shares(table, tree, name)
    else:
        StatisticsRows(table, tree, name, scale(unit)).add()
    return table


def difference_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """How the other models of an archive differ from its first, a table for each output of each."""
    for other in group_names(tree, DIFFERENCES):
        yield from _differences(tree, other)


def _differences(tree: xr.DataTree, other: str) -> Iterator[OutputTable]:
    """How another model's outputs differ from the first's, a table for each output."""
    pairs = tree.children[DIFFERENCES].children[other]
    runs = model_trees(tree)[other]
    described = read_group(runs, RUNS, group_names(runs, RUNS)[0])
    for name in output_names(described):
        sources = _sources(pairs, MOMENTS, name)
        if not sources:
            continue
        unit = _shown_unit(described[name].attrs)
        first = read_group(pairs, MOMENTS, sources[0]).attrs["minus"]
        table = OutputTable(_with_unit(f"{other} minus {first}: {name}", unit), sources)
        StatisticsRows(table, pairs, name, scale(unit), is_difference=True).add()
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


def fit_table(name: str, made: xr.Dataset) -> OutputTable:
    """How well a surrogate fits each output, or why it could not be fitted."""
    title = f"{name}: fit to {made.attrs['runs_used']} runs, check by {made.attrs['check']}"
    table = OutputTable(title, [label for _, label in _FIT_ROWS])
    for output in made.attrs["outputs"].split():
        attributes = made[f"{output}_coefficient"].attrs
        table.rows.append(
            (output, [_fit_number(attributes[attribute]) for attribute, _ in _FIT_ROWS])
        )
    for attribute, reason in made.attrs.items():
        if attribute.endswith(_NOT_FITTED):
            cells = [f"not fitted{table.note_mark(reason)}", *[NOTHING] * (len(_FIT_ROWS) - 1)]
            table.rows.append((attribute.removesuffix(_NOT_FITTED), cells))
    return table


def _fit_number(value: float) -> str:
    return NOTHING if math.isnan(value) else f"{value:.5g}"


def _sources(tree: xr.DataTree, kind: str, name: str) -> list[str]:
    """The sources that tell an output's mean, or its shares."""
    variable = name if kind == SHARES else f"{name}_mean"
    return [
        source for source in group_names(tree, kind) if variable in read_group(tree, kind, source)
    ]
