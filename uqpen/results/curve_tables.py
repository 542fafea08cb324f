"""Curves among the outputs of an archive as tables: a row for each of a few places."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.fields import coordinate_text, field_dimensions
from uqpen.archive.read import model_trees
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.field_places import label_at_place
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import (
    OutputTable,
    conversion,
    field_names,
    first_runs,
    label_with_unit,
    quantile_label,
)

__all__ = ["curve_tables", "place_option"]

# Fields of a model with a table of their own: the screen of a study with hundreds stays short.
_MOST_CURVES = 3

# The levels of the archive that are shown, as far as it has them.
_LEVELS = (0.05, 0.5, 0.95)


def curve_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield a table for each of the first curves of each model, at five places from end to end.

    A row is a place, the columns are the mean and quantiles from the first source of a mean. A
    field with several dimensions has no table.
    """
    for name, model in model_trees(tree).items():
        runs, statistics = first_runs(model), SourceStatistics(model)
        curves = [each for each in field_names(runs) if len(field_dimensions(runs[each])) == 1]
        for output in curves[:_MOST_CURVES]:
            means = statistics.by_source(output, "mean")
            if means:
                head = f"{name}: " if name else ""
                yield _curve_table(head, runs[output], statistics, next(iter(means)))


def place_option(tree: xr.DataTree) -> str:
    """Return the command that shows the first field at any place; empty where there is none."""
    for model in model_trees(tree).values():
        runs = first_runs(model)
        for output in field_names(runs):
            places = " ".join(
                f'--at "{coordinate_text(runs[each], runs[each].values[-1]).replace(" = ", "=")}"'
                for each in field_dimensions(runs[output])
            )
            return f"all statistics at any place:\n  uqpen show ARCHIVE --output {output} {places}"
    return ""


def _curve_table(
    head: str, output: xr.DataArray, statistics: SourceStatistics, source: str
) -> OutputTable:
    name, unit = str(output.name), str(output.attrs.get("display_units", DIMENSIONLESS))
    (dimension,) = field_dimensions(output)
    label = label_with_unit(label_at_place(name, output), unit)
    columns = {
        quantity: array
        for quantity, array in _columns(statistics, source, name).items()
        if dimension in array.dims
    }
    table = OutputTable(f"{head}{label} along {dimension}, by {source}", list(columns))
    last = output.sizes[dimension] - 1
    for position in dict.fromkeys(last * quarter // 4 for quarter in range(5)):
        cells = [
            table.cell(array[{dimension: position}], conversion(CATALOGUE["mean"], scale(unit)))
            for array in columns.values()
        ]
        place = coordinate_text(output[dimension], output[dimension].values[position], digits=4)
        table.rows.append((place, cells))
    return table


def _columns(statistics: SourceStatistics, source: str, name: str) -> dict[str, xr.DataArray]:
    """Return the mean and the shown quantiles of an output, by their labels."""
    found = {"mean": statistics.get(source, name, "mean")}
    quantiles = statistics.get(source, name, "quantile")
    if quantiles is not None:
        levels = quantiles["probability"].values
        for level in _LEVELS:
            for position in np.flatnonzero(levels == level).tolist():
                found[quantile_label(level)] = quantiles[{"probability": position}]
    return {label: array for label, array in found.items() if array is not None}
