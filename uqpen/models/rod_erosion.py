"""Erosion of one rod by the Walker-Anderson model, followed in plain numbers.

One run, carefully: independent of the lanes that integrate whole batches, and a check of them.
`scipy.integrate` takes ten times as long to load as this integration takes. The unknowns are the
nose's velocity u, the excess x = v/u - 1 of the tail's velocity v, the length L and the depth z; in
them the equations stay regular where the nose comes to rest. The method is DOP853, as in
`dense_integration`.

References
----------
Soleng, H. H. & Svinsås, E. (2001). Penetration modelling with uncertainty quantification using the
Walker-Anderson model. FFI/RAPPORT-2000/05876. Its equation numbers stand in brackets; its (2.9) is
used with (2 - ε), as (2.4) and (2.8) give it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from uqpen.core.errors import TrajectoryError
from uqpen.models import dop853
from uqpen.models.dense_integration import (
    MOST_STEPS,
    SHORTEST_STEP,
    Steps,
    interpolant,
    step_factor,
)

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


def erosion_slopes(state: Vector, rod: Rod) -> Vector:
    """Derivatives of u, x, L and z in time, from the linear equations for those of u and x."""
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
    steps : Steps
        Of one problem, whose variables are u, x, L and z; none where the rod does not erode.
    state : tuple of float
        u, x, L and z at the end: u or x is 0.
    time : float
        The end, s.
    """

    steps: Steps
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
        return Erosion(_as_steps([]), at_impact, 0.0)
    steps = _as_steps(list(_erosion_steps(at_impact, rod, tolerance)))
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


class _Step(NamedTuple):
    """A step that was taken: its beginning, its length, its ends, and the slopes at its stages."""

    start: float
    size: float
    before: Vector
    after: Vector
    stages: list[Vector]


def _erosion_steps(state: Vector, rod: Rod, tolerance: float) -> Iterator[_Step]:
    """Yield the steps from impact to the first past the end of erosion."""
    scales = (rod.impact_velocity, 1.0, rod.length, rod.length)
    slopes = erosion_slopes(state, rod)
    fastest = max(abs(slope) / scale for slope, scale in zip(slopes, scales, strict=True))
    time, size = 0.0, tolerance**0.125 * 0.1 / fastest
    for _ in range(MOST_STEPS):
        stages = [slopes]
        for weights in dop853.STAGES:
            stages.append(erosion_slopes(_moved(state, size, weights, stages), rod))
        after = _moved(state, size, dop853.SOLUTION, stages)
        stages.append(erosion_slopes(after, rod))
        error = size * _error(stages, state, after, scales, tolerance)
        if error < 1:
            for further in dop853.FURTHER:
                stages.append(erosion_slopes(_moved(state, size, further, stages), rod))
            yield _Step(time, size, state, after, stages)
            if after[_U] < 0 or after[_X] < 0:
                return
            time, state, slopes = time + size, after, stages[len(dop853.SOLUTION)]
        size *= step_factor(np.array(error)).item() if error < math.inf else 0.2
        if not size > SHORTEST_STEP * time:
            break
    # A plastic zone next to the crater is stiff: S/R = 1.001 takes about as many steps.
    raise TrajectoryError(f"erosion did not come to an end within {MOST_STEPS} steps")


def _moved(state: Vector, size: float, weights: Sequence[float], stages: list[Vector]) -> Vector:
    """Return a state that has gone on by a weighted sum of slopes."""
    du, dx, dL, dz = _weighted_sum(weights, stages)
    u, x, L, z = state
    return u + size * du, x + size * dx, L + size * dL, z + size * dz


def _weighted_sum(weights: Sequence[float], stages: list[Vector]) -> Vector:
    u = x = L = z = 0.0
    for weight, (du, dx, dL, dz) in zip(weights, stages, strict=False):
        if weight:
            u += weight * du
            x += weight * dx
            L += weight * dL
            z += weight * dz
    return u, x, L, z


def _error(
    stages: list[Vector], before: Vector, after: Vector, scales: Vector, tolerance: float
) -> float:
    """Return the error of a step of unit length, relative to the one allowed."""
    allowed = [
        tolerance * (max(abs(old), abs(new)) + 1e-2 * scale)
        for old, new, scale in zip(before, after, scales, strict=True)
    ]
    fifth, third = (
        math.fsum(
            (error / most) ** 2
            for error, most in zip(_weighted_sum(weights, stages), allowed, strict=True)
        )
        / len(allowed)
        for weights in (dop853.ERROR_5, dop853.ERROR_3)
    )
    return fifth / math.sqrt(fifth + 0.01 * third) if fifth else 0.0


def _as_steps(taken: Sequence[_Step]) -> Steps:
    """Return steps as arrays, with their interpolants."""
    count, size = len(taken), np.array([step.size for step in taken])
    before, after = (np.array([step[end] for step in taken]).reshape(count, 4).T for end in (2, 3))
    every = len(dop853.SOLUTION) + 1 + len(dop853.FURTHER)
    stages = np.array([step.stages for step in taken]).reshape(count, every, 4)
    return Steps(
        problem=np.zeros(count, dtype=np.int64),
        is_last=np.arange(count) == count - 1,
        start=np.array([step.start for step in taken]),
        size=size,
        before=before,
        after=after,
        terms=interpolant(list(stages.transpose(1, 2, 0)), before, after, size),
    )
