"""Values of an output that are no results: which runs have them, and where."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Output


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
    by_run = output.invalid(values).reshape(len(values), -1)
    for run in np.flatnonzero(by_run.any(axis=1)).tolist():
        yield run, output.invalid_text(values[run])
