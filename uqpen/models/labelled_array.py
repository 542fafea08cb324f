"""Labelled arrays that a model returns, put into the declared order by their labels."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.errors import QuantityError
from uqpen.core.model import Dimension, Output
from uqpen.core.units import are_convertible, scale
from uqpen.models.run_grid import UnusableOutputError

__all__ = ["in_declared_order"]

# Coordinates are the same if they differ by this part of the whole length, as after a change of
# units.
_ROUNDING = 1e-9


def in_declared_order(value: Any, output: Output, own: Collection[str] = ()) -> Any:
    """Return a labelled array in the order of an output's dimensions and of their coordinates.

    Parameters
    ----------
    value : object
        An xarray DataArray, or anything else, which stays as it is. Further dimensions come before
        those of the output.
    output : Output
        The output as it is declared.
    own : collection of str
        The dimensions along which the run has a grid of its own, which it returns by itself.

    Raises
    ------
    UnusableOutputError
        If the array has coordinates along a declared dimension, and these are others than declared.
    """
    declared = [dimension.name for dimension in output.dims]
    names = getattr(value, "dims", ())
    is_labelled = hasattr(value, "transpose") and isinstance(names, tuple)
    if not declared or not is_labelled or not set(declared) <= set(names):
        return value
    for dimension in output.dims:
        if dimension.name in own or dimension.name not in getattr(value, "coords", ()):
            continue
        coordinates = value.coords[dimension.name]
        if coordinates.dtype.kind not in "iuf":
            continue  # names of places, which only their order can mean
        found = _in_si(coordinates, dimension, output)
        if len(found) == len(dimension.values):  # otherwise the shape is refused
            value = value.isel({dimension.name: _declared_positions(found, dimension, output)})
    return value.transpose(..., *declared)


def _in_si(coordinates: Any, dimension: Dimension, output: Output) -> FloatArray:
    """Return coordinates in SI units, from their attribute ``units`` or the declared unit."""
    declared = dimension.preferred_unit
    unit = str(coordinates.attrs.get("units", declared))
    try:
        if not are_convertible(unit, declared):
            raise QuantityError(f"the unit {unit}", f"one that converts to {declared}")
        return np.asarray(scale(unit).array_to_si(np.asarray(coordinates.values, dtype=np.float64)))
    except QuantityError as error:
        text = f'returned a "{output.name}" whose {dimension.name} is refused: {error}'
        raise UnusableOutputError(text) from None


def _declared_positions(found: FloatArray, dimension: Dimension, output: Output) -> IntArray:
    """Return where the array has each of the declared coordinates."""
    wanted = np.array(dimension.values)
    order = np.argsort(found, kind="stable")
    margin = _ROUNDING * (wanted[-1] - wanted[0] or abs(wanted[0]))
    is_same = np.abs(found[order] - wanted) <= margin
    if not is_same.all():
        position = int(is_same.argmin())
        place, other = (dimension.place_text(each[position]) for each in (wanted, found[order]))
        text = f"{output.name} is not there at {place}: its own coordinates have {other}"
        raise UnusableOutputError(text)
    return order
