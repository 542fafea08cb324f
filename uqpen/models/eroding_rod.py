"""Penetration of eroding rods by the Walker-Anderson model, a whole batch of runs at once.

References
----------
Walker, J. D. & Anderson, C. E. (1995). Int. J. Impact Engng 16, 19-48.
Soleng, H. H. & Svinsås, E. (2001). Penetration modelling with uncertainty quantification using the
Walker-Anderson model. FFI/RAPPORT-2000/05876. Its equation numbers stand in brackets.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special

from uqpen.models import rod_lanes
from uqpen.models.rod_and_target import Termination

__all__ = ["DEFAULT_TOLERANCE", "Penetration", "penetrate", "prepare"]

FloatArray = npt.NDArray[np.float64]

# The largest errors in 40 000 draws of the report's Table 3.1 are then 1.9e-7 in the residue and
# 9e-8 in the depth.
DEFAULT_TOLERANCE = 1e-6


class Penetration(NamedTuple):
    """Results of a batch of runs; arrays of shape (run,).

    Attributes
    ----------
    depth : ndarray
        Final depth of the nose, m.
    residue : ndarray
        Final length of the rod, m.
    erosion_end_depth : ndarray
        Depth at which erosion ended, m; 0 for a rod that never began to erode.
    termination : ndarray of int8
        A `Termination`; -1 where the integration gave up.
    solved : ndarray of bool
        False where the integration gave up; the depths and the residue are not numbers then.
    """

    depth: FloatArray
    residue: FloatArray
    erosion_end_depth: FloatArray
    termination: npt.NDArray[np.int8]
    solved: npt.NDArray[np.bool_]


def penetrate(
    *,
    projectile_density: FloatArray,
    projectile_yield_limit: FloatArray,
    projectile_length: FloatArray,
    impact_velocity: FloatArray,
    projectile_sound_speed: FloatArray,
    target_density: FloatArray,
    target_yield_limit: FloatArray,
    plasticity_radius: FloatArray,
    crater_radius: FloatArray,
    smoothing: FloatArray,
    tolerance: float = DEFAULT_TOLERANCE,
) -> Penetration:
    """Integrate a batch of runs from impact to rest.

    Parameters
    ----------
    projectile_density, target_density : ndarray
        ρp, ρt, kg m-3; all arrays have the shape (run,).
    projectile_yield_limit, target_yield_limit : ndarray
        Yp, Yt, Pa.
    projectile_length : ndarray
        L0, m.
    impact_velocity, projectile_sound_speed : ndarray
        v0, c, m s-1.
    plasticity_radius, crater_radius : ndarray
        S, R, m, with S > R.
    smoothing : ndarray
        ε of the velocity profile in the projectile, 0 ≤ ε < 2; 0 is the original model.
    tolerance : float
        Relative error allowed to a step.

    Returns
    -------
    Penetration

    Notes
    -----
    The caller sees to it that every value is positive (the smoothing, at least 0) and S > R.
    """
    S, R = plasticity_radius, crater_radius
    Omega = projectile_density / target_density
    strength = target_yield_limit / (target_density * impact_velocity**2)
    resistance = 14 / 3 * strength * special.log1p((S - R) / R)  # (2.16)
    added_length = R * (S - R) / (S + R) / projectile_length  # (2.16)
    kappa = R * (S - R) * (S + R) / S**2 / (2 - smoothing) / projectile_length  # (2.9)
    c = projectile_sound_speed / impact_velocity
    gamma = projectile_yield_limit / (projectile_density * impact_velocity**2) / c  # (2.17)
    rods = np.stack(
        [
            Omega,
            2 * Omega / (2 + smoothing),
            kappa,
            gamma,
            gamma * c,
            gamma * kappa,
            2 * added_length,
            resistance,
        ]
    )
    # The tail falls back behind the nose from the start, or the rod never erodes: (2.16), (2.17).
    erodes = 1 + resistance > 2 * (Omega + added_length) * gamma * c
    ends = np.zeros((5, Omega.size))
    ends[0], ends[2], ends[4] = 1.0, 1.0, Termination.RIGID
    ends[:, erodes] = rod_lanes.erode(np.ascontiguousarray(rods[:, erodes]), tolerance)
    ends[:4, ends[4] == rod_lanes.GAVE_UP] = np.nan
    u, _, L, z, termination = ends
    # (2.16) with v = u from the end of erosion, integrated over depth down to u = 0.
    depth = z + (Omega * L + added_length) * special.log1p(u**2 / resistance)
    return Penetration(
        depth=depth * projectile_length,
        residue=L * projectile_length,
        erosion_end_depth=z * projectile_length,
        termination=termination.astype(np.int8),
        solved=np.isfinite(depth) & np.isfinite(L),
    )


def prepare() -> None:
    """Compile the integrator, or load it compiled, so that the first batch need not wait."""
    rod_lanes.erode(np.empty((8, 0)), DEFAULT_TOLERANCE)
