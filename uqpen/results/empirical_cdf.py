"""The distribution function of archived runs, read off at any value."""

from __future__ import annotations

import numpy as np

from uqpen.core.arrays import FloatArray

__all__ = ["empirical_cdf"]


def empirical_cdf(outputs: FloatArray, band: FloatArray, values: FloatArray) -> FloatArray:
    """Read off the distribution function of runs, with the simultaneous band of their archive.

    An archive has the function at some ranks alone. Between them, the runs decide.

    Parameters
    ----------
    outputs : ndarray, shape (run,)
        Of the completed runs.
    band : ndarray, shape (rank, bound)
        The archive's function with its simultaneous band, the same width at all ranks; NaN for no
        band.
    values : ndarray, shape (value,)
        In the unit of the outputs.

    Returns
    -------
    ndarray, shape (value, bound)
    """
    share = np.searchsorted(np.sort(outputs), values, side="right") / outputs.size
    # Nearest to 1 no probability cuts the lower side off.
    half = float(band[-1, 0] - band[-1, 1])
    return np.stack([share, np.maximum(share - half, 0.0), np.minimum(share + half, 1.0)], axis=-1)
