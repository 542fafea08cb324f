"""When an eroding rod becomes rigid: each criterion against an integration of its own."""

import numpy as np
import pytest
from nominal_rod import ROD
from scipy.integrate import quad, solve_ivp

from uqpen.core.errors import SettingsError
from uqpen.models.rod_and_target import OUTPUTS, Termination
from uqpen.models.rod_models import AlekseevskiiTate
from uqpen.models.rod_trajectories import WalkerAndersonTrajectory
from uqpen.models.walker_anderson import WalkerAnderson
from uqpen.models.walker_anderson_drucker_prager import WalkerAndersonDruckerPrager
from uqpen.testing import check_model

VELOCITY, STRESS = "rigid-velocity", "rigid-stress"
# Of the concrete study, as 10 % and 25 % of two inputs move it to either end.
SOME = {"target_yield_limit": [340e6, 400e6, 460e6], "plasticity_radius": [0.07, 0.1, 0.13]}
# Reached while the tail is faster, at each smoothing and on either side of the target's strength.
CASES = [
    (STRESS, 1.0, {}),
    (STRESS, 1.0, {"smoothing": 1.0, "projectile_yield_limit": 2.5e9}),
    (STRESS, 1.7, {}),
    (VELOCITY, 1.7, {}),
    (VELOCITY, 1.3, {"smoothing": 0.5, "projectile_yield_limit": 2e9}),
]


def outputs(model, **changes):
    """Outputs of the nominal rod with changes, some of which may be lists."""
    arrays = np.broadcast_arrays(*map(np.atleast_1d, (ROD | changes).values()))
    results = model.evaluate({n: a.astype(float) for n, a in zip(ROD, arrays, strict=True)})
    assert not results.status.any()
    return results.outputs


def integrated(criterion, factor, rod):
    """Integrate u, v, L and z, and then the rigid body with the momentum of rod and target."""
    S, R, eps, Yp = (rod[n] for n in ("plasticity_radius", "crater_radius", "smoothing",
                                      "projectile_yield_limit"))  # fmt: skip
    density, target, c = (rod[n] for n in ("projectile_density", "target_density",
                                           "projectile_sound_speed"))  # fmt: skip
    resistance = 7 / 3 * rod["target_yield_limit"] * np.log(S / R)
    in_target = target * R * (S - R) / (S + R)
    scale = R * (1 - R**2 / S**2) / (2 - eps)

    def momentum(u, v, L):  # (2.5) and (2.7)
        return density * (v * L + scale * (v / u - 1) * (u - v) / (2 + eps)) + in_target * u

    def slopes(_, state):
        u, v, L, _ = state
        s, ds_du, ds_dv = scale * (v / u - 1), -scale * v / u**2, scale / u
        # The rate of the momentum above, and (2.17), are linear in the rates of u and v.
        force = -density * (v**2 - u**2) / 2 - target * u**2 / 2 - resistance
        of_u = density * ((u - v) * ds_du + s) / (2 + eps) + in_target
        of_v = density * (L + ((u - v) * ds_dv - s) / (2 + eps))
        brake = Yp / (density * c * (L - s))
        rates = np.linalg.solve(
            [[of_u, of_v], [brake * ds_du, 1 + brake * ds_dv]],
            [force - density * v * (u - v), -brake * (c - u + v)],
        )
        return [*rates, u - v, u]

    def left(_, state):
        u, v, L, _ = state
        if criterion == VELOCITY:
            return target * v**2 / 2 + resistance - factor * Yp
        V = momentum(u, v, L) / (density * L + in_target)
        load = (target * V**2 / 2 + resistance) * density * L / (density * L + in_target)
        return load - factor * Yp

    left.terminal = True  # type: ignore[attr-defined]
    start = [rod["impact_velocity"]] * 2 + [rod["projectile_length"], 0.0]
    found = solve_ivp(slopes, (0, 1e-2), start, "DOP853", events=left, rtol=1e-11, atol=1e-12)
    u, v, L, z = found.y_events[0][0]
    assert v > u > 0
    mass = density * L + in_target
    further, _ = quad(
        lambda V: mass * V / (target * V**2 / 2 + resistance),
        *(0.0, momentum(u, v, L) / mass),
        epsrel=1e-12,
    )
    return z + further, L, z


@pytest.mark.parametrize(("criterion", "factor", "changes"), CASES)
def test_a_rod_ends_as_an_integration_in_other_variables_has_it(criterion, factor, changes):
    known = integrated(criterion, factor, ROD | changes)
    model = WalkerAnderson(transition=criterion, strength_factor=factor)
    found = {name: values.item() for name, values in outputs(model, **changes).items()}
    assert found.pop("termination") == Termination.STRENGTH
    assert list(found.values()) == pytest.approx(known, rel=1e-8)
    # The trajectories end there too, whichever way they are followed.
    course = model.trajectory(ROD | changes)
    ends = course["penetration_depth"].values[-1], course["length"].values[-1]
    assert ends == pytest.approx(known[:2], rel=1e-8)
    curves = WalkerAndersonTrajectory(
        transition=criterion, strength_factor=factor, along="depth", depths=3,
        depth_limit=1.001 * known[2],
    )  # fmt: skip
    curve = outputs(curves, **changes)
    assert curve["penetration_depth"][0] == pytest.approx(known[0], rel=1e-7)
    # Just behind the end of erosion all of the rod moves at one velocity, and nothing flows.
    u, v, s = (curve[f"{name}_at_depth"][0] for name in ("nose_velocity", "tail_velocity",
                                                         "plastic_extent"))  # fmt: skip
    assert (u[1] < v[1], u[2] == v[2], s[1] > 0, s[2]) == (True, True, True, 0)


