"""The distribution function of archived runs, read off at any value."""

from __future__ import annotations

import numpy as np

from uqpen.core.arrays import FloatArray

__all__ = ["empirical_cdf"]


def empirical_cdf(outputs: FloatArray, values: FloatArray) -> FloatArray:
    """Return the share of runs at or below each value.

    An archive has this function at some ranks alone. Between them, the runs decide.

    Parameters
    ----------
    outputs : ndarray, shape (run,)
        Of the completed runs.
    values : ndarray, shape (value,)
        In the unit of the outputs.

    Returns
    -------
    ndarray, shape (value,)
    """
    return np.searchsorted(np.sort(outputs), values, side="right") / outputs.size
