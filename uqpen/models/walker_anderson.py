"""The Walker-Anderson model of an eroding rod, for whole batches of runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from uqpen.core.errors import TrajectoryError
from uqpen.core.model import Arrays, BoolArray, Results
from uqpen.core.settings import number, validate
from uqpen.core.status import Status
from uqpen.models import rod_and_target
from uqpen.models.source import BuiltInModel

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["WalkerAnderson"]

_UNSOLVED = "the integration did not reach the end of erosion within its steps"


@dataclass(frozen=True)
class WalkerAnderson(BuiltInModel):
    """An eroding rod penetrating a thick target, original or with a smoothed velocity profile.

    Erosion ends where the tail is as slow as the nose (the rest of the rod goes on as a rigid
    body) or where the nose comes to rest; a rod that never starts to erode is rigid throughout.

    Parameters
    ----------
    tolerance : float
        Relative error allowed to a step of the integration; with the default, depth and residue
        of the concrete study are right to 1e-6.

    References
    ----------
    Walker, J. D. & Anderson, C. E. (1995). Int. J. Impact Engng 16, 19-48.
    Soleng, H. H. & Svinsås, E. (2001). FFI/RAPPORT-2000/05876; its equation (2.9) is used with
    (2 - ε) as (2.4) and (2.8) give it, where the report prints (2 + ε).
    """

    tolerance: float = number(above=0, below=1e-2, default=1e-6)

    name = "walker-anderson"
    inputs = rod_and_target.INPUTS
    outputs = rod_and_target.OUTPUTS
    alternatives = rod_and_target.ALTERNATIVES

    def __post_init__(self) -> None:
        validate(self)

    def conditions(self, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
        yield from rod_and_target.conditions(inputs)

    def prepare(self) -> None:
        from uqpen.models import eroding_rod

        eroding_rod.prepare()

    def evaluate(self, inputs: Arrays) -> Results:
        # Numba is imported with the integrator, so only where a rod really erodes.
        from uqpen.models.eroding_rod import penetrate

        rods = penetrate(**_rod(inputs), tolerance=self.tolerance)
        outputs = {
            "penetration_depth": rods.depth,
            "projectile_residue": rods.residue,
            "erosion_end_depth": rods.erosion_end_depth,
            "termination": rods.termination.astype(np.float64),
        }
        status = np.where(rods.solved, Status.OK, Status.FAILED).astype(np.int8)
        reasons = {int(run): _UNSOLVED for run in np.flatnonzero(~rods.solved)}
        return Results(outputs, status, reasons)

    def trajectory(self, inputs: Mapping[str, float]) -> xr.Dataset:
        """The course of one run against depth.

        Parameters
        ----------
        inputs : mapping of str to float
            SI values.

        Returns
        -------
        Dataset
            ``time``, ``nose_velocity``, ``tail_velocity``, ``length`` and ``plastic_extent`` along
            ``penetration_depth``, from the surface to where the rod stops.
        """
        from uqpen.models.rod_course import trajectory_dataset
        from uqpen.models.rod_erosion import make_rod
        from uqpen.models.rod_trajectory import trajectory

        scalars = {name: np.asarray(value, dtype=np.float64) for name, value in inputs.items()}
        constants: dict[str, Any] = {name: float(value) for name, value in _rod(scalars).items()}
        try:
            solution = trajectory(make_rod(**constants))
        except (OverflowError, ZeroDivisionError) as error:
            raise TrajectoryError(f"inputs too large or too small: {error}") from None
        return trajectory_dataset(solution)


def _rod(inputs: Arrays) -> Arrays:
    """The integrator's arguments: a sound speed in place of what it was given by."""
    chosen = {
        variable.name: inputs[variable.name]
        for variable in rod_and_target.INPUTS
        if variable.name in inputs and variable.name != "projectile_young_modulus"
    }
    return {**chosen, "projectile_sound_speed": rod_and_target.sound_speed(inputs)}
