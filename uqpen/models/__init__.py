"""Models that a study can name, and adapters for user-defined ones."""

from __future__ import annotations

__all__ = ["MODELS"]

MODELS = {
    "walker-anderson": "uqpen.models.walker_anderson:WalkerAnderson",
    "walker-anderson-trajectory": "uqpen.models.rod_trajectories:WalkerAndersonTrajectory",
    "walker-anderson-drucker-prager": (
        "uqpen.models.walker_anderson_drucker_prager:WalkerAndersonDruckerPrager"
    ),
    "rigid-penetration": "uqpen.models.rod_models:RigidPenetration",
    "rigid-penetration-trajectory": "uqpen.models.rod_trajectories:RigidPenetrationTrajectory",
    "alekseevskii-tate": "uqpen.models.rod_models:AlekseevskiiTate",
    "hydrodynamic-limit": "uqpen.models.rod_models:HydrodynamicLimit",
    "ishigami": "uqpen.models.known_functions:Ishigami",
    "campbell-1d": "uqpen.models.known_functions:Campbell",
}
