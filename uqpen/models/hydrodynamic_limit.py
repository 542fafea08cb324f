"""The hydrodynamic limit: how deep a rod without strength goes in a target without any."""

from __future__ import annotations

import numpy as np

from uqpen.core.model import Arrays, Results
from uqpen.models.rod_and_target import OUTPUTS, RodModel

__all__ = ["HydrodynamicLimit"]


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
