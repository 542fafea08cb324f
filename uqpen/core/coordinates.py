"""Coordinates of fields as variables of a dataset."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

from uqpen.core.variables import Dimension

__all__ = ["field_coordinates"]


def field_coordinates(dims: Iterable[Dimension]) -> dict[str, xr.Variable]:
    """Return the coordinates of fields by dimension, with units and names."""
    import xarray as xr

    return {
        each.name: xr.Variable(each.name, np.array(each.values), each.attributes) for each in dims
    }
