"""Outputs in the value that a user's function returned, which can be anything."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from uqpen.core.arrays import FloatArray, floats
from uqpen.core.model import Output
from uqpen.models.labelled_array import in_declared_order
from uqpen.models.run_grid import RunGrid, UnusableOutputError

__all__ = ["dimension_names", "extract_outputs"]

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
        raise UnusableOutputError(f"returned {type(returned).__name__}, not a mapping of outputs")
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
        raise UnusableOutputError(f'returned no "{name}"')
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
        raise UnusableOutputError(text)


def dimension_names(output: Output, *before: str) -> str:
    """Return the names of the dimensions of a field, in brackets; empty for a number."""
    if not output.dims:
        return ""
    return f" along ({', '.join([*before, *(dimension.name for dimension in output.dims)])})"
