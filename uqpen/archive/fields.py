"""Fields in the runs of an archive: outputs with dimensions besides that of the runs."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from uqpen.core.labels import RUN
from uqpen.core.units import DIMENSIONLESS, scale


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


def entry_place(array: xr.DataArray, index: Sequence[int]) -> str:
    """Return the place of an entry along the first dimensions, such as ``time = 3 s, x = 1 m``."""
    along = (array[dim] for dim in array.dims)
    pairs = zip(along, index, strict=False)
    return ", ".join(coordinate_text(each, each.values[at], 6) for each, at in pairs)
