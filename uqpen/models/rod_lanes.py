"""Eroding rods integrated side by side in lanes, on all processors.

The integration itself is compiled (`rod_kernel`). Lanes share nothing, so a run's result has the
same bits whatever else is in its batch and wherever in it the run stands.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from ctypes import c_double, c_int64, c_void_p
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.core.processors import map_parts
from uqpen.models.machine_code import load_or_compile
from uqpen.models.rod_phases import AT_REST, BUFFER, CAUGHT_UP, GAVE_UP, LANES
from uqpen.models.source import source_sha256

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

    def erode_part(part: slice) -> FloatArray:
        some = np.ascontiguousarray(rods[:, part])
        ends = np.empty((6, some.shape[1]))
        memory = np.zeros(BUFFER), np.empty(LANES, np.int64)
        if ends.size:
            kernel(
                some.ctypes.data,
                some.shape[1],
                tolerance,
                tolerance**0.2,
                ends.ctypes.data,
                *(each.ctypes.data for each in memory),
            )
        return ends

    kernel = _kernel()
    return np.concatenate(map_parts(erode_part, rods.shape[1], _WORTH_A_THREAD), axis=1)


@functools.cache
def _kernel() -> Callable[..., None]:
    """Return `rod_kernel.erode`, as a function of addresses and numbers."""
    types = (c_void_p, c_int64, c_double, c_double, c_void_p, c_void_p, c_void_p)
    return load_or_compile(source_sha256("uqpen.models.rod_kernel"), _compile, types)


def _compile(cache: bool) -> Any:
    from uqpen.models.compiled import entry_point
    from uqpen.models.rod_kernel import SIGNATURE
    from uqpen.models.rod_kernel import erode as function

    return entry_point(function, SIGNATURE, cache=cache)
