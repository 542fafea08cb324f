"""Fields among the outputs of an archive as tables: a row for each, with the range of its mean."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.fields import field_dimensions
from uqpen.archive.read import model_trees
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.field_places import label_at_place
from uqpen.results.field_texts import extent_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    conversion,
    field_names,
    first_runs,
    label_with_unit,
)

__all__ = ["field_tables"]


def field_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield a table for the fields of each model along the same dimensions.

    Examples
    --------
    A row is ``infected: 0.00115 ± 0.00023, 0.279 ± 0.012``: the ends of the range of its mean.
    """
    for name, model in model_trees(tree).items():
        head = f"{name}: " if name else ""
        runs = first_runs(model)
        statistics = SourceStatistics(model)
        tables: dict[str, OutputTable] = {}
        for output in field_names(runs):
            along = ", ".join(extent_text(runs[each]) for each in field_dimensions(runs[output]))
            means = statistics.by_source(output, "mean")
            source, mean = next(iter(means.items()), ("", None))
            title = f"{head}along {along}{f'; mean by {source}' if source else ''}"
            table = tables.setdefault(title, OutputTable(title, ["smallest mean", "largest mean"]))
            unit = str(runs[output].attrs.get("display_units", DIMENSIONLESS))
            label = label_with_unit(label_at_place(output, runs[output]), unit)
            table.rows.append((label, _range_cells(table, mean, unit)))
        yield from tables.values()


def _range_cells(table: OutputTable, mean: xr.DataArray | None, unit: str) -> list[str]:
    """Return the smallest and the largest mean over all places."""
    if mean is None or not np.isfinite(mean.values[..., 0]).any():
        return [NOTHING, NOTHING]
    estimates = mean.values[..., 0]
    ends = (np.nanargmin(estimates), np.nanargmax(estimates))
    places = (np.unravel_index(position, estimates.shape) for position in ends)
    return [table.cell(mean[at], conversion(CATALOGUE["mean"], scale(unit))) for at in places]
