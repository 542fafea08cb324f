"""The trajectory of a rod as outputs in time, against the same equations elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from uqpen.core.status import Status
from uqpen.execution import Evaluator
from uqpen.models.rod_trajectory import make_rod, trajectory
from uqpen.models.walker_anderson import WalkerAnderson
from uqpen.models.walker_anderson_trajectory import WalkerAndersonTrajectory, rod_motion
from uqpen.testing import check_model

ROD = {
    "projectile_density": 17_500.0,
    "projectile_yield_limit": 1.65e9,
    "projectile_length": 0.16,
    "impact_velocity": 1400.0,
    "projectile_sound_speed": 3071.0,
    "target_density": 2500.0,
    "target_yield_limit": 400e6,
    "plasticity_radius": 0.1,
    "crater_radius": 0.017,
    "smoothing": 0.0,
}
# Erodes and then goes on as a rigid body; erodes to a standstill; is rigid throughout.
CASES = {
    "breakdown": ROD,
    "standstill": {**ROD, "target_yield_limit": 5e9},
    "rigid": {**ROD, "impact_velocity": 300.0},
}


def inputs(case: dict[str, float], runs: int = 1) -> dict[str, np.ndarray]:  # type: ignore[type-arg]
    return {name: np.full(runs, value) for name, value in case.items()}


@pytest.mark.parametrize("case", CASES)
def test_it_is_the_trajectory_of_one_rod(case: str) -> None:
    rod = make_rod(**CASES[case])
    known = trajectory(rod)
    found = rod_motion(rod, known.time, 1e-10)
    assert found.rest_time == pytest.approx(known.time[-1], rel=1e-12)
    assert found.penetration_depth == pytest.approx(known.depth[-1], rel=1e-12)
    # Rounding may put the time of rest past the end of the curve.
    for name in ("nose_velocity", "tail_velocity", "length", "plastic_extent"):
        curve = getattr(known, name)[:-1]
        assert np.abs(getattr(found, name)[:-1] - curve).max() <= 1e-9 * max(curve.max(), 1e-3)
    assert np.abs(found.nose_depth - known.depth)[:-1].max() <= 1e-12


def test_numbers_at_rest_are_those_of_the_model_for_batches() -> None:
    cases = {name: np.array([case[name] for case in CASES.values()]) for name in ROD}
    found = Evaluator(WalkerAndersonTrajectory(times=2))(cases).outputs["penetration_depth"]
    known = Evaluator(WalkerAnderson())(cases).outputs["penetration_depth"]
    assert found == pytest.approx(known, rel=1e-5)


def test_curves_end_where_the_rod_rests() -> None:
    model = WalkerAndersonTrajectory(duration="2 ms", times=201)
    results = Evaluator(model)(inputs(ROD))
    assert results.status.tolist() == [Status.OK]
    rest = results.outputs["rest_time"][0]
    times = np.array(model.outputs[0].dims[0].values)
    for name in ("nose_velocity", "tail_velocity", "length", "plastic_extent", "nose_depth"):
        assert np.array_equal(np.isnan(results.outputs[name][0]), times > rest), name
    assert 0 < rest < 2e-3
    depth = results.outputs["nose_depth"][0][times <= rest]
    assert (np.diff(depth) > 0).all()
    assert depth[-1] <= results.outputs["penetration_depth"][0]


def test_it_begins_at_impact() -> None:
    found = Evaluator(WalkerAndersonTrajectory(times=2))(inputs(ROD)).outputs
    start = {name: values[0, 0] for name, values in found.items() if values.ndim == 2}
    assert start == {
        "nose_velocity": 1400.0,
        "tail_velocity": 1400.0,
        "length": 0.16,
        "plastic_extent": 0.0,
        "nose_depth": 0.0,
    }


def test_what_overflows_is_not_finite() -> None:
    case = {**ROD, "projectile_length": 1e300, "target_yield_limit": 1e-300}
    results = Evaluator(WalkerAndersonTrajectory(times=2))(inputs(case))
    assert results.status.tolist() == [Status.NOT_FINITE]
    assert results.reasons == {0: "nose_velocity is nan at elapsed_time = 0 ms"}


def test_it_meets_the_contract_of_models() -> None:
    check_model(WalkerAndersonTrajectory(times=5), inputs(ROD, 2))


def test_settings_decide_its_identity() -> None:
    one, other = WalkerAndersonTrajectory(), WalkerAndersonTrajectory(duration="1 ms")
    assert one.identity()["duration"] == "0.002"
    assert other.identity() == {**one.identity(), "duration": "0.001"}
    assert other.outputs != one.outputs
