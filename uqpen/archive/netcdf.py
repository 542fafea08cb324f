"""Tree of datasets as a NetCDF file whose variables are all defined before the first is filled.

xarray defines and fills variables in turns. At each change from one to the other, the library
writes the metadata of the whole file. With more than a thousand variables of an archive, that takes
many times as long as everything else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqpen.archive.lazy_variables import OpenFile, is_in_memory, lazy_dataset, value_blocks
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.netcdf.opening import open_own

if TYPE_CHECKING:
    import netCDF4

_COORDINATES = "coordinates"


def write_tree(
    tree: xr.DataTree, path: Path, root_attributes: Mapping[str, str] | None = None
) -> None:
    """Write a tree of numbers and texts such that xarray reads it back unchanged.

    No group may use a dimension of its parent groups. An existing file is overwritten. Values are
    written by blocks, so those that are in another file need not be in memory. Further attributes
    of the root need no copy of the tree, which takes as long as its hashes.
    """
    further = {"/": dict(root_attributes or {})}
    with open_own(path, "w") as root:
        filled = [
            pair
            for node in tree.subtree
            for pair in _define_variables(
                root.createGroup(node.path),
                node.to_dataset(inherit=False),
                further.get(node.path, {}),
            )
        ]
        for defined, variable in filled:
            kind = object if variable.dtype.kind in "OU" else None
            for place, values in value_blocks(variable):
                defined[place] = np.asarray(values, dtype=kind)


def read_groups(root: netCDF4.Dataset, runs_in_memory: int = RUNS_IN_MEMORY) -> xr.DataTree:
    """Read a whole NetCDF file into memory, group by group.

    Of variables that begin with a dimension of more than `runs_in_memory`, the values stay in the
    file until they are needed; it is then open as long as they are. xarray's reader opens each
    variable as a file of its own, and decodes what an archive has none of: it takes three times as
    long.

    OSError, RuntimeError, ValueError or AttributeError if the library cannot read it.
    """
    # Units such as "s" stay numbers, and flags stay whole numbers.
    root.set_auto_maskandscale(False)
    open_file = cache(lambda: OpenFile(Path(root.filepath())))

    def read(path: str, variable: Any) -> xr.Variable:
        if variable.shape and variable.shape[0] > runs_in_memory:
            return open_file().variable(path, variable.name)
        own = {key: variable.getncattr(key) for key in variable.ncattrs()}
        return xr.Variable(variable.dimensions, np.asarray(variable[...]), own)

    tree = xr.DataTree(_read_dataset(root, "/", read))
    _read_groups(tree, root, read)
    return tree


# Reads a variable of the group at a path.
_Reader = Callable[[str, Any], xr.Variable]


def _read_groups(node: xr.DataTree, group: Any, read: _Reader) -> None:
    """Give a node the groups in its group as children, each with its own.

    From the root on, as `DataTree.from_dict` does, which copies each dataset once more.
    """
    node.children = {
        name: xr.DataTree(_read_dataset(child, child.path, read))
        for name, child in group.groups.items()
    }
    for name, child in node.children.items():
        _read_groups(child, group.groups[name], read)


def _read_dataset(group: Any, path: str, read: _Reader) -> xr.Dataset:
    attributes = {name: group.getncattr(name) for name in group.ncattrs()}
    coordinates = set(str(attributes.pop(_COORDINATES, "")).split())
    variables = {}
    for name, variable in group.variables.items():
        variables[name] = read(path, variable)
        coordinates.update(str(variables[name].attrs.pop(_COORDINATES, "")).split())
    coordinates |= set(group.dimensions)
    make = xr.Dataset if all(map(is_in_memory, variables.values())) else lazy_dataset
    return make(
        {name: each for name, each in variables.items() if name not in coordinates},
        {name: each for name, each in variables.items() if name in coordinates},
        attributes,
    )


def _define_variables(
    group: Any, dataset: xr.Dataset, further: Mapping[str, str]
) -> Iterator[tuple[Any, Any]]:
    """Define the variables of a group; yield each, still empty, with the one to write."""
    group.setncatts({**dataset.attrs, **further})
    for dimension, size in dataset.sizes.items():
        group.createDimension(str(dimension), size)
    # The coordinates of each variable, except the dimension coordinates.
    auxiliary = {
        str(key): set(dataset.variables[key].dims)
        for key in dataset.coords
        if key not in dataset.dims
    }
    beside = {
        str(name): [
            key for key, dims in auxiliary.items() if dims <= {*dataset.variables[name].dims}
        ]
        for name in dataset.data_vars
    }
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
        yield defined, variable
    claimed = {name for names in beside.values() for name in names}
    unclaimed = [name for name in auxiliary if name not in claimed]
    if unclaimed:
        group.setncattr(_COORDINATES, " ".join(unclaimed))
