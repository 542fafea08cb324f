"""The lanes against SciPy's DOP853, one run at a time, on the plain study; on one core.

Run it as ``python benchmarks/solver.py``, with uqpen installed. Both solve the same regular form
of the equations to the same worst error; they are timed by turns in one process, as wall times on
a busy machine may differ by a factor of two within a minute.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from uqpen.models.rod_motion import Rods

FloatArray = npt.NDArray[np.float64]
Inputs = dict[str, FloatArray]

SUBSET = 200
REPEATS = 7
REQUIRED = 500

_PREPARE = """
import time
start = time.perf_counter()
from uqpen.models.walker_anderson import WalkerAnderson
imported = time.perf_counter()
WalkerAnderson().prepare()
print(imported - start, time.perf_counter() - imported)
"""


def main() -> int:
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with tempfile.TemporaryDirectory() as cache:
        # Before Numba is imported: it reads this once.
        os.environ["NUMBA_CACHE_DIR"] = cache
        for state in ("cold", "cached"):
            importing, preparing = _preparation()
            print(f"{state:6}  import {importing:.2f} s, first call {preparing:.2f} s")
        return _compare()


def _preparation() -> tuple[float, float]:
    """Seconds of import and of the first call in a process of its own."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(
        [sys.executable, "-c", _PREPARE],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    importing, preparing = map(float, done.stdout.split())
    return importing, preparing


def _compare() -> int:
    from uqpen.models.walker_anderson import DEFAULT_TOLERANCE

    batch = admissible_points()
    subset = {name: values[:SUBSET] for name, values in batch.items()}
    tight = _lanes(batch, 1e-11)
    reference = dop853(subset, 1e-12)
    agreement = worst_error(tight[:, :SUBSET], reference)
    print(f"the two methods at tight tolerances agree to {agreement:.1e} in {SUBSET} runs")

    default = _lanes(batch, DEFAULT_TOLERANCE)
    target = worst_error(default[:, :SUBSET], reference)
    print(f"lanes   worst error {target:.1e} in {SUBSET} runs,", end=" ")
    print(f"{worst_error(default, tight):.1e} in all {default.shape[1]}")
    tolerance, error = _matching_tolerance(subset, reference, target)
    print(f"DOP853  worst error {error:.1e} in {SUBSET} runs, with rtol = {tolerance:.1e}")

    lane_rates, loop_rates = [], []
    for _ in range(REPEATS):
        elapsed = [_seconds(lambda: _lanes(batch, DEFAULT_TOLERANCE)) for _ in range(15)]
        lane_rates.append(tight.shape[1] / statistics.median(elapsed))
        loop_rates.append(SUBSET / _seconds(lambda: dop853(subset, tolerance)))
    return _report(lane_rates, loop_rates)


def _report(lane_rates: list[float], loop_rates: list[float]) -> int:
    ratios = [lane / loop for lane, loop in zip(lane_rates, loop_rates, strict=True)]
    lane, loop, ratio = map(statistics.median, (lane_rates, loop_rates, ratios))
    print(f"lanes   {lane:10,.0f} runs/s, {1e7 / lane:.1f} ms for 10 000 runs")
    print(f"DOP853  {loop:10,.0f} runs/s, {1e4 / loop:.1f} s for 10 000 runs")
    print(f"ratio   {ratio:10,.0f} ({min(ratios):,.0f} to {max(ratios):,.0f})", end="; ")
    print(f"required {REQUIRED}")
    return 0 if ratio >= REQUIRED else 1


def admissible_points() -> Inputs:
    """The admissible points of the plain study, an array of each of the model's inputs."""
    import uqpen
    from uqpen.core.streams import Stream
    from uqpen.designs.drawn_points import points_in_memory
    from uqpen.execution import Evaluator

    study = uqpen.load_study(Path(__file__).with_name("plain.toml"))
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
    from uqpen.models.rod_course import make_rod

    results = []
    for row in zip(*(values.tolist() for values in batch.values()), strict=True):
        rod = make_rod(dict(zip(batch, row, strict=True)))
        u, _, L, z = _eroded(rod, tolerance)
        inertia = rod.density_ratio * L + rod.added_length
        results.append((z + inertia * np.log1p(max(u, 0.0) ** 2 / rod.resistance), L))
    return np.array(results).T


def _eroded(rod: Rods, tolerance: float) -> list[float]:
    """The state of a rod at the end of erosion, by SciPy."""
    from scipy.integrate import solve_ivp

    from uqpen.models.rod_course import erosion_slopes

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


def _lanes(batch: Inputs, tolerance: float) -> FloatArray:
    """Depth and residue of every run, all of them together."""
    from uqpen.models.walker_anderson import WalkerAnderson

    outputs = WalkerAnderson(tolerance).evaluate(batch).outputs
    return np.array([outputs["penetration_depth"], outputs["projectile_residue"]])


def _matching_tolerance(batch: Inputs, reference: FloatArray, target: float) -> tuple[float, float]:
    """The loosest tolerance with which DOP853 is as exact as the lanes, and its worst error."""
    for tolerance in np.geomspace(1e-4, 1e-8, 25).tolist():
        error = worst_error(dop853(batch, tolerance), reference)
        if error <= 1.5 * target:
            break
    return tolerance, error


def worst_error(results: FloatArray, reference: FloatArray) -> float:
    return float(np.abs(results / reference - 1).max())


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


if __name__ == "__main__":
    sys.exit(main())
