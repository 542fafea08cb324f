"""A rod that does not erode: the closed form to which an eroding rod is compared."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.errors import TrajectoryError
from uqpen.core.model import Arrays, Results
from uqpen.models.rod_and_target import RodModel, Termination
from uqpen.models.rod_course import DEPTHS, Trajectory, rigid_motion, trajectory_dataset
from uqpen.models.rod_motion import RigidMotion, at_impact, make_rods

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["RigidPenetration"]


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
