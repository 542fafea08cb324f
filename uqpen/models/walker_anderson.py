"""The Walker-Anderson model of an eroding rod, for whole batches of runs.

References
----------
Walker, J. D. & Anderson, C. E. (1995). Int. J. Impact Engng 16, 19-48.
Soleng, H. H. & Svinsås, E. (2001). Penetration modelling with uncertainty quantification using the
Walker-Anderson model. FFI/RAPPORT-2000/05876. Its equation numbers stand in brackets.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from uqpen.core.errors import TrajectoryError
from uqpen.core.model import Arrays, FloatArray, Results
from uqpen.core.processors import map_parts
from uqpen.core.settings import number, validate
from uqpen.core.status import Status
from uqpen.models.rod_and_target import (
    EQUAL_VELOCITIES,
    OUTPUTS_BY_STRENGTH,
    RodModel,
    Termination,
    sound_speed,
    strength_factor_setting,
    transition_problems,
    transition_setting,
)

if TYPE_CHECKING:
    import xarray as xr

# The largest errors in 40 000 draws of the report's Table 3.1 are then 1.9e-7 in the residue and
# 9e-8 in the depth.
DEFAULT_TOLERANCE = 1e-6

_UNSOLVED = "the integration did not reach the end of erosion within its steps"

_WORTH_A_THREAD = 512  # runs, which take a millisecond

# Rods that are followed together to a criterion of their own, and the tolerance of that
# integration, in units of the model's: the errors are then those that the model promises.
_TOGETHER = 1024
_FINER = 1e-2


@dataclass(frozen=True)
class WalkerAnderson(RodModel):
    """An eroding rod penetrating a thick target, original or with a smoothed velocity profile.

    Erosion ends where the tail is as slow as the nose (the rest of the rod goes on as a rigid
    body) or where the nose comes to rest; a rod that never starts to erode is rigid throughout.
    Other criteria end erosion while the tail is still faster; the rest then goes on with the
    momentum of rod and target.

    Parameters
    ----------
    tolerance : float
        Relative error allowed to a step of the integration; with the default, depth and residue
        of the concrete study are right to 1e-6.
    transition : str
        When the rod becomes rigid, if not before its tail is as slow as its nose:
        ``"equal-velocities"`` (not before), ``"rigid-velocity"`` (where the tail is no faster than
        the rod that Alekseevskii and Tate call rigid) or ``"rigid-stress"`` (where the rest of the
        rod would not yield as a rigid body). The last two are integrated by another method, which
        takes some hundred times as long.
    strength_factor : float
        Strength of the projectile in that criterion, in units of its yield limit.

    References
    ----------
    Walker, J. D. & Anderson, C. E. (1995). Int. J. Impact Engng 16, 19-48.
    Alekseevskii, V. P. (1966). Combustion, Explosion and Shock Waves 2(2), 63-66.
    Tate, A. (1967). J. Mech. Phys. Solids 15, 387-399.
    Soleng, H. H. & Svinsås, E. (2001). FFI/RAPPORT-2000/05876; its equation (2.9) is used with
    (2 - ε) as (2.4) and (2.8) give it, where the report prints (2 + ε).
    """

    tolerance: float = number(above=0, below=1e-2, default=DEFAULT_TOLERANCE)
    transition: str = transition_setting()
    strength_factor: float = strength_factor_setting()

    name = "walker-anderson"

    def __post_init__(self) -> None:
        validate(self, transition_problems(self.transition, self.strength_factor))
        if self.transition != EQUAL_VELOCITIES:
            object.__setattr__(self, "outputs", OUTPUTS_BY_STRENGTH)

    def prepare(self) -> None:
        if self.transition == EQUAL_VELOCITIES:
            erode(np.empty((8, 0)), self.tolerance)

    def evaluate(self, inputs: Arrays) -> Results:
        if self.transition != EQUAL_VELOCITIES:
            return self._evaluate_by_strength(inputs)
        S, R = inputs["plasticity_radius"], inputs["crater_radius"]
        length, velocity = inputs["projectile_length"], inputs["impact_velocity"]
        projectile, target = inputs["projectile_density"], inputs["target_density"]
        smoothing = inputs["smoothing"]
        Omega = projectile / target
        strength = inputs["target_yield_limit"] / (target * velocity**2)
        resistance = 14 / 3 * strength * special.log1p((S - R) / R)  # (2.16)
        added_length = R * (S - R) / (S + R) / length  # (2.16)
        kappa = R * (S - R) * (S + R) / S**2 / (2 - smoothing) / length  # (2.9)
        c = sound_speed(inputs) / velocity
        gamma = inputs["projectile_yield_limit"] / (projectile * velocity**2) / c  # (2.17)
        share = 2 * Omega / (2 + smoothing)
        rods = np.stack(
            [Omega, share, kappa, gamma, gamma * c, gamma * kappa, 2 * added_length, resistance]
        )
        # The tail falls back behind the nose from the start, or the rod never erodes: (2.16, 2.17).
        erodes = 1 + resistance > 2 * (Omega + added_length) * gamma * c
        ends = np.zeros((5, Omega.size))
        ends[0], ends[2], ends[4] = 1.0, 1.0, Termination.RIGID
        ends[:, erodes] = erode(np.ascontiguousarray(rods[:, erodes]), self.tolerance)[:5]
        ends[:4, ends[4] < 0] = np.nan
        u, _, L, z, termination = ends
        # (2.16) with v = u from the end of erosion, integrated over depth down to u = 0.
        depth = z + (Omega * L + added_length) * special.log1p(u**2 / resistance)
        return _results(length, depth, L, z, termination)

    def _evaluate_by_strength(self, inputs: Arrays) -> Results:
        """Run a batch whose erosion may end before the velocities are equal."""
        from uqpen.models.rod_motion import RigidMotion, Transition, follow_erosion, make_rods

        transition = Transition(self.transition, self.strength_factor)
        columns = []
        for first in range(0, inputs["crater_radius"].size, _TOGETHER):
            some = slice(first, first + _TOGETHER)
            # What overflows has no number.
            with np.errstate(all="ignore"):
                rods = make_rods({name: values[some] for name, values in inputs.items()})
                state = follow_erosion(rods, (), _FINER * self.tolerance, transition)
                depth = RigidMotion.after(rods, state).rest_depth
            u, x, L, z, time = state
            ending = np.select(
                [time == 0, u == 0, x == 0],
                [Termination.RIGID, Termination.STANDSTILL, Termination.BREAKDOWN],
                Termination.STRENGTH,
            )
            columns.append(np.stack([depth, L, z, ending]))
        return _results(np.ones(1), *np.concatenate([np.empty((4, 0)), *columns], axis=1))

    def trajectory(self, inputs: Mapping[str, float]) -> xr.Dataset:
        """The course of one run against depth, from the surface to where the rod stops.

        It has ``time``, ``nose_velocity``, ``tail_velocity``, ``length`` and ``plastic_extent``
        along ``penetration_depth``. The inputs are SI values.
        """
        from uqpen.models.rod_course import make_rod, trajectory, trajectory_dataset
        from uqpen.models.rod_motion import Transition

        c = sound_speed({name: np.asarray(value) for name, value in inputs.items()})
        values = {name: float(value) for name, value in inputs.items()}
        try:
            rod = make_rod({**values, "projectile_sound_speed": float(c)})
            transition = Transition(self.transition, self.strength_factor)
            course = trajectory(rod, transition=transition)
        except (OverflowError, ZeroDivisionError) as error:
            raise TrajectoryError(f"inputs too large or too small: {error}") from None
        return trajectory_dataset(course)


def _results(
    unit: FloatArray, depth: FloatArray, L: FloatArray, z: FloatArray, termination: FloatArray
) -> Results:
    """Return the results of a batch from lengths in a unit, m; those that are not finite failed."""
    is_solved = np.isfinite(depth) & np.isfinite(L)
    outputs = {
        "penetration_depth": depth * unit,
        "projectile_residue": L * unit,
        "erosion_end_depth": z * unit,
        "termination": termination,
    }
    status = np.where(is_solved, Status.OK, Status.FAILED).astype(np.int8)
    reasons = dict.fromkeys(np.flatnonzero(~is_solved).tolist(), _UNSOLVED)
    return Results(outputs, status, reasons)


def erode(rods: FloatArray, tolerance: float) -> FloatArray:
    """Integrate rods from impact to the end of erosion, on all processors of this process.

    The integration itself is compiled (`rod_kernel`), side by side in lanes that share nothing. So
    a run's result has the same bits whatever else is in its batch and wherever in it the run is.

    Parameters
    ----------
    rods : ndarray, shape (8, run)
        Ω, 2Ω/(2 + ε), κ, γ, γc, γκ, 2R(S - R)/(S + R) and (14/3) Tt² ln(S/R) of each run, where
        s = κx and γ = Yp/(ρp c); lengths in units of the rod's, velocities in the impact's.
    tolerance : float
        Relative error allowed to a step.

    Returns
    -------
    ndarray, shape (6, run)
        u, x, L and z at the end of erosion, how it ends (a `Termination`, or -1 where it does not
        within the steps allowed), and the number of steps, of six evaluations of the slopes each.
    """
    # It loads Numba, so only where a rod really erodes.
    from uqpen.models.rod_kernel import erode as erode_compiled

    def erode_part(part: slice) -> FloatArray:
        some = np.array(rods[:, part], order="C")
        return erode_compiled(some, tolerance) if some.size else np.empty((6, 0))

    return np.concatenate(map_parts(erode_part, rods.shape[1], _WORTH_A_THREAD), axis=1)
