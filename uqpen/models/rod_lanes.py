"""Eroding rods integrated side by side in lanes, on all processors.

The integration itself is compiled (`rod_kernel`). Lanes share nothing, so a run's result has the
same bits whatever else is in its batch and wherever in it the run stands.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from uqpen.core.processors import map_parts
from uqpen.models.rod_phases import AT_REST, CAUGHT_UP, GAVE_UP

__all__ = ["AT_REST", "CAUGHT_UP", "GAVE_UP", "count_evaluations", "erode"]

FloatArray = npt.NDArray[np.float64]

_WORTH_A_THREAD = 512  # runs, which take a millisecond


def erode(rods: FloatArray, tolerance: float) -> FloatArray:
    """Integrate rods from impact to the end of erosion, on all processors of this process.

    Parameters
    ----------
    rods : ndarray, shape (8, run)
        Ω, 2Ω/(2 + ε), κ, γ, γc, γκ, 2R(S - R)/(S + R) and (14/3) Tt² ln(S/R) of each run, where
        s = κx and γ = Yp/(ρp c); lengths in units of the rod's, velocities in the impact's.
    tolerance : float
        Relative error allowed to a step.

    Returns
    -------
    ndarray, shape (5, run)
        u, x, L and z at the end of erosion, and `CAUGHT_UP`, `AT_REST` or `GAVE_UP`.
    """
    return _erode_in_threads(rods, tolerance)[:5]


def count_evaluations(rods: FloatArray, tolerance: float) -> FloatArray:
    """Count the evaluations of the slopes in each run; the parameters are those of `erode`."""
    return 1 + 6 * _erode_in_threads(rods, tolerance)[5] + 7  # the start, steps, the event


def _erode_in_threads(rods: FloatArray, tolerance: float) -> FloatArray:
    """Integrate rods; rows as `erode` returns them, and the number of steps."""
    # It loads Numba, so only where a rod really erodes.
    from uqpen.models.rod_kernel import erode as erode_compiled

    def erode_part(part: slice) -> FloatArray:
        some = np.array(rods[:, part], order="C")
        return erode_compiled(some, tolerance) if some.size else np.empty((6, 0))

    return np.concatenate(map_parts(erode_part, rods.shape[1], _WORTH_A_THREAD), axis=1)
