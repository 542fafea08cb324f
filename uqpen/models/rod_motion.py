"""Motion of rods in their targets: while they erode, and as rigid bodies afterwards.

While a rod erodes, the unknowns are the nose's velocity u, the excess x = v/u - 1 of the tail's
velocity v, the length L and the depth z; in them the equations stay regular where the nose comes
to rest. Afterwards the rod is rigid, and its motion has a closed form.

References
----------
Soleng, H. H. & Svinsås, E. (2001). FFI/RAPPORT-2000/05876. Its equation numbers stand in brackets;
its (2.9) is used with (2 - ε), as (2.4) and (2.8) give it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from scipy import special

from uqpen.core.arrays import Arrays, BoolArray, FloatArray, IntArray
from uqpen.models.dense_integration import Steps, integrate
from uqpen.models.rod_and_target import sound_speed


class Rods(NamedTuple):
    """Rods and their targets, as the equations take them: arrays of shape (run,), or numbers."""

    density_ratio: FloatArray  # Ω
    profile: FloatArray  # 2 + ε
    plastic_scale: FloatArray  # s/x, m
    tail_strength: FloatArray  # Tp²/c, m s-1
    sound_speed: FloatArray  # c, m s-1
    added_length: FloatArray  # R(S - R)/(S + R), m
    resistance: FloatArray  # (14/3) Tt² ln(S/R), m² s-2
    length: FloatArray  # L0, m
    impact_velocity: FloatArray  # v0, m s-1


def make_rods(inputs: Arrays) -> Rods:
    """Return the constants of the equations from the inputs of a rod's models, in SI units."""
    S, R = inputs["plasticity_radius"], inputs["crater_radius"]
    density, target = inputs["projectile_density"], inputs["target_density"]
    c = sound_speed(inputs)
    return Rods(
        density_ratio=density / target,
        profile=2 + inputs["smoothing"],
        plastic_scale=R * (S - R) * (S + R) / S**2 / (2 - inputs["smoothing"]),  # (2.9)
        tail_strength=inputs["projectile_yield_limit"] / (density * c),
        sound_speed=c,
        added_length=R * (S - R) / (S + R),  # (2.16)
        resistance=14 / 3 * inputs["target_yield_limit"] / target * special.log1p((S - R) / R),
        length=inputs["projectile_length"],
        impact_velocity=inputs["impact_velocity"],
    )


def at_impact(rods: Rods) -> FloatArray:
    """Return u, x, L, z and the time at impact, shape (5, run)."""
    zero = np.zeros_like(rods.length)
    return np.stack([rods.impact_velocity, zero, rods.length, zero, zero])


def erosion_slopes(state: FloatArray, constants: FloatArray) -> FloatArray:
    """Return the slopes in time of u, x, L, z and the time itself, shape (5, run).

    Those of u and x follow from two linear equations, (2.16) and (2.17).
    """
    Omega, profile, kappa, tail_strength, c, added_length, resistance, _, _ = constants
    u, x, L, _, _ = state
    s = kappa * x  # (2.9)
    excess = u * x  # v - u
    g = tail_strength / (L - s)
    share = 2 * Omega / profile
    u_in_nose = share * s + 2 * added_length + share * (profile * L - s) * (1 + x)  # (2.16)
    x_in_nose = share * u * (profile * L - s - kappa * x)  # (2.16)
    nose = Omega * excess**2 - u**2 - resistance  # (2.16)
    u_in_tail = 1 + x  # (2.17)
    x_in_tail = g * kappa + u  # (2.17)
    tail = -g * (c + excess)  # (2.17)
    determinant = u_in_nose * x_in_tail - x_in_nose * u_in_tail
    return np.stack(
        [
            (nose * x_in_tail - x_in_nose * tail) / determinant,
            (u_in_nose * tail - u_in_tail * nose) / determinant,
            -excess,  # (2.18)
            u,  # (2.18)
            np.ones_like(u),
        ]
    )


