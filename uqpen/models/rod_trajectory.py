"""The course of one eroding rod by the Walker-Anderson model, from impact to rest."""

from __future__ import annotations

import math

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.models.dense_integration import Steps
from uqpen.models.rod_course import DEPTHS, Trajectory, rigid_motion
from uqpen.models.rod_erosion import Rod, integrate_erosion

__all__ = ["trajectory"]

# The row of the depth in the states.
_Z = 3


def trajectory(rod: Rod, *, depths: int = DEPTHS, tolerance: float = 1e-10) -> Trajectory:
    """Follow one run from impact to rest.

    Parameters
    ----------
    rod : Rod
        What `make_rod` returns.
    depths : int
        How many depths to give the course at.
    tolerance : float
        Relative error allowed to a step of the integration.

    Returns
    -------
    Trajectory

    Raises
    ------
    TrajectoryError
        If the integration does not reach the end of erosion.
    """
    erosion = integrate_erosion(rod, tolerance)
    u, x, L, z = erosion.state
    inertia = rod.density_ratio * L + rod.added_length
    rest = z + inertia * math.log1p(u**2 / rod.resistance)
    depth = np.linspace(0.0, rest, depths)
    eroding = depth < z
    during = _erosion_phase(erosion.steps, depth[eroding], rod)
    time, velocity = rigid_motion(depth[~eroding], rest, u, inertia, rod.resistance)
    length = np.full_like(time, L)
    # A rod that stops while it erodes keeps its plastic extent; else x is 0.
    extent = np.full_like(time, rod.plastic_scale * x if u == 0 else 0.0)
    after = (erosion.time + time, velocity, velocity, length, extent)
    return Trajectory(depth, *map(np.concatenate, zip(during, after, strict=True)))


def _erosion_phase(steps: Steps | None, depth: FloatArray, rod: Rod) -> tuple[FloatArray, ...]:
    if steps is None:
        return (depth,) * 5
    step = np.searchsorted(steps.before[_Z], depth, side="right") - 1
    part = steps.parts_at(step, _Z, depth)
    u, x, L, _ = steps.states(step, part)
    return steps.start[step] + part * steps.size[step], u, u * (1 + x), L, rod.plastic_scale * x
