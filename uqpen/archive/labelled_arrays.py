"""Arrays with coordinates, made from variables as they are."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from xarray.indexes import PandasIndex

from uqpen.core.labels import BOUND, BOUNDS

__all__ = ["BOUND_COORDINATE", "array_entries", "labelled_array"]

_BOUND_INDEX = PandasIndex.from_variables({BOUND: xr.Variable(BOUND, list(BOUNDS))}, options={})
BOUND_COORDINATE = _BOUND_INDEX.create_variables()[BOUND]

# Equal labels have one index: those of inputs, quantiles and ranks stand at each output again. What
# is kept takes a few MB at most.
_KEPT_INDEXES, _MOST_LABELS = 64, 4096


def labelled_array(
    values: npt.NDArray[Any],
    dims: tuple[Hashable, ...],
    coordinates: Mapping[Any, Any],
    attributes: Mapping[Any, Any],
    name: str | None = None,
    texts: Mapping[Any, xr.Variable] | None = None,
) -> xr.DataArray:
    """Return what the constructor of an array returns, without its copies of all coordinates.

    Those copies, text by text, took two fifths of the statistics of 300 outputs. All arrays have
    the index of `BOUND_COORDINATE` in common, and others that have equal labels.

    Parameters
    ----------
    values : ndarray, shape (*dims)
    dims : tuple of hashable
    coordinates : mapping
        By name a variable or what makes one; with their indexes if they are `xarray.Coordinates`.
    attributes : mapping
    name : str, optional
    texts : mapping of Variable, optional
        Further coordinates without an index, which nothing else holds.

    Raises
    ------
    ValueError
        If a coordinate has another dimension than the array, or another size.
    """
    variable = xr.Variable(dims, values, dict(attributes), fastpath=True)
    variables: dict[Hashable, xr.Variable] = {}
    indexes: dict[Hashable, xr.Index] = {}
    if isinstance(coordinates, xr.Coordinates):
        variables |= {key: each.copy(deep=False) for key, each in coordinates.variables.items()}
        indexes |= coordinates.xindexes
    else:
        for key, given in coordinates.items():
            variables[key], index = _coordinate(key, given)
            indexes |= {} if index is None else {key: index}
    variables |= texts or {}
    _check(variable, variables)
    # What users may call copies each coordinate, or makes an index of it again.
    return xr.DataArray(variable, variables, name=name, indexes=indexes, fastpath=True)


def array_entries(array: xr.DataArray) -> list[xr.DataArray]:
    """Return the entries of an array along its first dimension, as iteration yields them.

    xarray looks at each coordinate anew for each entry, which took half of the time of tables.
    """
    (first, *others), coordinates = array.dims, array.coords.variables
    along = {key: each.values for key, each in coordinates.items() if first in each.dims}
    if any(coordinates[key].dims[0] != first for key in along):
        return list(array)
    others_indexes = {key: each for key, each in array.xindexes.items() if key not in along}
    found = []
    for place in range(array.sizes[first]):
        own = {
            key: xr.Variable(each.dims[1:], along[key][place, ...], dict(each.attrs), fastpath=True)
            if key in along
            else each.copy(deep=False)
            for key, each in coordinates.items()
        }
        variable = xr.Variable(others, array.values[place, ...], dict(array.attrs), fastpath=True)
        entry = xr.DataArray(variable, own, name=array.name, indexes=others_indexes, fastpath=True)
        found.append(entry)
    return found


def _coordinate(key: Hashable, given: Any) -> tuple[xr.Variable, xr.Index | None]:
    """Return a coordinate and its index; None for one that is not along its own dimension."""
    if given is BOUND_COORDINATE:
        return BOUND_COORDINATE.copy(deep=False), _BOUND_INDEX
    variable = _as_variable(key, given)
    if variable.dims != (key,):
        return variable.to_base_variable(), None
    labels = _hashable(variable.values)
    if not labels:
        return _indexed(key, variable)
    coordinate, index = _indexed_labels(key, variable.dtype.str, labels)
    coordinate = coordinate.copy(deep=False)
    coordinate.attrs = variable.attrs
    return coordinate, index


def _indexed(key: Hashable, variable: xr.Variable) -> tuple[xr.Variable, xr.Index]:
    index = PandasIndex.from_variables({key: variable}, options={})
    return index.create_variables({key: variable})[key], index


@lru_cache(_KEPT_INDEXES)
def _indexed_labels(
    key: Hashable, dtype: str, labels: bytes | tuple[str, ...]
) -> tuple[xr.Variable, xr.Index]:
    """Return a coordinate of some labels, and its index."""
    if isinstance(labels, bytes):
        return _indexed(key, xr.Variable(key, np.frombuffer(labels, np.dtype(dtype))))
    return _indexed(key, xr.Variable(key, np.array(labels, dtype=object)))


def _hashable(values: npt.NDArray[Any]) -> bytes | tuple[str, ...]:
    """Return labels as their bytes, or as texts; empty for those that are not kept."""
    if values.size > _MOST_LABELS or values.dtype.kind not in "OUifb":
        return ()
    if values.dtype.kind != "O":
        return values.tobytes()
    return tuple(values.tolist()) if _are_texts(values) else ()


def _are_texts(values: npt.NDArray[Any]) -> bool:
    return all(type(each) is str for each in values.ravel().tolist())


def _as_variable(key: Hashable, given: Any) -> xr.Variable:
    """Return a variable, or the one of what makes one; labels alone are along their own name."""
    if isinstance(given, xr.Variable):
        return given
    if isinstance(given, xr.DataArray):
        return given.variable
    if not isinstance(given, tuple):
        return xr.Variable((key,) if np.ndim(given) else (), given)
    dims, values, attributes, *_ = (*given, None)
    # xarray looks for dates among objects, which takes longer than all else.
    is_ready = isinstance(values, np.ndarray) and (
        values.dtype.kind in "Uifb" or (values.dtype.kind == "O" and _are_texts(values))
    )
    return xr.Variable(dims, values, attributes, fastpath=is_ready)


def _check(variable: xr.Variable, coordinates: Mapping[Hashable, xr.Variable]) -> None:
    sizes = dict(zip(variable.dims, variable.shape, strict=True))
    for key, each in coordinates.items():
        for dim, size in zip(each.dims, each.shape, strict=True):
            if sizes.get(dim) != size:
                raise ValueError(
                    f"coordinate {key} has {size} values along {dim}, "
                    f"but the array has the sizes {sizes}"
                )
