"""Tree of datasets as a NetCDF file whose variables are all defined before the first is filled.

xarray defines and fills variables in turns. At each change from one to the other, the library
writes the metadata of the whole file. With more than a thousand variables of an archive, that takes
many times as long as everything else.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

if TYPE_CHECKING:
    import netCDF4

__all__ = ["read_groups", "write_tree"]

_COORDINATES = "coordinates"


def write_tree(tree: xr.DataTree, path: Path) -> None:
    """Write a tree of numbers and texts such that xarray reads it back unchanged.

    No group may use a dimension of its parent groups. An existing file is overwritten.
    """
    import netCDF4

    with netCDF4.Dataset(path, "w", format="NETCDF4") as root:
        filled = [
            pair
            for node in tree.subtree
            for pair in _define_variables(
                root.createGroup(node.path), node.to_dataset(inherit=False)
            )
        ]
        for variable, values in filled:
            variable[...] = values


def read_groups(root: netCDF4.Dataset) -> xr.DataTree:
    """Read a whole NetCDF file into memory, group by group.

    xarray's reader opens each variable as a file of its own, and decodes what an archive has none
    of: it takes three times as long.

    Raises
    ------
    OSError, RuntimeError, ValueError, AttributeError
        If the library cannot read it.
    """
    # Units such as "s" stay numbers, and flags stay whole numbers.
    root.set_auto_maskandscale(False)
    return xr.DataTree.from_dict(dict(_read_groups(root, "/")))


def _read_groups(group: Any, path: str) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield a group's dataset, and those of the groups in it."""
    yield path, _read_dataset(group)
    for name, child in group.groups.items():
        yield from _read_groups(child, f"{path.rstrip('/')}/{name}")


def _read_dataset(group: Any) -> xr.Dataset:
    attributes = {name: group.getncattr(name) for name in group.ncattrs()}
    coordinates = set(str(attributes.pop(_COORDINATES, "")).split())
    variables = {}
    for name, variable in group.variables.items():
        own = {key: variable.getncattr(key) for key in variable.ncattrs()}
        coordinates.update(str(own.pop(_COORDINATES, "")).split())
        values = np.asarray(variable[...])
        variables[name] = xr.Variable(variable.dimensions, values, own)
    coordinates |= set(group.dimensions)
    return xr.Dataset(
        {name: each for name, each in variables.items() if name not in coordinates},
        {name: each for name, each in variables.items() if name in coordinates},
        attributes,
    )


def _define_variables(group: Any, dataset: xr.Dataset) -> Iterator[tuple[Any, Any]]:
    """Define the variables of a group; yield each, still empty, with the values to write."""
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
    """Return the coordinates of each variable, except the dimension coordinates."""
    known = [(key, set(dataset.variables[key].dims)) for key in _auxiliary_coordinates(dataset)]
    return {
        str(name): [key for key, dims in known if dims <= set(dataset.variables[name].dims)]
        for name in dataset.data_vars
    }


def _auxiliary_coordinates(dataset: xr.Dataset) -> list[str]:
    """Return the coordinates that are no dimension coordinates."""
    return [str(key) for key in dataset.coords if key not in dataset.dims]
