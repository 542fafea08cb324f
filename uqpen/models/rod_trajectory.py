"""The course of one eroding rod by the Walker-Anderson model, from impact to rest.

One run, carefully, by SciPy: independent of the lanes that integrate whole batches, and a check of
them. The unknowns are the nose's velocity u, the excess x = v/u - 1 of the tail's velocity v, the
length L and the depth z; in them the equations stay regular where the nose comes to rest.

References
----------
Soleng, H. H. & Svinsås, E. (2001). Penetration modelling with uncertainty quantification using the
Walker-Anderson model. FFI/RAPPORT-2000/05876. Its equation numbers stand in brackets; its (2.9) is
used with (2 - ε), as (2.4) and (2.8) give it.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from uqpen.core.errors import TrajectoryError
from uqpen.models.rod_course import DEPTHS, Trajectory, rigid_motion

__all__ = [
    "Rod",
    "erosion_slopes",
    "integrate_erosion",
    "make_rod",
    "trajectory",
]

FloatArray = npt.NDArray[np.float64]
Vector = tuple[float, float, float, float]

_MOST_EVALUATIONS = 200_000


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
    solution = integrate_erosion(rod, tolerance, dense_output=True)
    u, x, L, z = solution.y[:, -1]
    if solution.t_events[1].size:
        u = 0.0
    inertia = rod.density_ratio * L + rod.added_length
    rest = z + inertia * math.log1p(u**2 / rod.resistance)
    depth = np.linspace(0.0, rest, depths)
    eroding = depth < z
    during = _erosion_phase(solution, depth[eroding], rod)
    time, velocity = rigid_motion(depth[~eroding], rest, u, inertia, rod.resistance)
    length = np.full_like(time, L)
    # A rod that stops while it erodes keeps its plastic extent; else x is 0.
    extent = np.full_like(time, rod.plastic_scale * x if u == 0 else 0.0)
    after = (solution.t[-1] + time, velocity, velocity, length, extent)
    return Trajectory(depth, *map(np.concatenate, zip(during, after, strict=True)))


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


def erosion_slopes(time: float, state: FloatArray, rod: Rod) -> Vector:
    """Derivatives of u, x, L and z in time, from the linear equations for those of u and x."""
    Omega, profile, kappa, tail_strength, c, added_length, resistance, _, _ = rod
    u, x, L, _ = state.tolist()
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


def integrate_erosion(rod: Rod, tolerance: float, *, dense_output: bool = False) -> Any:
    """Integrate from impact to v = u or u = 0, whichever is first.

    Parameters
    ----------
    rod : Rod
        What is integrated.
    tolerance : float
        Relative error allowed to a step.
    dense_output : bool
        Whether the solution can be asked for at any time.

    Returns
    -------
    scipy.integrate.OdeResult
        u, x, L and z in time; its events are v = u and u = 0.

    Raises
    ------
    TrajectoryError
        If neither event is reached.
    """
    from scipy.integrate import solve_ivp

    scales = np.array([rod.impact_velocity, 1.0, rod.length, rod.length])
    at_impact = np.array([rod.impact_velocity, 0.0, rod.length, 0.0])
    # A rod that does not begin to erode has reached v = u at once.
    erodes = erosion_slopes(0.0, at_impact, rod)[1] > 0
    # In this time the target's resistance alone would stop the rod as it was, however fast.
    inertia = rod.density_ratio * rod.length + rod.added_length
    longest = math.pi * inertia / math.sqrt(rod.resistance)
    calls = itertools.count()

    def slopes(time: float, state: FloatArray, rod: Rod) -> Vector:
        # A plastic zone next to the crater is stiff: S/R = 1.001 takes about this many.
        if next(calls) > _MOST_EVALUATIONS:
            raise TrajectoryError(f"erosion did not end within {_MOST_EVALUATIONS} evaluations")
        return erosion_slopes(time, state, rod)

    # Of numbers that overflow, no course comes, which is told below.
    with np.errstate(all="ignore"):
        solution = solve_ivp(
            slopes,
            (0.0, longest if erodes else 0.0),
            at_impact,
            method="DOP853",
            events=(_tail_lead, _nose_velocity),
            dense_output=dense_output,
            args=(rod,),
            rtol=tolerance,
            atol=tolerance * 1e-2 * scales,
        )
    if erodes and solution.status != 1:
        raise TrajectoryError(f"erosion did not come to an end: {solution.message}")
    return solution


def _tail_lead(time: float, state: FloatArray, rod: Rod) -> float:
    return float(state[1])


def _nose_velocity(time: float, state: FloatArray, rod: Rod) -> float:
    return float(state[0])


for _event in (_tail_lead, _nose_velocity):
    _event.terminal = True  # type: ignore[attr-defined]
    _event.direction = -1  # type: ignore[attr-defined]


def _erosion_phase(solution: Any, depth: FloatArray, rod: Rod) -> tuple[FloatArray, ...]:
    if depth.size == 0:
        return (depth,) * 5
    time = _times_at_depths(depth, solution)
    u, x, L, _ = solution.sol(time)
    return time, u, u * (1 + x), L, rod.plastic_scale * x


def _times_at_depths(depth: FloatArray, solution: Any) -> FloatArray:
    """The times at which depths are reached, by bisection to the last bit."""
    early = np.zeros_like(depth)
    late = np.full_like(depth, solution.t[-1])
    for _ in range(np.finfo(float).nmant):
        middle = (early + late) / 2
        short = solution.sol(middle)[3] < depth
        early, late = np.where(short, middle, early), np.where(short, late, middle)
    return late
