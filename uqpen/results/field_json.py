"""Dimensions and places of fields as JSON."""

from __future__ import annotations

from typing import Any

import xarray as xr

from uqpen.archive.fields import field_dimensions
from uqpen.core.units import DIMENSIONLESS
from uqpen.results.output_selection import cut_coordinates

__all__ = ["field_json"]


def field_json(variable: xr.DataArray) -> dict[str, Any]:
    """Return ``dimensions`` and the place ``at`` which an output was cut; nothing without any.

    Coordinates are in SI units.
    """
    dimensions = {
        name: {
            "size": int(variable.sizes[name]),
            "units": str(variable[name].attrs.get("units", DIMENSIONLESS)),
            "coordinates": variable[name].values.tolist(),
        }
        for name in field_dimensions(variable)
    }
    places = {str(each.name): each.item() for each in cut_coordinates(variable)}
    found = {"dimensions": dimensions, "at": places}
    return {key: content for key, content in found.items() if content}
