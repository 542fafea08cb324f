"""What holds of every built-in model, and known answers of each."""

import numpy as np
import pytest
from nominal_rod import COURSE, KNOWN_POINTS, ROD

from uqpen.core.errors import TrajectoryError
from uqpen.core.lookup import resolve
from uqpen.core.model import Model
from uqpen.core.status import Status
from uqpen.core.units import si_unit
from uqpen.execution import Evaluator
from uqpen.models import MODELS
from uqpen.models.known_functions import Campbell, Ishigami
from uqpen.models.rod_and_target import OUTPUTS, Termination
from uqpen.models.rod_models import AlekseevskiiTate, HydrodynamicLimit, RigidPenetration
from uqpen.models.walker_anderson import WalkerAnderson

ROD_MODELS = [WalkerAnderson(), RigidPenetration(), AlekseevskiiTate(), HydrodynamicLimit()]


def results(model, **changes):
    given = {name: value for name, value in {**ROD, **changes}.items() if value is not None}
    arrays = np.broadcast_arrays(*(np.atleast_1d(value) for value in given.values()))
    return Evaluator(model)(
        dict(zip(given, (array.astype(float) for array in arrays), strict=True))
    )


def without(name, **more):
    return {**{key: value for key, value in ROD.items() if key != name}, **more}


@pytest.mark.parametrize("name", MODELS)
def test_every_model_has_one_name_coherent_units_and_a_domain(name):
    model = resolve(MODELS[name])()
    assert isinstance(model, Model)
    assert model.name == model.identity()["name"] == name
    variables = (*model.inputs, *model.outputs)
    assert len({variable.name for variable in variables}) == len(variables)
    for variable in variables:
        assert si_unit(variable.unit) == variable.unit
        assert si_unit(variable.preferred_unit) == variable.unit
    # What is not a number is inadmissible.
    inputs = {variable.name: np.array([np.nan, np.inf]) for variable in model.inputs}
    assert (Evaluator(model)(inputs).status == Status.INADMISSIBLE).all()


@pytest.mark.parametrize("model", ROD_MODELS, ids=lambda model: model.name)
class TestRodModels:
    @pytest.mark.parametrize(
        ("changes", "reason"),
        [
            ({"plasticity_radius": 0.017}, "plasticity_radius > crater_radius"),
            ({"plasticity_radius": 0.01}, "plasticity_radius > crater_radius"),
            ({"plasticity_radius": -0.1}, "plasticity_radius > 0"),
            ({"crater_radius": 0.0}, "crater_radius > 0"),
            ({"projectile_density": -1.0}, "projectile_density > 0"),
            ({"target_yield_limit": 0.0}, "target_yield_limit > 0"),
            ({"impact_velocity": 0.0}, "impact_velocity > 0"),
            ({"smoothing": 2.0}, "smoothing >= 0 and < 2"),
            ({"smoothing": -0.1}, "smoothing >= 0 and < 2"),
        ],
    )
    def test_inputs_outside_the_domain_are_inadmissible(self, model, changes, reason):
        found = results(model, **changes)
        assert found.status.tolist() == [Status.INADMISSIBLE]
        assert found.reasons == {0: reason}

    def test_an_inadmissible_run_harms_no_other(self, model):
        radii = [0.1, 0.01, 0.1]
        found = results(model, plasticity_radius=radii)
        depth = found.outputs["penetration_depth"]
        assert found.status.tolist() == [0, Status.INADMISSIBLE, 0]
        assert depth[0] == depth[2] > 0

    def test_a_modulus_that_disagrees_is_inadmissible(self, model):
        found = results(model, projectile_young_modulus=[165e9, 170e9])
        assert found.status.tolist() == [0, Status.INADMISSIBLE]
        assert "within 1 %" in found.reasons[1]

    def test_an_input_is_missing_unless_an_alternative_is_given(self, model):
        assert list(model.missing_inputs(without("projectile_sound_speed"))) == [
            "projectile_sound_speed"
        ]
        modulus = without("projectile_sound_speed", projectile_young_modulus=165e9)
        assert list(model.missing_inputs(modulus)) == []
        assert list(model.missing_inputs(without("smoothing"))) == []


