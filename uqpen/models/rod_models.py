"""Simpler models of a rod: rigid, without strength, and eroding with one velocity of its tail."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import TrajectoryError
from uqpen.core.model import Arrays, Results
from uqpen.models.rod_and_target import OUTPUTS, RodModel, Termination
from uqpen.models.rod_course import DEPTHS, Trajectory, rigid_motion, trajectory_dataset
from uqpen.models.rod_motion import RigidMotion, at_impact, make_rods

if TYPE_CHECKING:
    import xarray as xr


class HydrodynamicLimit(RodModel):
    """Depth L0 √(ρp/ρt) of a fast rod that erodes wholly, where neither side's strength matters.

    It takes the inputs of `walker-anderson`; the length and the two densities alone have an effect.
    It gives its outputs but for `termination`: erosion ends where no rod is left.

    References
    ----------
    Birkhoff, G., MacDougall, D. P., Pugh, E. M. & Taylor, G. (1948). J. Appl. Phys. 19, 563-582.
    """

    name = "hydrodynamic-limit"
    outputs = tuple(each for each in OUTPUTS if each.name != "termination")

    def evaluate(self, inputs: Arrays) -> Results:
        density_ratio = inputs["projectile_density"] / inputs["target_density"]
        depth = inputs["projectile_length"] * np.sqrt(density_ratio)
        return Results.all_ok(
            {
                "penetration_depth": depth,
                "projectile_residue": np.zeros_like(depth),
                "erosion_end_depth": depth.copy(),
            }
        )


class RigidPenetration(RodModel):
    """Penetration of a rod that keeps its length, with Walker and Anderson's target.

    It takes the inputs of `walker-anderson` and gives its outputs, so that a study can put one in
    the other's place; the projectile's strength, its sound speed and the smoothing have no effect.

    References
    ----------
    Soleng & Svinsås (2001), FFI/RAPPORT-2000/05876, section 3.2.2.
    """

    name = "rigid-penetration"

    def evaluate(self, inputs: Arrays) -> Results:
        L = inputs["projectile_length"]
        depth = _motion(inputs).rest_depth
        return Results.all_ok(
            {
                "penetration_depth": depth,
                "projectile_residue": L.copy(),
                "erosion_end_depth": np.zeros_like(depth),
                "termination": np.full_like(depth, Termination.RIGID),
            }
        )

    def trajectory(self, inputs: Mapping[str, float]) -> xr.Dataset:
        """The course of one run against depth, as that of `walker-anderson`."""
        arrays = {name: np.array([value], dtype=np.float64) for name, value in inputs.items()}
        with np.errstate(all="ignore"):
            motion = _motion(arrays)
            rest = motion.rest_depth.item()
        if not 0 < rest < np.inf:
            raise TrajectoryError("inputs too large or too small")
        depth = np.linspace(0.0, rest, DEPTHS)
        u0, inertia, resistance = inputs["impact_velocity"], motion.inertia, motion.resistance
        time, velocity = rigid_motion(depth, rest, u0, inertia.item(), resistance.item())
        length = np.full_like(depth, inputs["projectile_length"])
        still = np.zeros_like(depth)
        return trajectory_dataset(Trajectory(depth, time, velocity, velocity, length, still))


def _motion(inputs: Arrays) -> RigidMotion:
    rods = make_rods(inputs)
    return RigidMotion.after(rods, at_impact(rods))


# A rule of double-exponential quadrature over (0, 1): the error is below 1e-12 for strengths and
# densities of four decades and velocities of two.
_STEP = 1 / 12
_LAST = 37
# Where the rod has shrunk by exp(-40), what it still adds to the depth is below the last bit.
_NEGLIGIBLE = 40.0


class AlekseevskiiTate(RodModel):
    """An eroding rod whose uneroded part moves as one body, in a target of constant resistance.

    It takes the inputs of `walker-anderson` and gives its outputs, so that a study can put one in
    the other's place. The target's resistance is Walker and Anderson's, (7/3) Yt ln(S/R); the
    projectile's sound speed and the smoothing have no effect.

    References
    ----------
    Alekseevskii, V. P. (1966). Combustion, Explosion and Shock Waves 2(2), 63-66.
    Tate, A. (1967). J. Mech. Phys. Solids 15, 387-399.
    Walters, W. P. & Segletes, S. B. (1991). Int. J. Impact Engng 11, 225-231: an exact solution.
    """

    name = "alekseevskii-tate"

    def evaluate(self, inputs: Arrays) -> Results:
        # Numbers that overflow give no finite depth, which is the status of their run.
        with np.errstate(all="ignore"):
            return Results.all_ok(_penetrate(inputs))


class _Rod(NamedTuple):
    """Constants of the equations, each of shape (run,); numbers in brackets as in the docs."""

    length: FloatArray  # L0, m
    density_ratio: FloatArray  # ρp/ρt
    mu: FloatArray  # √(ρt/ρp)
    strength: FloatArray  # Yp/ρp, m2 s-2
    excess: FloatArray  # D = 2 (Rt - Yp)/ρp, m2 s-2
    resistance: FloatArray  # 2 Rt/ρt, m2 s-2


def _penetrate(inputs: Arrays) -> dict[str, FloatArray]:
    R, S = inputs["crater_radius"], inputs["plasticity_radius"]
    density, target_density = inputs["projectile_density"], inputs["target_density"]
    yield_limit, velocity = inputs["projectile_yield_limit"], inputs["impact_velocity"]
    resistance = 7 / 3 * inputs["target_yield_limit"] * special.log1p((S - R) / R)  # (1)
    rod = _Rod(
        length=inputs["projectile_length"],
        density_ratio=density / target_density,
        mu=np.sqrt(target_density / density),
        strength=yield_limit / density,
        excess=2 * (resistance - yield_limit) / density,  # (6)
        resistance=2 * resistance / target_density,
    )
    is_target_stronger = rod.excess > 0
    # Above this velocity of its tail the rod erodes and penetrates.
    limit = np.sqrt(np.abs(rod.excess)) / np.where(is_target_stronger, 1.0, rod.mu)  # (8)
    erodes = velocity > limit
    length, eroded = _erode(rod, velocity, limit)
    length = np.where(erodes, length, rod.length)
    erosion_end = np.where(erodes, eroded, 0.0)
    speed = np.where(is_target_stronger, 0.0, np.minimum(limit, velocity))
    rigid = rod.density_ratio * length * special.log1p(speed**2 / rod.resistance)  # (11)
    ends = np.where(erodes, Termination.BREAKDOWN, Termination.RIGID)
    return {
        "penetration_depth": erosion_end + rigid,
        "projectile_residue": length,
        "erosion_end_depth": erosion_end,
        "termination": np.where(is_target_stronger, Termination.STANDSTILL, ends).astype(float),
    }


def _erode(rod: _Rod, start: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return length and depth of rods whose tails have slowed down from one velocity to another."""
    first = _velocities(rod, start)
    lost = start - end
    # The rod shrinks faster than at half of the loss, until there: (9) is convex in v.
    _, halfway = _velocities(rod, (start + end) / 2)
    enough = _NEGLIGIBLE * rod.strength / halfway
    lost_in_depth = np.where(enough < lost / 2, enough, lost)
    integral = np.zeros_like(lost)
    for step in range(-_LAST, _LAST + 1):
        inner = np.pi * np.sinh(step * _STEP)
        fraction, rest = special.expit(inner), special.expit(-inner)
        weight = _STEP * np.pi * np.cosh(step * _STEP) * fraction * rest
        slower = lost_in_depth * fraction
        now = _velocities(rod, start - slower)
        integral += weight * now[0] * _share(rod, first, now, slower)
    depth = rod.length * lost_in_depth / rod.strength * integral  # (10)
    return rod.length * _share(rod, first, _velocities(rod, end), lost), depth


