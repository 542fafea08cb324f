"""Arrays with coordinates, made from variables as they are."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from xarray.indexes import PandasIndex

from uqpen.core.labels import BOUND, BOUNDS

__all__ = ["BOUND_COORDINATE", "labelled_array"]

_BOUND_INDEX = PandasIndex.from_variables({BOUND: xr.Variable(BOUND, list(BOUNDS))}, options={})
BOUND_COORDINATE = _BOUND_INDEX.create_variables()[BOUND]


def labelled_array(
    values: npt.NDArray[Any],
    dims: tuple[Hashable, ...],
    coordinates: Mapping[Any, Any],
    attributes: Mapping[Any, Any],
    name: str | None = None,
) -> xr.DataArray:
    """Return what the constructor of an array returns, without its copies of all coordinates.

    Those copies, text by text, took two fifths of the statistics of 300 outputs. All arrays have
    the index of `BOUND_COORDINATE` in common.

    Parameters
    ----------
    values : ndarray, shape (*dims)
    dims : tuple of hashable
    coordinates : mapping
        By name a variable or what makes one; with their indexes if they are `xarray.Coordinates`.
    attributes : mapping
    name : str, optional

    Raises
    ------
    ValueError
        If a coordinate has another dimension than the array, or another size.
    """
    variable = xr.Variable(dims, values, dict(attributes))
    variables: dict[Hashable, xr.Variable] = {}
    indexes: dict[Hashable, xr.Index] = {}
    if isinstance(coordinates, xr.Coordinates):
        variables |= {key: each.copy(deep=False) for key, each in coordinates.variables.items()}
        indexes |= coordinates.xindexes
    else:
        for key, given in coordinates.items():
            variables[key], index = _coordinate(key, given)
            indexes |= {} if index is None else {key: index}
    _check(variable, variables)
    # What users may call copies each coordinate, or makes an index of it again.
    return xr.DataArray(variable, variables, name=name, indexes=indexes, fastpath=True)


def _coordinate(key: Hashable, given: Any) -> tuple[xr.Variable, xr.Index | None]:
    """Return a coordinate and its index; None for one that is not along its own dimension."""
    if given is BOUND_COORDINATE:
        return BOUND_COORDINATE.copy(deep=False), _BOUND_INDEX
    variable = _as_variable(key, given)
    if variable.dims != (key,):
        return variable.to_base_variable(), None
    index = PandasIndex.from_variables({key: variable}, options={})
    return index.create_variables({key: variable})[key], index


def _as_variable(key: Hashable, given: Any) -> xr.Variable:
    """Return a variable, or the one of what makes one; labels alone are along their own name."""
    if isinstance(given, xr.Variable):
        return given
    if isinstance(given, xr.DataArray):
        return given.variable
    if isinstance(given, tuple):
        return xr.Variable(*given)
    return xr.Variable((key,) if np.ndim(given) else (), given)


def _check(variable: xr.Variable, coordinates: Mapping[Hashable, xr.Variable]) -> None:
    for key, each in coordinates.items():
        for dim, size in each.sizes.items():
            if variable.sizes.get(dim) != size:
                raise ValueError(
                    f"coordinate {key} has {size} values along {dim}, "
                    f"but the array has the sizes {dict(variable.sizes)}"
                )
