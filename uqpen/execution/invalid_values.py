"""Values of an output that are no results: which runs have them, and where."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Output
from uqpen.core.units import DIMENSIONLESS, scale

__all__ = ["invalid_runs"]


def invalid_runs(output: Output, values: FloatArray) -> Iterator[tuple[int, str]]:
    """Yield the runs with an invalid value of an output, each with the reason.

    Parameters
    ----------
    output : Output
        The output.
    values : ndarray, shape (run, *dims)
        Its values in SI units.

    Yields
    ------
    run : int
        Position of the run.
    reason : str
        Its first invalid value, with the coordinates of that value in a field.
    """
    invalid = output.invalid(values)
    by_run = invalid.reshape(len(values), -1)
    for run in np.flatnonzero(by_run.any(axis=1)).tolist():
        place = np.unravel_index(int(by_run[run].argmax()), output.shape)
        reason = f"{output.name} is {values[(run, *place)]}"
        yield run, f"{reason} at {_coordinates(output, place)}" if output.dims else reason


def _coordinates(output: Output, place: tuple[np.intp, ...]) -> str:
    """Return the coordinates of a value of a field, in the units for display."""
    texts = []
    for dimension, position in zip(output.dims, place, strict=True):
        unit = dimension.preferred_unit
        shown = f"{scale(unit).from_si(dimension.values[position]):.10g}"
        suffix = "" if unit == DIMENSIONLESS else f" {unit}"
        texts.append(f"{dimension.name} = {shown}{suffix}")
    return ", ".join(texts)