# The nose's velocity u, and that of the tail less it, v - u, m s-1.
_Velocities = tuple[FloatArray, FloatArray]


def _velocities(rod: _Rod, v: FloatArray) -> _Velocities:
    root = np.sqrt(v**2 + rod.excess * (1 / rod.mu**2 - 1))
    # Only a rod as strong as its target erodes down to v = 0.
    u = np.where(v > 0, (v**2 - rod.excess) / (v + rod.mu * root), 0.0)  # (7)
    return u, v - u


def _share(rod: _Rod, first: _Velocities, now: _Velocities, slower: FloatArray) -> FloatArray:
    """Return L/L0 by (9), its differences written without cancellation."""
    mu, (first_u, first_w), (u, w) = rod.mu, first, now
    tail, nose = first_w + w, mu**2 * (first_u + u)
    fall_u, fall_w = slower * tail / (tail + nose), slower * nose / (tail + nose)
    power = (fall_w * tail + fall_u * first_w + u * fall_w) / 2
    logarithm = special.log1p((mu * fall_u + fall_w) / (mu * u + w))
    exponent = power + np.where(rod.excess == 0, 0.0, rod.excess / (2 * mu) * logarithm)
    # Not NumPy's exponential, whose last bit depends on the processor.
    return special.exp2(exponent / (-np.log(2.0) * rod.strength))
