"""Statistics of each design's runs as a whole, by the declarations of their groups."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import xarray as xr

from uqpen.archive.groups import GROUPS, Group, group_names
from uqpen.core.labels import BOUND
from uqpen.core.lookup import resolve
from uqpen.results.digits import number_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    entries_json,
    label_with_unit,
)


def group_tables(tree: xr.DataTree, *, is_of_model: bool) -> Iterator[OutputTable]:
    """Yield the tables of the groups of a model, or of an archive, in the order of their ranks."""
    for name, group in sorted(GROUPS.items(), key=lambda each: each[1].rank):
        if group.is_of_model == is_of_model:
            if group.tables:
                yield from resolve(group.tables)(tree)
            elif group.writer and name in tree.children:
                yield _table(tree, name, group)


def design_json(statistics: SourceStatistics, design: str) -> dict[str, Any]:
    """Return the statistics of a design's runs as a whole."""
    found: dict[str, Any] = {}
    for name, group in GROUPS.items():
        if group.json:
            found |= resolve(group.json)(statistics, design)
        elif group.writer and (arrays := statistics.of_runs(name, design)):
            found[name] = {key: entries_json(each) for key, each in arrays.items()}
    return found


def _table(tree: xr.DataTree, name: str, group: Group) -> OutputTable:
    """Return the table of a group by its records: a row for each entry, in SI units."""
    statistics, designs = SourceStatistics(tree), group_names(tree, name)
    table = OutputTable(group.title or name.replace("_", " "), designs)
    for record in group.statistics.values():
        rows: dict[str, dict[str, str]] = {}
        for design in designs:
            if (array := statistics.of_runs(name, design).get(record.name)) is not None:
                title = label_with_unit(record.title, str(array.attrs.get("units", "1")))
                for entry, each in _entries(array):
                    is_estimate = BOUND in each.dims
                    cell = table.cell(each) if is_estimate else number_text(float(each))
                    rows.setdefault(f"{title}{entry}", {})[design] = cell
        for label, cells in rows.items():
            table.rows.append((label, [cells.get(design, NOTHING) for design in designs]))
    return table


def _entries(array: xr.DataArray) -> Iterator[tuple[str, xr.DataArray]]:
    """Yield the entries of a statistic, each with its labels."""
    own = next((dim for dim in array.dims if dim != BOUND), None)
    if own is None:
        yield "", array
        return
    for position, label in enumerate(array[own].values):
        for further, entry in _entries(array[{own: position}]):
            yield f", {label}{further}", entry
