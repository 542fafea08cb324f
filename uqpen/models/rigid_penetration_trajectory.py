"""A rod that does not erode, with its trajectory as outputs: a closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from uqpen.core.arrays import FloatArray
from uqpen.models.rod_curves import Curves
from uqpen.models.rod_motion import Rods, at_impact
from uqpen.models.rod_trajectories import RodTrajectories

__all__ = ["RigidPenetrationTrajectory"]


@dataclass(frozen=True)
class RigidPenetrationTrajectory(RodTrajectories):
    """Trajectory of a rod that keeps its length, with Walker and Anderson's target.

    It takes the inputs and gives the outputs of `walker-anderson-trajectory`; the projectile's
    strength, its sound speed and the smoothing have no effect.

    Parameters
    ----------
    along, duration, times, depth_limit, depths
        The curves; see `uqpen.models.rod_trajectories.RodTrajectories`.

    References
    ----------
    Soleng & Svinsås (2001), FFI/RAPPORT-2000/05876, section 3.2.2.
    """

    name = "rigid-penetration-trajectory"

    def erode(self, rods: Rods, curves: Sequence[Curves]) -> FloatArray:
        return at_impact(rods)
