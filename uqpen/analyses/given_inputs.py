"""What measures of sensitivity say of the inputs that they are of."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.analyses.sample import Sample
from uqpen.labels import INPUT

__all__ = ["INCLUDES_CORRELATION", "input_coordinate", "mean_ranks"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Of inputs that depend on each other, what one explains is partly what another does.
INCLUDES_CORRELATION = "includes correlation"


def input_coordinate(sample: Sample) -> dict[str, Any]:
    """The coordinate along ``input``: the names of the random inputs."""
    names = np.array(sample.inputs, dtype=object)
    return {INPUT: (INPUT, names, {"long_name": "random input"})}


def mean_ranks(level: IntArray) -> FloatArray:
    """Ranks from 1; equal values share the mean of theirs.

    Parameters
    ----------
    level : ndarray of int, shape (run,)
        Which of the values, ascending, each run has.
    """
    count = np.bincount(level)
    ranks: FloatArray = (np.cumsum(count) - (count - 1) / 2)[level]
    return ranks