class RigidMotion(NamedTuple):
    """Motion of rods that do not erode: 2 K du/dt = -(u² + B), (2.16) with u = v."""

    inertia: FloatArray  # with resistance: (run,): k, m, and B, m2 s-2
    resistance: FloatArray
    velocity: FloatArray  # with depth, time: (run,): where it begins, m s-1, m, s
    depth: FloatArray
    time: FloatArray

    @classmethod
    def after(cls, rods: Rods, state: FloatArray) -> RigidMotion:
        """Return the motion of rods after a state of u, x, L, z and the time, shape (5, run)."""
        u, _, L, z, t = state
        return cls(rods.density_ratio * L + rods.added_length, rods.resistance, u, z, t)

    def select(self, run: IntArray) -> RigidMotion:
        """Return the motion of some runs; one may be there several times."""
        return RigidMotion(*(each[run] for each in self))

    @property
    def rest_depth(self) -> FloatArray:
        """Depth at which each rod comes to rest, m."""
        further: FloatArray = self.inertia * special.log1p(self.velocity**2 / self.resistance)
        return self.depth + further

    @property
    def rest_time(self) -> FloatArray:
        """Time at which each rod comes to rest, s."""
        root = np.sqrt(self.resistance)
        return self.time + 2 * self.inertia / root * np.arctan(self.velocity / root)

    def at_depths(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the velocity of each run, m s-1, and the time, s, at a depth of its own, m."""
        gone, left = z - self.depth, self.rest_depth - z
        # Exact at the nearer end of the motion.
        square = np.where(
            gone < left,
            self.velocity**2
            + (self.velocity**2 + self.resistance) * special.expm1(-gone / self.inertia),
            self.resistance * special.expm1(left / self.inertia),
        )
        u = np.sqrt(np.maximum(square, 0.0))
        root = np.sqrt(self.resistance)
        angle = np.arctan(self.velocity / root) - np.arctan(u / root)
        return u, self.time + 2 * self.inertia / root * angle

    def at_times(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the velocity of each run, m s-1, and the depth, m, at a time of its own, s."""
        root = np.sqrt(self.resistance)
        tangent = np.tan((t - self.time) * root / (2 * self.inertia))
        slower = (self.velocity - root * tangent) / (1 + self.velocity / root * tangent)
        u = np.maximum(slower, 0.0)
        lost = (self.velocity**2 - u**2) / (u**2 + self.resistance)
        return u, self.depth + self.inertia * special.log1p(lost)


class Along(IntEnum):
    """Coordinate of curves: its position in the states of an eroding rod, (u, x, L, z, time)."""

    DEPTH = 3
    TIME = 4


@dataclass(frozen=True)
class Curves:
    """Curves of some rods at given coordinates, NaN behind the end of their motion."""

    along: Along  # the coordinate
    coordinates: FloatArray  # (place,): in ascending order, m or s
    # (6, run, place): u and v, m s-1, L and s, m, the depth of the nose, m, and the time, s.
    values: FloatArray

    @classmethod
    def make_empty(cls, along: Along, coordinates: FloatArray, runs: int) -> Curves:
        """Return curves without values."""
        return cls(along, coordinates, np.full((6, runs, coordinates.size), np.nan))

    def add_erosion(self, steps: Steps, ends: FloatArray, rods: Rods) -> None:
        """Fill in what lies inside steps of eroding rods, up to their ends, shape (5, step)."""
        row = self.along
        step, place = _places(self.coordinates, steps.before[row], ends[row])
        coordinates = self.coordinates[place]
        part = steps.parts_at(step, row, coordinates)
        u, x, L, z, t = steps.states(step, part)
        run = steps.problem[step]
        self.values[:, run, place] = u, u * (1 + x), L, rods.plastic_scale[run] * x, z, t

    def add_rigid_motion(self, motion: RigidMotion, rods: Rods, start: FloatArray) -> None:
        """Fill in what follows the end of erosion, the state of shape (5, run), until rest."""
        rest = motion.rest_depth if self.along is Along.DEPTH else motion.rest_time
        behind = np.nextafter(rest, np.inf)
        run, place = _places(self.coordinates, start[self.along], behind)
        coordinates, moving = self.coordinates[place], motion.select(run)
        if self.along is Along.DEPTH:
            z, (u, t) = coordinates, moving.at_depths(coordinates)
        else:
            t, (u, z) = coordinates, moving.at_times(coordinates)
        # A rod that stops while it erodes keeps its plastic extent; else x is 0.
        _, x, L, _, _ = start[:, run]
        self.values[:, run, place] = u, u, L, rods.plastic_scale[run] * x, z, t


def follow_erosion(rods: Rods, curves: Sequence[Curves], tolerance: float) -> FloatArray:
    """Fill curves in until erosion ends, and return the states there.

    Returns
    -------
    ndarray, shape (5, run)
        u, x, L, z and the time: x or u is 0. NaN where erosion does not end within
        `dense_integration.MOST_STEPS`; the state at impact of a rod that does not begin to erode.
    """
    start = at_impact(rods)
    constants = np.stack(rods)
    ends = start.copy()
    # (2.16) and (2.17): the tail falls back behind the nose from the start.
    erodes = np.flatnonzero(erosion_slopes(start, constants)[1] > 0)
    ends[:, erodes] = np.nan
    one = np.ones_like(rods.length)
    scales = np.stack(
        [rods.impact_velocity, one, rods.length, rods.length, rods.length / rods.impact_velocity]
    )
    for some in integrate(
        erosion_slopes,
        start[:, erodes],
        constants[:, erodes],
        scales[:, erodes],
        is_over,
        tolerance,
    ):
        steps = some._replace(problem=erodes[some.problem])
        states, _ = final_states(steps)
        for each in curves:
            each.add_erosion(steps, states, rods)
        ends[:, steps.problem[steps.is_last]] = states[:, steps.is_last]
    return ends


def final_states(steps: Steps) -> tuple[FloatArray, FloatArray]:
    """Return the states at the ends of steps: of the last one of a rod, where its erosion ends.

    The second array has the part of each rod's last step after which that is.
    """
    last = np.flatnonzero(steps.is_last)
    parts = np.full((2, last.size), np.inf)
    for variable in (0, 1):  # u and x
        passed = np.flatnonzero(steps.after[variable, last] < 0)
        parts[variable, passed] = steps.parts_at(last[passed], variable, np.zeros(passed.size))
    ends = steps.after.copy()
    # Of two events the first is the one that ends erosion.
    first = parts.min(axis=0)
    ends[:, last] = steps.states(last, first)
    ends[parts.argmin(axis=0), last] = 0.0
    return ends, first


def is_over(state: FloatArray) -> BoolArray:
    """Check that states are past the end of erosion."""
    u, x = state[:2]
    return (x < 0) | (u < 0)


def _places(
    coordinates: FloatArray, first: FloatArray, behind: FloatArray
) -> tuple[IntArray, IntArray]:
    """Return each pair of an interval and a place whose ascending coordinate is in it.

    The intervals are half-open; their ends are NaN where there is none.
    """
    start = np.searchsorted(coordinates, first)
    count = np.searchsorted(coordinates, behind) - start
    interval = np.repeat(np.arange(count.size), count)
    place = np.arange(interval.size) - np.repeat(np.cumsum(count) - count - start, count)
    return interval, place