def test_for_a_narrow_crater_all_criteria_are_those_of_alekseevskii_and_tate():
    # Waves are at once through the rod; the target's inertia and plastic flow in the rod go with
    # the radii, and so does the gap to the model that has neither.
    strong = {"projectile_yield_limit": 2.5e9, "projectile_sound_speed": 1e8}
    known = outputs(AlekseevskiiTate(), **strong)
    models = [WalkerAnderson(), *(WalkerAnderson(transition=each) for each in (VELOCITY, STRESS))]
    gaps = []
    for scale in (0.3, 0.1):
        narrow = strong | {n: scale * ROD[n] for n in ("plasticity_radius", "crater_radius")}
        found = [outputs(model, **narrow) for model in models]
        for name in ("penetration_depth", "projectile_residue"):
            ratios = np.array([each[name][0] / known[name][0] for each in found])
            gaps.append(ratios[0] - 1)
            # What a criterion changes goes with their square.
            assert np.ptp(ratios) < 3e-3 * scale**2, name
    assert gaps[:2] == pytest.approx(3 * np.array(gaps[2:]), rel=0.01)
    assert 0 < gaps[2] < 5e-3


def test_the_condition_of_the_rigid_stress_is_the_one_by_which_erosion_begins():
    density, target, L, Yp = 17_500.0, 2500.0, 0.16, 2.5e9
    resistance = 7 / 3 * 400e6 * np.log(0.1 / 0.017)
    in_target = target * 0.017 * 0.083 / 0.117
    slowest = np.sqrt(2 / target * (Yp * (1 + in_target / (density * L)) - resistance))
    speeds = {"impact_velocity": [0.99 * slowest, 1.01 * slowest], "projectile_yield_limit": Yp}
    for model in (WalkerAnderson(), WalkerAnderson(transition=STRESS)):
        is_rigid = outputs(model, **speeds)["termination"] == Termination.RIGID
        assert is_rigid.tolist() == [True, False]
    # A rod of Alekseevskii and Tate is rigid below a velocity that is a little lower.
    rigid = np.sqrt(2 / target * (1.3 * Yp - resistance))
    model = WalkerAnderson(transition=VELOCITY, strength_factor=1.3)
    speeds["impact_velocity"] = [0.99 * rigid, 1.01 * rigid]
    found = outputs(model, **speeds)
    assert found["termination"].tolist() == [Termination.RIGID, Termination.STRENGTH]
    assert found["projectile_residue"] == pytest.approx(L, rel=2e-2)


@pytest.mark.parametrize("criterion", [VELOCITY, STRESS])
def test_erosion_ends_sooner_or_as_it_did(criterion):
    default = outputs(WalkerAnderson(), **SOME)
    # Rods too weak to become rigid end as those of the compiled integration.
    weak = outputs(WalkerAnderson(transition=criterion, strength_factor=1e-3), **SOME)
    for name, values in default.items():
        assert weak[name] == pytest.approx(values, rel=1e-6), name
    depth = default["erosion_end_depth"]
    for factor in (1.0, 1.2, 1.7):
        model = WalkerAnderson(transition=criterion, strength_factor=factor)
        found = outputs(model, **SOME)
        is_sooner = found["termination"] == Termination.STRENGTH
        assert (found["erosion_end_depth"] < depth)[is_sooner].all()
        assert found["erosion_end_depth"][~is_sooner] == pytest.approx(depth[~is_sooner], rel=1e-6)
        depth = found["erosion_end_depth"]
    assert is_sooner.all()


def test_a_target_of_drucker_and_prager_takes_the_setting():
    setting = {"transition": STRESS, "strength_factor": 1.7}
    target = {"zero_pressure_yield_limit": 400e6, "yield_limit_slope": 0.6}
    model = WalkerAndersonDruckerPrager(**setting)
    found = model.evaluate({name: np.array([value]) for name, value in (ROD | target).items()})
    for name, values in outputs(WalkerAnderson(**setting)).items():
        assert found.outputs[name] == pytest.approx(values, rel=1e-9), name
    assert model.outputs == WalkerAnderson(**setting).outputs


def test_the_ending_of_its_own_is_an_output_only_where_it_can_occur():
    labels = lambda model: [kind.label for kind in model.outputs[3].categories]  # noqa: E731
    assert WalkerAnderson().outputs == OUTPUTS
    assert labels(WalkerAnderson()) == ["v = u", "u = 0", "rigid"]
    assert labels(WalkerAnderson(transition=STRESS)) == ["v = u", "u = 0", "rigid", "v > u"]
    assert WalkerAnderson(transition=STRESS).identity()["transition"] == "'rigid-stress'"


@pytest.mark.processor
@pytest.mark.parametrize("criterion", [VELOCITY, STRESS])
def test_a_run_is_that_of_any_batch(criterion):
    arrays = np.broadcast_arrays(*map(np.atleast_1d, (ROD | SOME).values()))
    batch = {name: a.astype(float) for name, a in zip(ROD, arrays, strict=True)}
    check_model(WalkerAnderson(transition=criterion, strength_factor=1.2), batch)


@pytest.mark.parametrize(
    "kind", [WalkerAnderson, WalkerAndersonDruckerPrager, WalkerAndersonTrajectory]
)
def test_settings_without_an_effect_are_refused(kind):
    with pytest.raises(SettingsError) as refused:
        kind(strength_factor=1.7)
    assert refused.value.problems[0].path == ("strength_factor",)
    assert 'or transition = "rigid-velocity" or "rigid-stress"' in str(refused.value)
    with pytest.raises(SettingsError, match="equal-velocities"):
        kind(transition="never")
