"""Tables of the inputs' part in an output: indices, effects, responses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.core.labels import (
    INPUT,
    LARGEST_CONTRIBUTION,
    PAIR,
    RUNS,
    SAMPLING,
    SENSITIVITY,
    Sampling,
)
from uqpen.core.units import DIMENSIONLESS, Scale, scale
from uqpen.results.table import NOTHING, OutputTable, identity

__all__ = ["named_tables", "sensitivity_tables"]


class _Measure(NamedTuple):
    """A measure of sensitivity: how its variable's name ends, what a person reads, its factor."""

    suffix: str
    label: str
    factor: float = 1.0
    has_unit: bool = False


_INDICES = (
    _Measure("first_order", "first order"),
    _Measure("total_order", "total order"),
    _Measure("shapley", "Shapley effect"),
)
_RESPONSES = (
    _Measure("response", "response [%]", 100.0),
    _Measure("contribution", "× uncertainty [%]", 100.0),
)
_EFFECTS = (
    _Measure("mu_star", "mean |effect|", has_unit=True),
    _Measure("mu", "mean effect", has_unit=True),
    _Measure("sigma", "sd of effects", has_unit=True),
)

_ASSOCIATIONS = (
    _Measure("spearman", "Spearman"),
    _Measure("pearson", "Pearson"),
    _Measure("partial_rank", "partial, ranks"),
    _Measure("partial", "partial"),
    _Measure("delta", "delta"),
)

_TABLES = (
    ("shares", "shares of its variance", _INDICES),
    ("responses", "responses to its inputs", _RESPONSES),
    ("effects", "elementary effects", _EFFECTS),
)
_MORE_TABLES = (
    (
        "shares of the logarithm",
        "shares of its logarithm's variance",
        tuple(each._replace(suffix=f"log_{each.suffix}") for each in _INDICES),
    ),
    ("associations", "association with its inputs", _ASSOCIATIONS),
)


def sensitivity_tables(
    tree: xr.DataTree, output: str, unit: str, *, everything: bool = False
) -> Iterator[OutputTable]:
    """A table for each kind of measure that the archive has of an output.

    First order indices from plain samples are shown where nothing tells them better, and what any
    sample tells besides only where everything is asked for.

    Parameters
    ----------
    tree : DataTree
        What is told of one model.
    output : str
        Its name.
    unit : str
        The unit to show it in.
    everything : bool
        Whether to show all that there is.
    """
    for _, table in named_tables(tree, output, unit, everything=everything):
        yield table


def named_tables(
    tree: xr.DataTree, output: str, unit: str, *, everything: bool = False
) -> Iterator[tuple[str, OutputTable]]:
    """The same, each after what it is of, such as "shares", "responses" or "effects"."""
    for name, title, measures in (*_TABLES, *(_MORE_TABLES if everything else ())):
        columns = list(_columns(tree, output, measures))
        if measures is _INDICES and not everything:
            columns = _best_sources(tree, columns)
        if columns:
            measured = f" [{unit}]" if measures is _EFFECTS and unit != DIMENSIONLESS else ""
            table = _table(f"{output}: {title}{measured}", columns, scale(unit))
            if measures is _INDICES:
                _add_claims(table, tree, output)
            yield name, table
    for source in group_names(tree, SENSITIVITY):
        answers = read_group(tree, SENSITIVITY, source)
        if (pairs := f"{output}_second_order") in answers:
            yield "pairs", _pairs_table(output, source, answers[pairs])
    if everything:
        for table in _exceedance_tables(tree, output):
            yield "exceedance", table


def _exceedance_tables(tree: xr.DataTree, output: str) -> Iterator[OutputTable]:
    """The inputs' part in whether an output exceeds each value."""
    of_event = [each._replace(suffix=f"exceedance_{each.suffix}") for each in _INDICES]
    columns = list(_columns(tree, output, of_event))
    thresholds = f"{output}_threshold"
    written = columns[0].array[thresholds].values if columns else ()
    for position, threshold in enumerate(written):
        at = [each._replace(array=each.array[{thresholds: position}]) for each in columns]
        title = f"{output}: shares of the variance of exceeding {threshold}"
        yield _table(title, at, scale(DIMENSIONLESS))


def _pairs_table(output: str, source: str, indices: xr.DataArray) -> OutputTable:
    """What pairs of inputs do together and neither does alone."""
    table = OutputTable(f"{output}: shares of its variance, by pairs", [f"second order\n{source}"])
    for position, pair in enumerate(indices[PAIR].values):
        table.rows.append((str(pair), [table.cell(indices[position], identity)]))
    return table


class _Column(NamedTuple):
    source: str
    measure: _Measure
    array: xr.DataArray


def _columns(tree: xr.DataTree, output: str, measures: Sequence[_Measure]) -> Iterator[_Column]:
    for measure in measures:
        for source in group_names(tree, SENSITIVITY):
            answers = read_group(tree, SENSITIVITY, source)
            if (name := f"{output}_{measure.suffix}") in answers:
                yield _Column(source, measure, answers[name])


def _best_sources(tree: xr.DataTree, columns: Sequence[_Column]) -> list[_Column]:
    """The columns without those of plain samples, unless there are no others."""
    dedicated = [column for column in columns if not _is_sample_design(tree, column.source)]
    if dedicated or not columns:
        return dedicated
    largest = max(
        columns, key=lambda column: read_group(tree, SENSITIVITY, column.source).attrs["runs"]
    )
    return [column for column in columns if column.source == largest.source]


def _is_sample_design(tree: xr.DataTree, source: str) -> bool:
    runs = read_group(tree, RUNS, source)
    if not runs:
        return False
    sampling = Sampling(runs.attrs[SAMPLING])
    return sampling.is_sample and sampling is not Sampling.PICK_FREEZE


def _table(title: str, columns: Sequence[_Column], measure: Scale) -> OutputTable:
    headers = [f"{column.measure.label}\n{column.source}" for column in columns]
    table = OutputTable(title, headers)
    inputs = dict.fromkeys(str(name) for column in columns for name in column.array[INPUT].values)
    for name in inputs:
        table.rows.append((name, [_cell(table, column, name, measure) for column in columns]))
    return table


def _add_claims(table: OutputTable, tree: xr.DataTree, output: str) -> None:
    """A column for each publication that names the largest contribution."""
    for source in group_names(tree, SENSITIVITY):
        claim = read_group(tree, SENSITIVITY, source).attrs.get(f"{output}_{LARGEST_CONTRIBUTION}")
        if claim is not None:
            table.columns.append(f"the largest to\n{source}")
            for name, cells in table.rows:
                cells.append("this" if name == claim else NOTHING)


def _cell(table: OutputTable, column: _Column, name: str, measure: Scale) -> str:
    known = column.array[INPUT].values.tolist()
    if name not in known:
        return NOTHING
    estimate, factor = column.array[known.index(name)], column.measure.factor
    if column.measure.has_unit:
        return table.cell(estimate, measure.difference_from_si)

    def shown(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return values * factor

    return table.cell(estimate, shown if factor != 1 else identity)
