"""Trajectories of rods as outputs, against the same equations elsewhere and what they conserve."""

import csv
from pathlib import Path

import numpy as np
import pytest
from nominal_rod import COURSE, KNOWN_POINTS, ROD

from uqpen.core.errors import SettingsError
from uqpen.core.status import Status
from uqpen.execution import Evaluator
from uqpen.models.rod_course import make_rod, trajectory
from uqpen.models.rod_models import RigidPenetration
from uqpen.models.rod_motion import Along, Curves, RigidMotion, follow_erosion, make_rods
from uqpen.models.rod_trajectories import RigidPenetrationTrajectory, WalkerAndersonTrajectory
from uqpen.testing import check_model

DATA = Path(__file__).parents[1] / "data"

# Erodes and then goes on as a rigid body; erodes to a standstill; is rigid throughout.
CASES = {
    "breakdown": ROD,
    "smoothed": {**ROD, "smoothing": 1.0},
    "standstill": {**ROD, "target_yield_limit": 5e9},
    "rigid": {**ROD, "impact_velocity": 50.0},
}
# Promised of the curves with the default tolerance, of their largest values.
PROMISED = 1e-6


def inputs(*cases):
    return {name: np.array([case[name] for case in cases]) for name in ROD}


@pytest.mark.parametrize("case", CASES)
def test_curves_are_those_of_one_rod_followed_carefully(case):
    known = trajectory(make_rod(CASES[case]), tolerance=1e-12)
    u, v, L, s = known.nose_velocity, known.tail_velocity, known.length, known.plastic_extent
    # Rounding may put the coordinate of rest behind the end of the curves.
    expected = np.stack([u, v, L, s, known.depth, known.time])[:, :-1]
    largest = np.maximum(np.abs(expected).max(axis=1, keepdims=True), 1e-3)
    rods = make_rods(inputs(CASES[case]))
    curves = [
        Curves.make_empty(Along.DEPTH, known.depth, 1),
        Curves.make_empty(Along.TIME, known.time, 1),
    ]
    end = follow_erosion(rods, curves, WalkerAndersonTrajectory().tolerance)
    motion = RigidMotion.after(rods, end)
    for each in curves:
        each.add_rigid_motion(motion, rods, end)
        error = np.abs(each.values[:, 0, :-1] - expected) / largest
        assert error.max() <= PROMISED, each.along
    assert motion.rest_depth == pytest.approx(known.depth[-1], rel=PROMISED / 10)
    assert motion.rest_time == pytest.approx(known.time[-1], rel=PROMISED / 10)


def test_known_values_of_the_nominal_rod():
    model = WalkerAndersonTrajectory(along="depth", depth_limit="0.4 m", depths=9)
    found = Evaluator(model)(inputs(ROD)).outputs
    depths = np.array(model.output("time_at_depth").dims[0].values)
    for depth, values in KNOWN_POINTS.items():
        at = int(np.argmin(np.abs(depths - depth)))
        own = [found[f"{name}_at_depth"][0, at] for name in COURSE]
        # The values have five digits at least.
        assert own == pytest.approx(values, rel=1.1e-5), depth


