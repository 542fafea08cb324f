"""The course of a rod in its target, from impact to rest, and the part of it that is rigid."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["DEPTHS", "Trajectory", "rigid_motion", "trajectory_dataset"]

FloatArray = npt.NDArray[np.float64]

# How many depths a course is given at.
DEPTHS = 401

# What the course of a run stands against: not "depth", which CF keeps for water.
_DEPTH = "penetration_depth"

# What the course of a run is made of: variable, unit, what a person reads.
_VARIABLES = (
    ("time", "s", "time since impact"),
    ("nose_velocity", "m s-1", "velocity of the projectile's nose, u"),
    ("tail_velocity", "m s-1", "velocity of the projectile's tail, v"),
    ("length", "m", "length of the projectile, L"),
    ("plastic_extent", "m", "extent of plastic flow in the projectile, s"),
)


class Trajectory(NamedTuple):
    """The course of a run; arrays of shape (depth,).

    Attributes
    ----------
    depth : ndarray
        z of the nose, m, evenly from 0 to where it comes to rest.
    time : ndarray
        Since impact, s.
    nose_velocity, tail_velocity : ndarray
        u, v, m s-1.
    length : ndarray
        L of the rod, m.
    plastic_extent : ndarray
        s of plastic flow in the rod, m.
    """

    depth: FloatArray
    time: FloatArray
    nose_velocity: FloatArray
    tail_velocity: FloatArray
    length: FloatArray
    plastic_extent: FloatArray


def trajectory_dataset(course: Trajectory) -> xr.Dataset:
    """A course as an archive keeps it, along ``penetration_depth``."""
    import xarray as xr

    described = {"units": "m", "long_name": "depth of the projectile's nose, z"}
    return xr.Dataset(
        {
            name: (_DEPTH, getattr(course, name), {"units": unit, "long_name": long_name})
            for name, unit, long_name in _VARIABLES
        },
        {_DEPTH: (_DEPTH, course.depth, described)},
    )


def rigid_motion(
    depth: FloatArray, rest: float, u0: float, inertia: float, resistance: float
) -> tuple[FloatArray, FloatArray]:
    """Return the motion of a rigid rod that comes to rest.

    Parameters
    ----------
    depth : ndarray, shape (depth,)
        m.
    rest : float
        The depth at which it stops, m.
    u0 : float
        Its velocity where it begins to be rigid, m s-1.
    inertia : float
        K: its length times the ratio of densities, and the length of target moved along, m.
    resistance : float
        B: of the target, over its density, m2 s-2.

    Returns
    -------
    time, velocity : ndarray, shape (depth,)
        Since it is rigid, s; m s-1.

    Notes
    -----
    With u = v, (2.16) is 2 K du/dt = -(u² + B), K the inertia and B the resistance.
    """
    u = np.sqrt(resistance * special.expm1((rest - depth) / inertia))
    root = math.sqrt(resistance)
    time = 2 * inertia / root * (math.atan(u0 / root) - np.arctan(u / root))
    return time, u
