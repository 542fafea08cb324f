"""Motion of rods in their targets: while they erode, and as rigid bodies afterwards.

While a rod erodes, the unknowns are the nose's velocity u, the excess x = v/u - 1 of the tail's
velocity v, the length L and the depth z; in them the equations stay regular where the nose comes
to rest. Afterwards the rod is rigid, and its motion has a closed form.

References
----------
Soleng, H. H. & Svinsås, E. (2001). FFI/RAPPORT-2000/05876. Its equation numbers stand in brackets;
its (2.9) is used with (2 - ε), as (2.4) and (2.8) give it.
Alekseevskii, V. P. (1966). Combustion, Explosion and Shock Waves 2(2), 63-66.
Tate, A. (1967). J. Mech. Phys. Solids 15, 387-399. The velocity below which a rod is rigid.

Numbers in brackets without a point are those of docs/walker_anderson.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import special

from uqpen.core.arrays import Arrays, BoolArray, FloatArray, IntArray
from uqpen.models.dense_integration import Steps, integrate
from uqpen.models.rod_and_target import EQUAL_VELOCITIES, RIGID_VELOCITY, sound_speed


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


class Transition(NamedTuple):
    """Criterion by which an eroding rod becomes rigid, before its tail is as slow as its nose."""

    criterion: str = EQUAL_VELOCITIES
    strength_factor: float = 1.0  # F, in units of the projectile's yield limit

    def margin(self, state: FloatArray, constants: FloatArray) -> FloatArray:
        """Return what is left to the end of erosion, shape (run,): positive while a rod erodes.

        It is a difference of pressures over the largest pressure, and 1 where the velocities alone
        decide. The first rows of a state are u, x and L.
        """
        u, x, L = state[:3]
        if self.criterion == EQUAL_VELOCITIES:
            return np.ones_like(u)
        Omega, _, _, tail_strength, c, added_length, resistance, _, v0 = constants
        strength = 2 * self.strength_factor * Omega * tail_strength * c
        largest = v0**2 + resistance
        if self.criterion == RIGID_VELOCITY:
            return ((u * (1 + x)) ** 2 + resistance - strength) / largest  # (2)
        V = rigid_velocity(state, constants)
        borne = Omega * L / (Omega * L + added_length)
        return ((V**2 + resistance) * borne - strength) / largest  # (3)


DEFAULT = Transition()


def rigid_velocity(state: FloatArray, constants: FloatArray) -> FloatArray:
    """Return the velocity of the rigid body with the momentum of rod and target, shape (run,).

    The first rows of a state are u, x and L.
    """
    u, x, L = state[:3]
    Omega, profile, kappa, _, _, added_length, _, _, _ = constants
    share = Omega * (L - kappa * x / profile) / (Omega * L + added_length)
    # Exactly u where the velocities are equal, also for lengths that overflow.
    return u + np.where(x == 0, 0.0, u * x * share)  # (1)


class RigidMotion(NamedTuple):
    """Motion of rods that do not erode: 2 K du/dt = -(u² + B), (2.16) with u = v."""

    inertia: FloatArray  # (run,): k, m
    resistance: FloatArray  # (run,): B, m2 s-2
    velocity: FloatArray  # (run,): where it begins, m s-1
    depth: FloatArray  # (run,): the same, m
    time: FloatArray  # (run,): the same, s

    @classmethod
    def after(cls, rods: Rods, state: FloatArray) -> RigidMotion:
        """Return the motion of rods after a state of u, x, L, z and the time, shape (5, run)."""
        _, _, L, z, t = state
        velocity = rigid_velocity(state, np.stack(rods))
        return cls(rods.density_ratio * L + rods.added_length, rods.resistance, velocity, z, t)

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
        # A rod that stops while it erodes keeps its plastic extent.
        at_end, x, L, _, _ = start[:, run]
        x = np.where(at_end == 0, x, 0.0)
        self.values[:, run, place] = u, u, L, rods.plastic_scale[run] * x, z, t


def follow_erosion(
    rods: Rods, curves: Sequence[Curves], tolerance: float, transition: Transition = DEFAULT
) -> FloatArray:
    """Fill curves in until erosion ends, and return the states there.

    Returns
    -------
    ndarray, shape (5, run)
        u, x, L, z and the time: x or u is 0, or the rod is rigid by the transition. NaN where
        erosion does not end within `dense_integration.MOST_STEPS`; the state at impact of a rod
        that does not begin to erode.
    """
    start = at_impact(rods)
    constants = np.stack(rods)
    ends = start.copy()
    # (2.16) and (2.17): the tail falls back behind the nose from the start.
    falls_back = erosion_slopes(start, constants)[1] > 0
    erodes = np.flatnonzero(falls_back & (transition.margin(start, constants) > 0))
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
        partial(is_over, transition=transition),
        tolerance,
    ):
        steps = some._replace(problem=erodes[some.problem])
        states, _ = final_states(steps, constants, transition)
        for each in curves:
            each.add_erosion(steps, states, rods)
        ends[:, steps.problem[steps.is_last]] = states[:, steps.is_last]
    return ends


def final_states(
    steps: Steps, constants: FloatArray, transition: Transition
) -> tuple[FloatArray, FloatArray]:
    """Return the states at the ends of steps: of the last one of a rod, where its erosion ends.

    The second array has the part of each rod's last step after which that is.
    """
    last = np.flatnonzero(steps.is_last)
    parts = np.full((3, last.size), np.inf)
    for variable in (0, 1):  # u and x
        passed = np.flatnonzero(steps.after[variable, last] < 0)
        parts[variable, passed] = steps.parts_at(last[passed], variable, np.zeros(passed.size))
    own = constants[:, steps.problem[last]]
    passed = np.flatnonzero(transition.margin(steps.after[:, last], own) < 0)
    if passed.size:
        own = own[:, passed]
        parts[2, passed] = steps.root_parts(
            last[passed], lambda states: transition.margin(states, own)
        )
    ends = steps.after.copy()
    # Of several events the first is the one that ends erosion.
    first, event = parts.min(axis=0), parts.argmin(axis=0)
    ends[:, last] = steps.states(last, first)
    is_zero = event < 2
    ends[event[is_zero], last[is_zero]] = 0.0
    return ends, first


def is_over(state: FloatArray, constants: FloatArray, transition: Transition) -> BoolArray:
    """Check that states are past the end of erosion."""
    u, x = state[:2]
    return (x < 0) | (u < 0) | (transition.margin(state, constants) < 0)


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
