"""The rods of the plain study, and what SciPy's DOP853 says of them, one run at a time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

import uqpen
from uqpen.core.arrays import FloatArray
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import points_in_memory
from uqpen.execution import Evaluator
from uqpen.models.rod_course import erosion_slopes, make_rod
from uqpen.models.rod_motion import Rods

Inputs = dict[str, FloatArray]


def admissible_points() -> Inputs:
    """The admissible points of the plain study, an array of each of the model's inputs."""
    study = uqpen.load_study(Path(__file__).parents[1] / "plain.toml")
    (design,) = study.designs.values()
    points = points_in_memory(next(design.rounds(study.joint, Stream(study.seed))))
    columns = {
        str(name): np.broadcast_to(column.values, points.sizes["run"])
        for name, column in points.data_vars.items()
    }
    kept = Evaluator(study.model)(columns).status == 0
    return {name: np.ascontiguousarray(column[kept]) for name, column in columns.items()}


def dop853(batch: Inputs, tolerance: float) -> FloatArray:
    """Depth and residue of every run, one after the other."""
    results = []
    for row in zip(*(values.tolist() for values in batch.values()), strict=True):
        rod = make_rod(dict(zip(batch, row, strict=True)))
        u, _, L, z = _eroded(rod, tolerance)
        inertia = rod.density_ratio * L + rod.added_length
        results.append((z + inertia * np.log1p(max(u, 0.0) ** 2 / rod.resistance), L))
    return np.array(results).T


def _eroded(rod: Rods, tolerance: float) -> list[float]:
    """The state of a rod at the end of erosion, by SciPy."""
    inertia = rod.density_ratio * rod.length + rod.added_length
    # In this time the target's resistance alone would stop the rod as it was, however fast.
    longest = np.pi * inertia / np.sqrt(rod.resistance)
    solution = solve_ivp(
        lambda _, state: erosion_slopes(state, rod),
        (0.0, longest),
        [rod.impact_velocity, 0.0, rod.length, 0.0],
        method="DOP853",
        events=(_tail_lead, _nose_velocity),
        rtol=tolerance,
        atol=tolerance * 1e-2 * np.array([rod.impact_velocity, 1.0, rod.length, rod.length]),
    )
    ends: list[float] = solution.y[:, -1].tolist()
    return ends


def _tail_lead(_: float, state: FloatArray) -> float:
    return float(state[1])


def _nose_velocity(_: float, state: FloatArray) -> float:
    return float(state[0])


for _event in (_tail_lead, _nose_velocity):
    _event.terminal = True  # type: ignore[attr-defined]
    _event.direction = -1  # type: ignore[attr-defined]


def worst_error(results: FloatArray, reference: FloatArray) -> float:
    return float(np.abs(results / reference - 1).max())
