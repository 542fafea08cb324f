"""What an estimate says of its own interval, wherever in its array that stands."""

from __future__ import annotations

import xarray as xr

from uqpen.labels import INTERVAL, INTERVAL_LABEL, NOTE

__all__ = ["own", "told"]


def told(array: xr.DataArray, what: str) -> str:
    """What an estimate says of its own interval; empty for nothing.

    Parameters
    ----------
    array : DataArray
        One estimate, along ``bound``, or several.
    what : str
        `uqpen.labels.INTERVAL`, ``INTERVAL_LABEL`` or ``NOTE``: an attribute of a single estimate,
        a coordinate where there are several, called after the array or its dimension.
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
    others = {
        f"{other}_{what}"
        for other in dataset.data_vars
        if other != name
        for what in (INTERVAL, INTERVAL_LABEL, NOTE)
    }
    array = dataset[name]
    return array.drop_vars([key for key in array.coords if key in others])
