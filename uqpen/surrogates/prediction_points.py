"""Points to predict at, as a caller gives them: quantities, numbers, arrays of either."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import ModelError, QuantityError
from uqpen.core.labels import RUN
from uqpen.core.model import Input
from uqpen.core.quantities import parse_quantity
from uqpen.core.units import are_convertible, describe, scale

__all__ = ["broadcast_inputs", "input_array"]


def input_array(variable: Input, given: Any) -> xr.DataArray:
    """Return values of an input in SI units, as an array with its dimensions.

    Raises
    ------
    QuantityError
        If one is no finite quantity of its dimension, or nested sequences lack dimensions.
    """
    try:
        if isinstance(given, xr.DataArray):
            values = given.copy(data=_from_unit(given, variable))
        else:
            numbers = _numbers(given, variable)
            if numbers.ndim > 1:
                shape = f"an array of shape {numbers.shape}"
                raise QuantityError(shape, "one value for each point, or a DataArray")
            values = xr.DataArray(numbers, dims=(RUN,) * numbers.ndim)
    except QuantityError as error:
        raise QuantityError(f"{variable.name} = {error.found}", error.expected) from None
    if not np.isfinite(values.values).all():
        raise QuantityError(f"{variable.name} with values that are not finite", "finite numbers")
    attributes = {"units": variable.unit, "display_units": variable.preferred_unit}
    return values.drop_attrs().assign_attrs(long_name=variable.title, **attributes)


def _from_unit(given: xr.DataArray, variable: Input) -> FloatArray:
    unit = str(given.attrs.get("units", variable.unit))
    if not are_convertible(unit, variable.unit):
        raise QuantityError(f'an array in "{unit}"', describe(variable.unit))
    converted: FloatArray = scale(unit).array_to_si(_numbers(given.values, variable))
    return converted


def _numbers(given: Any, variable: Input) -> FloatArray:
    """Return numbers as they are, and quantities in SI units."""
    values = np.asarray(given)
    if values.dtype.kind in "iuf":
        return values.astype(np.float64)
    flat = [
        each if type(each) in (int, float) else parse_quantity(each, variable.unit).value
        for each in np.asarray(given, dtype=object).ravel().tolist()
    ]
    return np.array(flat, dtype=np.float64).reshape(values.shape)


def broadcast_inputs(given: Mapping[str, xr.DataArray]) -> dict[str, xr.DataArray]:
    """Return the inputs along all dimensions of any; a ModelError says that they do not fit."""
    try:
        aligned = xr.align(*given.values(), join="exact")
    except ValueError:
        sizes = ", ".join(f"{name} {dict(array.sizes)}" for name, array in given.items())
        raise ModelError(f"the inputs differ in their points: {sizes}") from None
    return dict(zip(given, xr.broadcast(*aligned), strict=True))
