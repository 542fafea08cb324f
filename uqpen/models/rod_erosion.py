"""Erosion of one rod by the Walker-Anderson model.

One run, carefully: independent of the lanes that integrate whole batches, and a check of them. The
unknowns are the nose's velocity u, the excess x = v/u - 1 of the tail's velocity v, the length L
and the depth z; in them the equations stay regular where the nose comes to rest.

References
----------
Soleng, H. H. & Svinsås, E. (2001). Penetration modelling with uncertainty quantification using the
Walker-Anderson model. FFI/RAPPORT-2000/05876. Its equation numbers stand in brackets; its (2.9) is
used with (2 - ε), as (2.4) and (2.8) give it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.errors import TrajectoryError
from uqpen.models.dense_integration import MOST_STEPS, Steps, integrate

__all__ = ["Erosion", "Rod", "erosion_slopes", "integrate_erosion", "make_rod"]

Vector = tuple[float, float, float, float]

# Rows of the states that are 0 where erosion ends.
_U, _X = 0, 1


class Rod(NamedTuple):
    """A rod and its target, as the equations take them; see `make_rod`."""

    density_ratio: float  # Ω
    profile: float  # 2 + ε
    plastic_scale: float  # s/x, m
    tail_strength: float  # Tp²/c, m s-1
    sound_speed: float  # c, m s-1
    added_length: float  # R(S - R)/(S + R), m
    resistance: float  # (14/3) Tt² ln(S/R), m² s-2
    length: float  # L0, m
    impact_velocity: float  # v0, m s-1


def make_rod(
    *,
    projectile_density: float,
    projectile_yield_limit: float,
    projectile_length: float,
    impact_velocity: float,
    projectile_sound_speed: float,
    target_density: float,
    target_yield_limit: float,
    plasticity_radius: float,
    crater_radius: float,
    smoothing: float,
) -> Rod:
    """The constants of the equations.

    Parameters
    ----------
    projectile_density, target_density : float
        ρp, ρt, kg m-3.
    projectile_yield_limit, target_yield_limit : float
        Yp, Yt, Pa.
    projectile_length : float
        L0, m.
    impact_velocity, projectile_sound_speed : float
        v0, c, m s-1.
    plasticity_radius, crater_radius : float
        S, R, m, with S > R.
    smoothing : float
        ε of the velocity profile in the rod, 0 ≤ ε < 2; 0 is the original model.
    """
    S, R = plasticity_radius, crater_radius
    return Rod(
        density_ratio=projectile_density / target_density,
        profile=2 + smoothing,
        plastic_scale=R * (1 - R**2 / S**2) / (2 - smoothing),  # (2.9)
        tail_strength=projectile_yield_limit / (projectile_density * projectile_sound_speed),
        sound_speed=projectile_sound_speed,
        added_length=R * (S - R) / (S + R),  # (2.16)
        resistance=14 / 3 * target_yield_limit / target_density * math.log(S / R),  # (2.16)
        length=projectile_length,
        impact_velocity=impact_velocity,
    )


def erosion_slopes(state: Any, rod: Rod) -> tuple[Any, Any, Any, Any]:
    """Derivatives of u, x, L and z in time, from the linear equations for those of u and x.

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
    return (
        (nose * x_in_tail - x_in_nose * tail) / determinant,
        (u_in_nose * tail - u_in_tail * nose) / determinant,
        -excess,  # (2.18)
        u,  # (2.18)
    )


class Erosion(NamedTuple):
    """The part of a run from impact to v = u or u = 0, whichever is first.

    Attributes
    ----------
    steps : Steps or None
        Of one problem, whose variables are u, x, L and z; None where the rod does not erode.
    state : tuple of float
        u, x, L and z at the end: u or x is 0.
    time : float
        The end, s.
    """

    steps: Steps | None
    state: Vector
    time: float


def integrate_erosion(rod: Rod, tolerance: float) -> Erosion:
    """Integrate from impact to v = u or u = 0, whichever is first.

    Parameters
    ----------
    rod : Rod
        What is integrated.
    tolerance : float
        Relative error allowed to a step, and to a hundredth of a variable's scale.

    Raises
    ------
    TrajectoryError
        If neither is reached.
    """
    at_impact = (rod.impact_velocity, 0.0, rod.length, 0.0)
    # A rod that does not begin to erode has reached v = u at once.
    if not erosion_slopes(at_impact, rod)[_X] > 0:
        return Erosion(None, at_impact, 0.0)
    steps = _erosion_steps(at_impact, rod, tolerance)
    last = np.array([steps.start.size - 1])
    ends = {
        float(steps.parts_at(last, row, np.zeros(1))[0]): row
        for row in (_U, _X)
        if steps.after[row, -1] < 0
    }
    # Of two events the first is the one that ends erosion.
    part = min(ends)
    state = steps.states(last, np.array([part]))[:, 0]
    state[ends[part]] = 0.0
    u, x, L, z = state.tolist()
    return Erosion(steps, (u, x, L, z), float(steps.start[-1] + part * steps.size[-1]))


def _erosion_steps(at_impact: Vector, rod: Rod, tolerance: float) -> Steps:
    """Return the steps from impact to the first past the end of erosion."""
    start, constants = np.array([at_impact]).T, np.array([rod]).T
    scales = np.array([[rod.impact_velocity, 1.0, rod.length, rod.length]]).T
    taken = list(integrate(_slopes, start, constants, scales, _is_over, tolerance))
    # A plastic zone next to the crater is stiff: S/R = 1.001 takes about as many steps.
    if not taken or not taken[-1].is_last[0]:
        raise TrajectoryError(f"erosion did not come to an end within {MOST_STEPS} steps")
    return Steps._make(np.concatenate(each, axis=-1) for each in zip(*taken, strict=True))


def _slopes(states: FloatArray, constants: FloatArray) -> FloatArray:
    return np.stack(erosion_slopes(states, Rod(*constants)))


def _is_over(states: FloatArray) -> BoolArray:
    ended: BoolArray = (states[_U] < 0) | (states[_X] < 0)
    return ended
