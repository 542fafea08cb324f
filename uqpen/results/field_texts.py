"""Fields among the outputs of an archive: their dimensions, as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.fields import field_dimensions
from uqpen.archive.read import model_trees
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.table import first_runs, label_with_unit, output_names

__all__ = ["dimensions_json", "field_lines"]


def field_lines(tree: xr.DataTree) -> Iterator[str]:
    """Yield a line for each field of each model.

    Examples
    --------
    ``infected: along time [day] from 0 to 160 (161)``
    """
    for name, model in model_trees(tree).items():
        head = f"{name}: " if name else ""
        runs = first_runs(model)
        for output in output_names(runs):
            along = field_dimensions(runs[output])
            if along:
                unit = str(runs[output].attrs.get("display_units", DIMENSIONLESS))
                places = ", ".join(_extent(runs[dimension]) for dimension in along)
                yield f"{head}{label_with_unit(output, unit)}: along {places}"


def _extent(coordinate: xr.DataArray) -> str:
    """Return the name of a dimension with its unit, its ends and its size."""
    unit = str(coordinate.attrs.get("display_units", DIMENSIONLESS))
    ends = scale(unit).from_si(np.asarray(coordinate.values[[0, -1]], dtype=np.float64))
    label = label_with_unit(str(coordinate.name), unit)
    return f"{label} from {ends[0]:.6g} to {ends[1]:.6g} ({coordinate.size})"


def dimensions_json(runs: xr.Dataset, output: str) -> dict[str, Any]:
    """Return the size of each dimension of a field, and its unit; empty for a scalar."""
    return {
        dimension: {
            "size": int(runs.sizes[dimension]),
            "units": str(runs[dimension].attrs.get("units", DIMENSIONLESS)),
        }
        for dimension in field_dimensions(runs[output])
    }