def test_a_young_modulus_stands_for_the_sound_speed():
    inputs = without("projectile_sound_speed", projectile_young_modulus=17_500.0 * 3071.0**2)
    arrays = {name: np.array([value]) for name, value in inputs.items()}
    by_modulus = Evaluator(WalkerAnderson())(arrays).outputs["penetration_depth"]
    by_speed = results(WalkerAnderson()).outputs["penetration_depth"]
    # The root of the product is the speed but for its last bit.
    np.testing.assert_allclose(by_modulus, by_speed, rtol=1e-14)


def test_the_rigid_rod_goes_deeper_and_keeps_its_length():
    outputs = results(RigidPenetration()).outputs
    assert outputs["penetration_depth"][0] == pytest.approx(1.02885, abs=5e-6)
    assert outputs["projectile_residue"][0] == 0.16
    assert outputs["erosion_end_depth"][0] == 0.0
    assert outputs["termination"][0] == Termination.RIGID


def test_the_integrator_numbers_terminations_as_the_output_does():
    from uqpen.models import rod_kernel

    assert rod_kernel.CAUGHT_UP == Termination.BREAKDOWN
    assert rod_kernel.AT_REST == Termination.STANDSTILL
    assert [category.label for category in OUTPUTS[3].categories] == ["v = u", "u = 0", "rigid"]


def test_the_course_of_a_run_is_a_dataset_against_depth():
    course = WalkerAnderson().trajectory(ROD)
    assert set(course.data_vars) == set(COURSE)
    at = course.interp(penetration_depth=list(KNOWN_POINTS))
    for name, known in zip(COURSE, zip(*KNOWN_POINTS.values(), strict=True), strict=True):
        # The grid of 401 depths is interpolated linearly here; that costs up to 1e-4, and more
        # where the plastic extent bends.
        error = 1e-3 if name == "plastic_extent" else 1e-4
        np.testing.assert_allclose(at[name], known, rtol=error, err_msg=name)


def test_the_course_of_a_rigid_rod_ends_where_the_run_does():
    model = RigidPenetration()
    course = model.trajectory(ROD)
    assert set(course) == set(WalkerAnderson().trajectory(ROD))
    depth = course["penetration_depth"].values
    run = model.evaluate({name: np.array([value]) for name, value in ROD.items()})
    assert depth[[0, -1]].tolist() == [0, run.outputs["penetration_depth"][0]]
    assert course["nose_velocity"].values[0] == pytest.approx(ROD["impact_velocity"])
    assert course["nose_velocity"].values[-1] == 0
    np.testing.assert_array_equal(course["nose_velocity"], course["tail_velocity"])
    assert set(course["length"].values) == {ROD["projectile_length"]}
    # dz = u dt, by the trapezoidal rule, of which the square root at the end spoils the last bit.
    time, velocity = course["time"].values, course["nose_velocity"].values
    passed = np.concatenate([[0], np.cumsum(np.diff(time) * (velocity[1:] + velocity[:-1]) / 2)])
    np.testing.assert_allclose(passed, depth, atol=1e-5)


def test_a_course_of_impossible_size_is_refused():
    with pytest.raises(TrajectoryError, match="too large or too small"):
        RigidPenetration().trajectory(ROD | {"impact_velocity": 1e200})


def test_the_ishigami_function_has_its_known_values():
    points = [[np.pi / 2, 0.0, 1.0], [0.0, np.pi / 2, 2.0]]
    inputs = dict(zip(("x1", "x2", "x3"), np.transpose(points), strict=True))
    np.testing.assert_allclose(Ishigami().evaluate(inputs).outputs["y"], [1.1, 7.0], rtol=1e-15)


def test_campbells_curve_has_its_known_values():
    # Without x1 and x3 the peak has no width; with x1 = 1 its exponent at -90, 0 and 90 is known.
    inputs = {"x1": [0.0, 1.0], "x2": [1.0, 0.0], "x3": [0.0, 2.0], "x4": [2.0, 0.5]}
    values = Campbell().evaluate({k: np.array(v) for k, v in inputs.items()}).outputs["y"]
    assert values.shape == (2, 181)
    np.testing.assert_array_equal(values[0], 13.0)
    peak, growth = np.exp(-(90**2) / 64), 0.5 * np.exp(0.18)
    exact = [10 + peak + 0.25 / growth, 11.5, 10 + peak + growth]
    np.testing.assert_allclose(values[1, [0, 90, 180]], exact, rtol=1e-14)


def test_settings_are_part_of_what_a_model_is():
    assert WalkerAnderson(1e-6).identity() != WalkerAnderson(1e-8).identity()
    assert Ishigami(a=7).identity() != Ishigami(a=6).identity()
