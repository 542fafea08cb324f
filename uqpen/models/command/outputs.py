"""Outputs of a program's run: single numbers, and fields along their dimensions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Output
from uqpen.models.command.output_reader import OutputReader
from uqpen.models.command.written import RunFiles, UnreadableError
from uqpen.models.function_outputs import dimension_names
from uqpen.models.run_grid import RunGrid

__all__ = ["read_outputs"]


def read_outputs(
    outputs: Sequence[Output],
    readings: Mapping[str, OutputReader],
    grids: Mapping[str, RunGrid],
    written: RunFiles,
) -> dict[str, FloatArray]:
    """Read the outputs of a run.

    Parameters
    ----------
    outputs : sequence of Output
        The outputs.
    readings : mapping of str to OutputReader
        The reader of each output, and of the coordinates that a run has of its own.
    grids : mapping of str to RunGrid
        By output, the grid on which a run writes it.
    written : RunFiles
        What the run has written.

    Returns
    -------
    dict of str to ndarray, shape (*dims)
        In the units of the program.

    Raises
    ------
    UnreadableError, UnusableOutputError
        If an output is not there, or is not what is declared; the message names the place.
    """
    found = {}
    for output in outputs:
        reader, grid = readings[output.name], grids.get(output.name)
        if not output.dims:
            found[output.name] = np.array(reader.value(written))
        elif grid is None:
            found[output.name] = _read_field(output, reader, written)
        else:
            own = {name: readings[key].values(written) for name, key in grid.names.items()}
            sizes = [len(np.atleast_1d(own.get(dim.name, dim.values))) for dim in output.dims]
            values = _arranged(output, reader, reader.values(written), tuple(sizes))
            found[output.name] = grid.interpolate(output, values, own)
    return found


def _read_field(output: Output, reader: OutputReader, written: RunFiles) -> FloatArray:
    """Read a field at its declared coordinates."""
    try:
        values = reader.values(written)
    except UnreadableError as error:
        if error.position is None or error.position >= math.prod(output.shape):
            raise
        place = np.unravel_index(error.position, output.shape)
        coordinates = output.place_text([int(each) for each in place])
        raise UnreadableError(f"{error} ({coordinates})") from None
    if output.may_end and values.ndim == 1 and 0 < len(values) < output.shape[0]:
        rest = np.full(output.shape[0] - len(values), np.nan)
        values = np.append(values, rest)
    return _arranged(output, reader, values, output.shape)


def _arranged(
    output: Output, reader: OutputReader, values: FloatArray, shape: tuple[int, ...]
) -> FloatArray:
    """Return values in their shape; in a list, those along the last dimension follow each other."""
    if values.shape != shape and (values.ndim != 1 or values.size != math.prod(shape)):
        if values.ndim == len(shape) == 1:
            found = f"{reader.place} has {len(values)} numbers, not {shape[0]}"
        else:
            found = f"{reader.place} is of shape {values.shape}, not {shape}"
        raise UnreadableError(found + dimension_names(output))
    return values.reshape(shape)
