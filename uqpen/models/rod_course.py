"""The course of one rod in its target by the Walker-Anderson model, from impact to rest.

One run, carefully: independent of the lanes that integrate whole batches, and a check of them.
Numbers in brackets are those of equations, as in `uqpen.models.rod_motion`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy import special

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import TrajectoryError
from uqpen.models.dense_integration import MOST_STEPS, Steps, integrate
from uqpen.models.rod_motion import (
    DEFAULT,
    Rods,
    Transition,
    final_states,
    is_over,
    rigid_velocity,
)

if TYPE_CHECKING:
    import xarray as xr

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
    """The course of a run; arrays of shape (depth,)."""

    depth: FloatArray  # z of the nose, m, evenly from 0 to where it comes to rest
    time: FloatArray  # since impact, s
    nose_velocity: FloatArray  # u, m s-1
    tail_velocity: FloatArray  # v, m s-1
    length: FloatArray  # L of the rod, m
    plastic_extent: FloatArray  # s of plastic flow in the rod, m


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


def make_rod(inputs: Mapping[str, Any]) -> Rods:
    """Return the constants of the equations of one rod; see `uqpen.models.rod_motion.make_rods`.

    The inputs are numbers in SI units, a sound speed among them.
    """
    S, R = inputs["plasticity_radius"], inputs["crater_radius"]
    density, target = inputs["projectile_density"], inputs["target_density"]
    c = inputs["projectile_sound_speed"]
    return Rods(
        density_ratio=density / target,
        profile=2 + inputs["smoothing"],
        plastic_scale=R * (1 - R**2 / S**2) / (2 - inputs["smoothing"]),  # (2.9)
        tail_strength=inputs["projectile_yield_limit"] / (density * c),
        sound_speed=c,
        added_length=R * (S - R) / (S + R),  # (2.16)
        resistance=14 / 3 * inputs["target_yield_limit"] / target * math.log(S / R),  # (2.16)
        length=inputs["projectile_length"],
        impact_velocity=inputs["impact_velocity"],
    )


def erosion_slopes(state: FloatArray, rod: FloatArray) -> FloatArray:
    """Return the slopes in time of u, x, L and z, from the linear equations for those of u and x.

    The values of a state, and those of a rod, are numbers or arrays.
    """
    Omega, profile, kappa, tail_strength, c, added_length, resistance, _, _ = rod
    u, x, L, _ = state
    s = kappa * x  # (2.9)
    excess = u * x  # v - u
    g = tail_strength / (L - s)
    share = 2 * Omega / profile
    u_in_nose = share * s + 2 * added_length + share * (profile * L - s) * (1 + x)  # (2.16)
    x_in_nose = share * u * (profile * L - s - kappa * x)  # (2.16)
    nose = Omega * excess * excess - u * u - resistance  # (2.16)
    u_in_tail = 1 + x  # (2.17)
    x_in_tail = g * kappa + u  # (2.17)
    tail = -g * (c + excess)  # (2.17)
    determinant = u_in_nose * x_in_tail - x_in_nose * u_in_tail
    du = (nose * x_in_tail - x_in_nose * tail) / determinant
    dx = (u_in_nose * tail - u_in_tail * nose) / determinant
    return np.stack([du, dx, -excess, u])  # (2.18)


def trajectory(
    rod: Rods, *, depths: int = DEPTHS, tolerance: float = 1e-10, transition: Transition = DEFAULT
) -> Trajectory:
    """Follow one run from impact to rest; TrajectoryError if erosion does not end."""
    steps, (u, x, L, z), end = integrate_erosion(rod, tolerance, transition)
    inertia, resistance = float(rod.density_ratio * L + rod.added_length), float(rod.resistance)
    V = float(rigid_velocity(np.array([u, x, L]), np.array(rod)))
    rest = z + inertia * math.log1p(V**2 / resistance)
    depth = np.linspace(0.0, rest, depths)
    is_rigid = depth >= z
    during = _course_of_erosion(steps, depth[~is_rigid], rod)
    time, velocity = rigid_motion(depth[is_rigid], rest, V, inertia, resistance)
    length = np.full_like(time, L)
    # A rod that stops while it erodes keeps its plastic extent.
    extent = np.full_like(time, rod.plastic_scale * x if u == 0 else 0.0)
    after = (end + time, velocity, velocity, length, extent)
    return Trajectory(depth, *map(np.concatenate, zip(during, after, strict=True)))


def _course_of_erosion(steps: Steps | None, depth: FloatArray, rod: Rods) -> tuple[FloatArray, ...]:
    if steps is None:
        return (depth,) * 5
    z = 3  # the row of the depth in the states
    step = np.searchsorted(steps.before[z], depth, side="right") - 1
    part = steps.parts_at(step, z, depth)
    u, x, L, _ = steps.states(step, part)
    return steps.start[step] + part * steps.size[step], u, u * (1 + x), L, rod.plastic_scale * x


def integrate_erosion(
    rod: Rods, tolerance: float, transition: Transition = DEFAULT
) -> tuple[Steps | None, tuple[float, float, float, float], float]:
    """Integrate from impact to the end of erosion, whichever is first; TrajectoryError if none is.

    Returns
    -------
    steps : Steps or None
        Of one problem, whose variables are u, x, L and z; None where the rod does not erode.
    state : tuple of float
        u, x, L and z at the end: u or x is 0, or the rod is rigid by the transition.
    time : float
        The end, s.
    """
    v0, L0 = float(rod.impact_velocity), float(rod.length)
    at_impact, constants = np.array([[v0, 0.0, L0, 0.0]]).T, np.array([rod]).T
    # A rod that does not begin to erode has reached v = u at once.
    falls_back = erosion_slopes(at_impact, constants)[1] > 0
    if not (falls_back and transition.margin(at_impact, constants) > 0):
        return None, (v0, 0.0, L0, 0.0), 0.0
    scales = np.array([[v0, 1.0, L0, L0]]).T
    is_past = partial(is_over, transition=transition)
    taken = list(integrate(erosion_slopes, at_impact, constants, scales, is_past, tolerance))
    # A plastic zone next to the crater is stiff: S/R = 1.001 takes about as many steps.
    if not taken or not taken[-1].is_last[0]:
        raise TrajectoryError(f"erosion did not come to an end within {MOST_STEPS} steps")
    steps = Steps._make(np.concatenate(each, axis=-1) for each in zip(*taken, strict=True))
    ends, part = final_states(steps, constants, transition)
    u, x, L, z = ends[:, -1].tolist()
    return steps, (u, x, L, z), float(steps.start[-1] + part[0] * steps.size[-1])


def rigid_motion(
    depth: FloatArray, rest: float, u0: float, inertia: float, resistance: float
) -> tuple[FloatArray, FloatArray]:
    """Return the time, s, and the velocity of a rigid rod at depths, m, until it comes to rest.

    With u = v, (2.16) is 2 K du/dt = -(u² + B): the inertia K, m, is the length times the ratio of
    densities, and the length of target moved along; the resistance B, m2 s-2, is that of the
    target, over its density. The time is since it is rigid, with the velocity u0.
    """
    u = np.sqrt(resistance * special.expm1((rest - depth) / inertia))
    root = math.sqrt(resistance)
    time = 2 * inertia / root * (math.atan(u0 / root) - np.arctan(u / root))
    return time, u
