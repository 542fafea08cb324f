"""A tree of datasets as a NetCDF file, its variables all defined before the first is filled.

xarray defines and fills them by turns, and the library writes the description of the whole file
each time it changes from the one to the other; with the thousand and more variables of an archive,
that takes many times as long as all the rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqpen.archive.interval_metadata import INTERVAL_METADATA

if TYPE_CHECKING:
    import netCDF4

__all__ = ["write_tree"]

_COORDINATES = "coordinates"


def write_tree(tree: xr.DataTree, path: Path) -> None:
    """Write a tree so that xarray reads it back as it is.

    Parameters
    ----------
    tree : DataTree
        Of numbers and texts; no group uses a dimension of one further out.
    path : Path
        What stands there is lost.
    """
    import netCDF4

    with netCDF4.Dataset(path, "w", format="NETCDF4") as root:
        filled = [
            pair
            for node in tree.subtree
            for pair in _define_variables(
                _create_group(root, node.path), node.to_dataset(inherit=False)
            )
        ]
        for variable, values in filled:
            variable[...] = values


def _create_group(root: netCDF4.Dataset, path: str) -> Any:
    return root if path == "/" else root.createGroup(path)


def _define_variables(group: Any, dataset: xr.Dataset) -> Iterator[tuple[Any, Any]]:
    """Each variable of a group, defined but empty, and what it is to hold."""
    group.setncatts(dataset.attrs)
    for dimension, size in dataset.sizes.items():
        group.createDimension(str(dimension), size)
    beside = _coordinate_names(dataset)
    for name, variable in dataset.variables.items():
        is_text = variable.dtype.kind in "OU"
        # Without a fill value: CF forbids one of coordinates, and nothing stays unfilled.
        defined = group.createVariable(
            str(name),
            str if is_text else variable.dtype,
            tuple(map(str, variable.dims)),
            fill_value=None if is_text else False,
        )
        defined.set_auto_maskandscale(False)
        names = beside.get(str(name))
        defined.setncatts(variable.attrs | ({_COORDINATES: " ".join(names)} if names else {}))
        yield defined, np.asarray(variable.values, dtype=object if is_text else None)
    claimed = {name for names in beside.values() for name in names}
    unclaimed = [name for name in _auxiliary_coordinates(dataset) if name not in claimed]
    if unclaimed:
        group.setncattr(_COORDINATES, " ".join(unclaimed))


def _coordinate_names(dataset: xr.Dataset) -> dict[str, list[str]]:
    """The coordinates of each variable, beyond those that stand for its dimensions."""
    owners = {f"{name}_{what}": name for name in dataset.data_vars for what in INTERVAL_METADATA}
    known = [
        (key, set(dataset.variables[key].dims), owners.get(key))
        for key in _auxiliary_coordinates(dataset)
    ]
    return {
        str(name): [
            key
            for key, dimensions, owner in known
            if dimensions <= set(dataset.variables[name].dims) and owner in (None, name)
        ]
        for name in dataset.data_vars
    }


def _auxiliary_coordinates(dataset: xr.Dataset) -> list[str]:
    """The coordinates that do not stand for a dimension."""
    return [str(key) for key in dataset.coords if key not in dataset.dims]
