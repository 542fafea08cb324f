"""Fields among the outputs of an archive as lines of text: their dimensions and their range."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.fields import coordinate_text, field_dimensions
from uqpen.archive.read import model_trees
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import DERIVED_FROM
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.digits import estimate_text, number_text
from uqpen.results.field_places import label_at_place
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import (
    conversion,
    field_names,
    first_runs,
    label_with_unit,
    shown_bounds,
)

__all__ = ["derived_lines", "extent_text", "field_lines"]


def field_lines(tree: xr.DataTree) -> Iterator[str]:
    """Yield a line for each field of each model, and for each number that follows from one.

    Examples
    --------
    ``infected: along time [day] from 0 to 160 (161); by mc mean from 0.00115 ± 0.00023 at time =
    160 day to 0.279 ± 0.012 at time = 31 day, sd at most 0.096 ± 0.010 at time = 32 day``

    ``peak: largest infected along time``
    """
    for name, model in model_trees(tree).items():
        head = f"{name}: " if name else ""
        runs = first_runs(model)
        for output in field_names(runs):
            unit = str(runs[output].attrs.get("display_units", DIMENSIONLESS))
            label = label_with_unit(label_at_place(output, runs[output]), unit)
            places = ", ".join(extent_text(runs[each]) for each in field_dimensions(runs[output]))
            yield f"{head}{label}: along {places}{_range_text(model, output, unit)}"
        yield from (f"{head}{line}" for line in derived_lines(model))


def derived_lines(model: xr.DataTree) -> Iterator[str]:
    """Yield what each number of a model is that follows from a field."""
    runs = first_runs(model)
    for derived in runs.data_vars:
        variable = runs.variables[derived]
        # The companion of a number that not all runs have is described by its shares.
        if DERIVED_FROM in variable.attrs and "display_units" in variable.attrs:
            label = label_with_unit(str(derived), str(variable.attrs["display_units"]))
            yield f"{label}: {variable.attrs['long_name']}"


def extent_text(coordinate: xr.DataArray) -> str:
    """Return the name of a dimension with its unit, its ends and its size."""
    unit = str(coordinate.attrs.get("display_units", DIMENSIONLESS))
    ends = scale(unit).from_si(np.asarray(coordinate.values[[0, -1]], dtype=np.float64))
    label = label_with_unit(str(coordinate.name), unit)
    return (
        f"{label} from {number_text(ends[0], 6)} to {number_text(ends[1], 6)} ({coordinate.size})"
    )


def _range_text(model: xr.DataTree, output: str, unit: str) -> str:
    """Return the range of the mean and the largest sd, by the first source that has a mean."""
    statistics = SourceStatistics(model)
    source, mean = next(iter(statistics.by_source(output, "mean").items()), ("", None))
    if mean is None or not np.isfinite(mean.values[..., 0]).any():
        return ""
    lowest, highest = (
        _text_at(mean, "mean", unit, int(find(mean.values[..., 0])))
        for find in (np.nanargmin, np.nanargmax)
    )
    text = f"; by {source} mean from {lowest} to {highest}"
    std = statistics.get(source, output, "std")
    if std is None or not np.isfinite(std.values[..., 0]).any():
        return text
    largest = _text_at(std, "std", unit, int(np.nanargmax(std.values[..., 0])))
    return f"{text}, sd at most {largest}"


def _text_at(array: xr.DataArray, statistic: str, unit: str, position: int) -> str:
    """Return an estimate at one place of a field, by its position among all, and the place."""
    index = np.unravel_index(position, array.shape[:-1])
    estimate = estimate_text(
        *shown_bounds(array[index], conversion(CATALOGUE[statistic], scale(unit)))
    )
    places = (
        coordinate_text(array[dim], array[dim].values[at], 6)
        for dim, at in zip(array.dims, index, strict=False)
    )
    return f"{estimate} at {', '.join(places)}"
