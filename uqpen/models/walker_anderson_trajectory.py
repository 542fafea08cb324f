"""The Walker-Anderson model of an eroding rod, with its trajectory as outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from uqpen.core.arrays import FloatArray
from uqpen.core.settings import number
from uqpen.models.rod_curves import Curves, follow_erosion
from uqpen.models.rod_motion import Rods
from uqpen.models.rod_trajectories import RodTrajectories

__all__ = ["WalkerAndersonTrajectory"]


@dataclass(frozen=True)
class WalkerAndersonTrajectory(RodTrajectories):
    """Trajectory of an eroding rod in a thick target, by time since impact or by depth.

    The equations are those of `walker-anderson`; the integration is another one, which follows the
    rods between its steps.

    Parameters
    ----------
    along, duration, times, depth_limit, depths
        The curves; see `uqpen.models.rod_trajectories.RodTrajectories`.
    tolerance : float
        Relative error allowed to a step of the integration; with the default, curves of the
        concrete study are right to 1e-6 of their largest values.

    References
    ----------
    Soleng, H. H. & Svinsås, E. (2001). FFI/RAPPORT-2000/05876, as in `uqpen.models.rod_motion`.
    """

    tolerance: float = number(above=0, below=1e-2, default=1e-8)

    name = "walker-anderson-trajectory"

    def erode(self, rods: Rods, curves: Sequence[Curves]) -> FloatArray:
        return follow_erosion(rods, curves, self.tolerance)
