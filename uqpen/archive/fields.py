"""Fields in the runs of an archive: outputs with dimensions besides that of the runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from uqpen.archive.layout import has_kind
from uqpen.core.labels import ROLE, RUN
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.core.variables import MOST_DIMENSIONS

__all__ = ["coordinate_text", "field_dimensions", "find_field_faults", "place_text"]


def field_dimensions(variable: xr.DataArray | xr.Variable) -> tuple[str, ...]:
    """Return the dimensions of an output of runs besides ``run``; none for a scalar."""
    return tuple(str(name) for name in variable.dims if name != RUN)


def place_text(variable: xr.DataArray, place: Sequence[int]) -> str:
    """Return the coordinates of a value of a field, such as `` at time = 3 s``; empty for a scalar.

    The place is the position of the value along ``run`` and each further dimension.
    """
    texts = [
        coordinate_text(variable[dimension], variable[dimension].values[position])
        for dimension, position in zip(variable.dims[1:], place[1:], strict=True)
    ]
    return f" at {', '.join(texts)}" if texts else ""


def coordinate_text(coordinate: xr.DataArray, value: float, digits: int = 10) -> str:
    """Return a value of a coordinate in its unit for display, such as ``time = 3 s``."""
    shown = str(coordinate.attrs.get("display_units", DIMENSIONLESS))
    written = f"{scale(shown).from_si(float(value)):.{digits}g}"
    return f"{coordinate.name} = {written}" + (f" {shown}" if shown != DIMENSIONLESS else "")


def find_field_faults(runs: xr.Dataset) -> Iterator[str]:
    """Yield the faults of the fields of a design's runs, and of their coordinates."""
    dimensions: set[str] = set()
    for name in runs.data_vars:
        variable = runs.variables[name]
        along = field_dimensions(variable)
        if variable.attrs.get(ROLE) != "output" or not along:
            continue
        dimensions.update(along)
        if variable.dims[0] != RUN or len(along) > MOST_DIMENSIONS:
            yield f"{name} does not lie along {RUN} and its own dimensions"
        elif not has_kind(variable, "number"):
            yield f"{name} is not of numbers"
    for dimension in sorted(dimensions):
        if fault := _coordinate_fault(runs, dimension):
            yield fault


def _coordinate_fault(runs: xr.Dataset, dimension: str) -> str:
    if dimension not in runs.coords or not has_kind(runs[dimension], "number"):
        return f"no coordinates along {dimension}"
    values = runs[dimension].values
    if not np.isfinite(values).all() or not (np.diff(values) > 0).all():
        return f"coordinates along {dimension} that do not ascend"
    return "" if "units" in runs[dimension].attrs else f"no units of {dimension}"
