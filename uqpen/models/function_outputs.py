"""Outputs in the value that a user's function returned, which can be anything."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray, floats
from uqpen.core.errors import QuantityError
from uqpen.core.model import Dimension, Output
from uqpen.core.units import are_convertible, scale
from uqpen.models.run_grid import RunGrid, UnusableOutputError

__all__ = ["dimension_names", "extract_outputs", "in_declared_order"]

# Labelled arrays that a model returns, put into the declared order by their labels.

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


# Names in a message; a study may have hundreds of outputs.
_MOST_NAMED = 4

_NO_GRIDS: Mapping[str, RunGrid] = {}


def extract_outputs(
    returned: object,
    outputs: Sequence[Output],
    runs: int | None,
    grids: Mapping[str, RunGrid] = _NO_GRIDS,
) -> dict[str, FloatArray]:
    """Return the declared outputs in the value that a function returned.

    Parameters
    ----------
    returned : object
        The value.
    outputs : sequence of Output
        The declared outputs.
    runs : int or None
        The number of runs of a vectorised call; None for a call that makes one run.
    grids : mapping of str to RunGrid
        By output, the grid of one run that it is returned on.

    Returns
    -------
    dict of str to ndarray, shape (run, *dims) or (*dims,)
        By output, in the units of the function.

    Raises
    ------
    UnusableOutputError
        If an output is missing, is not of numbers, or has another shape than declared.
    """
    if not isinstance(returned, Mapping):
        text = f"returned {type(returned).__name__}, not a mapping of outputs"
        raise UnusableOutputError(f"{text}; expected {_example(outputs, runs)}")
    found = {}
    for output in outputs:
        grid = grids.get(output.name)
        values = _numbers(returned, output.name, output, grid.names if grid else ())
        if grid:
            own = {name: _numbers(returned, key) for name, key in grid.names.items()}
            shape = tuple(
                values.shape[axis] if dim.name in own and axis < values.ndim else len(dim.values)
                for axis, dim in enumerate(output.dims)
            )
            _check_shape(output, values, shape, runs)
            found[output.name] = grid.interpolate(output, values, own)
        else:
            shape = output.shape if runs is None else (runs, *output.shape)
            _check_shape(output, values, shape, runs)
            found[output.name] = values
    return found


def _numbers(
    returned: Mapping[Any, Any], name: str, output: Output | None = None, own: Collection[str] = ()
) -> FloatArray:
    if name not in returned:
        others = [f'"{key}"' for key in returned]
        listing = ", ".join([*others[:_MOST_NAMED], *["…"] * (len(others) > _MOST_NAMED)])
        raise UnusableOutputError(f'returned no "{name}"{f", but {listing}" * bool(others)}')
    value = returned[name]
    try:
        return floats(value if output is None else in_declared_order(value, output, own))
    except ValueError as error:
        raise UnusableOutputError(f'returned a "{name}" of {error}') from None


def _check_shape(
    output: Output, values: FloatArray, shape: tuple[int, ...], runs: int | None
) -> None:
    if values.shape != shape:
        names = ["run"] * (runs is not None) * bool(output.dims)
        expected = f"{shape}{dimension_names(output, *names)}"
        text = f'returned a "{output.name}" of shape {values.shape}, not {expected}'
        raise UnusableOutputError(text + _shape_hint(output, values, runs))


def _shape_hint(output: Output, values: FloatArray, runs: int | None) -> str:
    """Return the expected form of a number; that of a field is in its dimensions."""
    if output.dims:
        return ""
    if runs is not None:
        return "; expected an array with a number for each run"
    if values.size == 1:
        return f"; expected one number, such as {output.name}.item()"
    return "; expected one number; an output with several is declared with along"


def _example(outputs: Sequence[Output], runs: int | None) -> str:
    """Return an example of what a function returns, in Python."""
    pairs = [f'"{output.name}": {output.name}' for output in outputs[:_MOST_NAMED]]
    pairs += ["…"] * (len(outputs) > _MOST_NAMED)
    of_each = " with arrays along the runs" if runs is not None else ""
    return f"return {{{', '.join(pairs)}}}{of_each}"


def dimension_names(output: Output, *before: str) -> str:
    """Return the names of the dimensions of a field, in brackets; empty for a number."""
    if not output.dims:
        return ""
    return f" along ({', '.join([*before, *(dimension.name for dimension in output.dims)])})"
