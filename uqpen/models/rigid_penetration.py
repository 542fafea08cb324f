"""A rod that does not erode: the closed form to which an eroding rod is compared."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uqpen.model import Arrays, BoolArray, Results
from uqpen.models import rod_and_target
from uqpen.models.source import BuiltIn

__all__ = ["RigidPenetration"]


class RigidPenetration(BuiltIn):
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
        R, S = inputs["crater_radius"], inputs["plasticity_radius"]
        density_ratio = inputs["projectile_density"] / inputs["target_density"]
        resistance = (
            14 / 3 * inputs["target_yield_limit"] / inputs["target_density"] * np.log(S / R)
        )
        inertia = density_ratio * L + R * (S - R) / (S + R)
        # (2.16) with u = v and no erosion, integrated over depth down to u = 0.
        depth = inertia * np.log1p(inputs["impact_velocity"] ** 2 / resistance)
        return Results.all_ok(
            {
                "penetration_depth": depth,
                "projectile_residue": L.copy(),
                "erosion_end_depth": np.zeros_like(depth),
                "termination": np.full_like(depth, rod_and_target.Termination.RIGID),
            }
        )
