"""A rod that does not erode: the closed form to which an eroding rod is compared."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy import special

from uqpen.core.errors import TrajectoryError
from uqpen.core.model import Arrays, BoolArray, Results
from uqpen.models import rod_and_target
from uqpen.models.rod_course import DEPTHS, Trajectory, rigid_motion, trajectory_dataset
from uqpen.models.source import BuiltInModel

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["RigidPenetration"]

FloatArray = npt.NDArray[np.float64]


class RigidPenetration(BuiltInModel):
    """Penetration of a rod that keeps its length, with Walker and Anderson's target.

    It takes the inputs of `walker-anderson` and gives its outputs, so that a study can put one in
    the other's place; the projectile's strength, its sound speed and the smoothing have no effect.

    References
    ----------
    Soleng & Svinsås (2001), FFI/RAPPORT-2000/05876, section 3.2.2.
    """

    name = "rigid-penetration"
    inputs = rod_and_target.INPUTS
    outputs = rod_and_target.OUTPUTS
    alternatives = rod_and_target.ALTERNATIVES

    def conditions(self, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
        yield from rod_and_target.conditions(inputs)

    def evaluate(self, inputs: Arrays) -> Results:
        L = inputs["projectile_length"]
        inertia, resistance = _constants(inputs)
        # (2.16) with u = v and no erosion, integrated over depth down to u = 0.
        depth = inertia * special.log1p(inputs["impact_velocity"] ** 2 / resistance)
        return Results.all_ok(
            {
                "penetration_depth": depth,
                "projectile_residue": L.copy(),
                "erosion_end_depth": np.zeros_like(depth),
                "termination": np.full_like(depth, rod_and_target.Termination.RIGID),
            }
        )

    def trajectory(self, inputs: Mapping[str, float]) -> xr.Dataset:
        """The course of one run against depth, as that of `walker-anderson`."""
        arrays = {name: np.array([value], dtype=np.float64) for name, value in inputs.items()}
        with np.errstate(all="ignore"):
            inertia, resistance = (value.item() for value in _constants(arrays))
            rest = self.evaluate(arrays).outputs["penetration_depth"].item()
        if not 0 < rest < np.inf:
            raise TrajectoryError("inputs too large or too small")
        depth = np.linspace(0.0, rest, DEPTHS)
        time, velocity = rigid_motion(depth, rest, inputs["impact_velocity"], inertia, resistance)
        length = np.full_like(depth, inputs["projectile_length"])
        still = np.zeros_like(depth)
        return trajectory_dataset(Trajectory(depth, time, velocity, velocity, length, still))


def _constants(inputs: Arrays) -> tuple[FloatArray, FloatArray]:
    """The inertia, m, and the target's resistance, m2 s-2."""
    R, S = inputs["crater_radius"], inputs["plasticity_radius"]
    density_ratio = inputs["projectile_density"] / inputs["target_density"]
    resistance = (
        14
        / 3
        * inputs["target_yield_limit"]
        / inputs["target_density"]
        * special.log1p((S - R) / R)
    )
    inertia = density_ratio * inputs["projectile_length"] + R * (S - R) / (S + R)
    return inertia, resistance