def test_reference_cases_end_where_they_are_known_to():
    with (DATA / "walker_anderson_cases.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    cases = [{name: float(row[name]) for name in ROD} for row in rows]
    model = WalkerAndersonTrajectory(duration="20 ms", times=20_001)
    found = Evaluator(model)(inputs(*cases)).outputs
    depth = [float(row["penetration_depth"]) for row in rows]
    residue = [float(row["projectile_residue"]) for row in rows]
    assert found["penetration_depth"] == pytest.approx(depth, rel=1e-8)
    # The shortest length of a rod is its last one; at a standstill its nose has 1 µs at most left.
    assert np.nanmin(found["length"], axis=1) == pytest.approx(residue, rel=1e-3)
    breakdown = np.array([row["termination"] == "v=u" for row in rows])
    assert np.nanmin(found["length"], axis=1)[breakdown] == pytest.approx(
        np.array(residue)[breakdown], rel=1e-7
    )


def test_curves_end_where_the_rod_rests():
    model = WalkerAndersonTrajectory(along="time and depth")
    results = Evaluator(model)(inputs(*CASES.values()))
    assert results.status.tolist() == [Status.OK] * len(CASES)
    rests = {"elapsed_time": "rest_time", "target_depth": "penetration_depth"}
    curves = [output for output in model.outputs if output.dims]
    assert len(curves) == 10
    for output in curves:
        (dimension,) = output.dims
        rest = results.outputs[rests[dimension.name]][:, np.newaxis]
        is_past = np.array(dimension.values) > rest
        assert is_past.any()
        assert np.array_equal(np.isnan(results.outputs[output.name]), is_past), output.name


def test_a_rod_that_goes_deeper_than_the_last_depth_has_no_end():
    model = WalkerAndersonTrajectory(along="depth", depth_limit="20 cm", depths=5)
    found = Evaluator(model)(inputs(ROD)).outputs
    assert found["penetration_depth"] > 0.2
    assert np.isfinite(found["nose_velocity_at_depth"]).all()


@pytest.mark.parametrize("kind", [WalkerAndersonTrajectory, RigidPenetrationTrajectory])
def test_they_begin_at_impact(kind):
    model = kind(along="time and depth", times=2, depths=2)
    found = Evaluator(model)(inputs(ROD)).outputs
    start = {name: values[0, 0] for name, values in found.items() if values.ndim == 2}
    at_surface = {"nose_velocity": 1400.0, "tail_velocity": 1400.0, "length": 0.16}
    at_surface["plastic_extent"] = 0.0
    by_depth = {f"{name}_at_depth": value for name, value in at_surface.items()}
    assert start == {**at_surface, "nose_depth": 0.0, **by_depth, "time_at_depth": 0.0}


def test_a_rigid_rod_moves_as_its_closed_form_says():
    known = RigidPenetration().trajectory(ROD)
    rest = float(known["penetration_depth"][-1])
    model = RigidPenetrationTrajectory(
        along="depth", depth_limit=rest, depths=known.sizes["penetration_depth"]
    )
    found = Evaluator(model)(inputs(ROD)).outputs
    assert found["penetration_depth"] == pytest.approx(rest)
    for name in known.data_vars:
        curve = found[f"{name}_at_depth"][0, :-1]
        assert curve == pytest.approx(known[name].values[:-1], rel=1e-9), name


def test_a_rod_too_slow_to_erode_is_rigid():
    slow = inputs({**ROD, "impact_velocity": 50.0})
    eroding = Evaluator(WalkerAndersonTrajectory())(slow).outputs
    rigid = Evaluator(RigidPenetrationTrajectory())(slow).outputs
    for name, values in eroding.items():
        np.testing.assert_array_equal(values, rigid[name])


def test_what_overflows_is_not_finite():
    case = {**ROD, "projectile_length": 1e300, "target_yield_limit": 1e-300}
    results = Evaluator(WalkerAndersonTrajectory(times=2))(inputs(case))
    assert results.status.tolist() == [Status.NOT_FINITE]
    assert results.reasons == {0: "penetration_depth is inf"}


@pytest.mark.processor
def test_a_run_has_the_same_bits_alone():
    # Enough places that a search among them needs more secants for one than for another.
    model = WalkerAndersonTrajectory(along="time and depth", times=41, depths=41)
    limits = 4e8 * np.linspace(0.8, 1.2, 12)
    cases = [{**ROD, "target_yield_limit": limit} for limit in limits]
    together = model.evaluate(inputs(*cases)).outputs
    for run, case in enumerate(cases):
        for name, values in model.evaluate(inputs(case)).outputs.items():
            np.testing.assert_array_equal(values[0], together[name][run], err_msg=name)


@pytest.mark.parametrize("kind", [WalkerAndersonTrajectory, RigidPenetrationTrajectory])
def test_they_meet_the_contract_of_models(kind):
    check_model(kind(along="time and depth", times=5, depths=5), inputs(ROD, CASES["standstill"]))


def test_settings_decide_its_identity():
    one, other = WalkerAndersonTrajectory(), WalkerAndersonTrajectory(duration="1 ms")
    assert one.identity()["duration"] == "0.002"
    assert other.identity() == {**one.identity(), "duration": "0.001"}
    assert other.outputs != one.outputs


def test_an_unknown_coordinate_is_refused():
    with pytest.raises(SettingsError) as refused:
        WalkerAndersonTrajectory(along="width")
    assert 'one of "time", "depth", "time and depth"' in str(refused.value)
