"""What an estimate says of its own interval, wherever in its array that stands."""

from __future__ import annotations

from collections.abc import Container, Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.labels import INTERVAL, INTERVAL_LABEL, NOTE

__all__ = ["TOLD", "own", "stem", "told", "told_along"]

# All that it says.
TOLD = (INTERVAL, INTERVAL_LABEL, NOTE)


def told_along(
    called: str, shape: Mapping[str, int], texts: Mapping[str, npt.ArrayLike]
) -> dict[str, Any]:
    """What several estimates say, as coordinates along their dimensions.

    Parameters
    ----------
    called : str
        What the coordinates are called after.
    shape : mapping of str to int
        The estimates' dimensions and their sizes.
    texts : mapping of str to array_like of str
        By `TOLD`, what each of the estimates says.
    """
    return {
        f"{called}_{what}": (
            tuple(shape),
            np.array(texts[what], dtype=object).reshape(tuple(shape.values())),
            {"long_name": what.replace("_", " ")},
        )
        for what in TOLD
    }


def stem(name: str, dimensions: Sequence[str], keys: Container[Hashable]) -> str:
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


def told(array: xr.DataArray, what: str) -> str:
    """What an estimate says of its own interval; empty for nothing.

    Parameters
    ----------
    array : DataArray
        One estimate, along ``bound``, or several.
    what : str
        One of `TOLD`: an attribute of a single estimate, a coordinate where there are several.
    """
    own = f"{array.name}_{what}"
    if own in array.coords:
        return str(array.coords[own].values)
    for name, coordinate in array.coords.items():
        if str(name).endswith(f"_{what}"):
            return str(coordinate.values)
    return str(array.attrs.get(what, ""))


def own(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """A variable without what stands beside it of others along the same dimension."""
    others = {f"{other}_{what}" for other in dataset.data_vars if other != name for what in TOLD}
    array = dataset[name]
    return array.drop_vars([key for key in array.coords if key in others])
