"""What an estimate says of its own interval, wherever in its array that stands."""

from __future__ import annotations

from collections.abc import Container, Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.labels import INTERVAL, INTERVAL_LABEL, NOTE

__all__ = [
    "INTERVAL_METADATA",
    "interval_metadata",
    "metadata_coordinates",
    "metadata_prefix",
    "select_variable",
]

# All that it says.
INTERVAL_METADATA = (INTERVAL, INTERVAL_LABEL, NOTE)


def metadata_coordinates(
    prefix: str, shape: Mapping[str, int], texts: Mapping[str, npt.ArrayLike]
) -> dict[str, Any]:
    """What several estimates say, as coordinates along their dimensions.

    Parameters
    ----------
    prefix : str
        What the coordinates are called after.
    shape : mapping of str to int
        The estimates' dimensions and their sizes.
    texts : mapping of str to array_like of str
        By `INTERVAL_METADATA`, what each of the estimates says.
    """
    return {
        f"{prefix}_{what}": (
            tuple(shape),
            np.array(texts[what], dtype=object).reshape(tuple(shape.values())),
            {"long_name": what.replace("_", " ")},
        )
        for what in INTERVAL_METADATA
    }


def metadata_prefix(name: str, dimensions: Sequence[str], keys: Container[Hashable]) -> str:
    """What those coordinates of a variable are called after.

    Parameters
    ----------
    name : str
        The variable's, which they bear where several variables share a dimension.
    dimensions : sequence of str
        Its own, one of which they bear otherwise.
    keys : container of str
        The coordinates that there are.

    Returns
    -------
    str
        Empty where there are none: the variable's attributes tell of all its figures.
    """
    stems = (each for each in (name, *dimensions) if f"{each}_{INTERVAL_LABEL}" in keys)
    return next(stems, "")


def interval_metadata(array: xr.DataArray, key: str) -> str:
    """What an estimate says of its own interval; empty for nothing.

    Parameters
    ----------
    array : DataArray
        One estimate, along ``bound``, or several.
    key : str
        One of `INTERVAL_METADATA`: an attribute of a single estimate, a coordinate where there are
        several.
    """
    own = f"{array.name}_{key}"
    if own in array.coords:
        return str(array.coords[own].values)
    for name, coordinate in array.coords.items():
        if str(name).endswith(f"_{key}"):
            return str(coordinate.values)
    return str(array.attrs.get(key, ""))


def select_variable(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """A variable without what stands beside it of others along the same dimension."""
    others = {
        f"{other}_{what}"
        for other in dataset.data_vars
        if other != name
        for what in INTERVAL_METADATA
    }
    array = dataset[name]
    return array.drop_vars([key for key in array.coords if key in others])
