"""Outputs in the value that a user's function returned, which can be anything."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from uqpen.core.arrays import FloatArray, floats
from uqpen.core.model import Output

__all__ = ["UnusableOutputError", "extract_outputs"]


class UnusableOutputError(Exception):
    """Returned value that differs from the declared outputs; the message is a run's reason."""


def extract_outputs(
    returned: object, outputs: Sequence[Output], runs: int | None
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

    Returns
    -------
    dict of str to ndarray, shape (run, *dims) or (*dims,)
        By output, as the function returned it.

    Raises
    ------
    UnusableOutputError
        If an output is missing, is not of numbers, or has another shape than declared.
    """
    if not isinstance(returned, Mapping):
        raise UnusableOutputError(f"returned {type(returned).__name__}, not a mapping of outputs")
    found = {}
    for output in outputs:
        if output.name not in returned:
            raise UnusableOutputError(f'returned no "{output.name}"')
        try:
            values = floats(returned[output.name])
        except ValueError as error:
            raise UnusableOutputError(f'returned a "{output.name}" of {error}') from None
        shape = output.shape if runs is None else (runs, *output.shape)
        if values.shape != shape:
            expected = f"{shape}{_dimension_names(output, runs)}"
            text = f'returned a "{output.name}" of shape {values.shape}, not {expected}'
            raise UnusableOutputError(text)
        found[output.name] = values
    return found


def _dimension_names(output: Output, runs: int | None) -> str:
    """Return the names of the dimensions of a field, in brackets; empty for a number."""
    if not output.dims:
        return ""
    names = ["run"] * (runs is not None) + [dimension.name for dimension in output.dims]
    return f" along ({', '.join(names)})"
