"""The Alekseevskii-Tate rod and the hydrodynamic limit, against integrations of their own."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from nominal_rod import ROD
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from uqpen.execution import Evaluator
from uqpen.models.rod_and_target import Termination
from uqpen.models.rod_models import AlekseevskiiTate, HydrodynamicLimit

STRONG_ROD = {"projectile_yield_limit": 3e9}
STRONG_TARGET = {"target_yield_limit": 800e6}


def outputs(model, **changes):
    """Outputs of the nominal rod with changes, one of which may be a list."""
    arrays = np.broadcast_arrays(*map(np.atleast_1d, (ROD | changes).values()))
    found = Evaluator(model)(
        {name: array.astype(float) for name, array in zip(ROD, arrays, strict=True)}
    )
    assert not found.status.any()
    return found.outputs


def target_resistance(rod):
    S, R = rod["plasticity_radius"], rod["crater_radius"]
    return 7 / 3 * rod["target_yield_limit"] * np.log(S / R)


def imbalance(u, v, rod):
    """The rod's pressure on the interface less the target's, Pa."""
    pushing = rod["projectile_density"] * (v - u) ** 2 / 2 + rod["projectile_yield_limit"]
    return pushing - rod["target_density"] * u**2 / 2 - target_resistance(rod)


def nose_velocity(v, rod):
    """Find the nose's velocity from the balance of pressures, not by a formula."""
    if imbalance(0.0, v, rod) <= 0:
        return 0.0
    if imbalance(v, v, rod) >= 0:
        return v
    return brentq(imbalance, 0.0, v, args=(v, rod), xtol=1e-15 * v, rtol=1e-14)


def integrated(rod):
    """Integrate the equations over the tail's velocity: depth and length at the end."""
    density, strength = rod["projectile_density"], rod["projectile_yield_limit"]
    target_density, resistance = rod["target_density"], target_resistance(rod)
    excess = resistance - strength
    end = np.sqrt(2 * abs(excess) / (density if excess > 0 else target_density))

    def slopes(v, state):
        u, time = nose_velocity(v, rod), -density * state[0] / strength
        return [(u - v) * time, u * time]

    velocities = rod["impact_velocity"], min(end, rod["impact_velocity"])
    at_impact = [rod["projectile_length"], 0.0]
    found = solve_ivp(slopes, velocities, at_impact, method="DOP853", rtol=1e-12, atol=1e-16)
    L, z = found.y[:, -1]
    if excess > 0:
        return z, L
    rigid, _ = quad(
        lambda v: density * L * v / (target_density * v**2 / 2 + resistance),
        *(0.0, velocities[1]),
        epsrel=1e-12,
    )
    return z + rigid, L


def test_the_nominal_rod_has_its_known_depth_and_residue():
    found = outputs(AlekseevskiiTate())
    assert found["penetration_depth"][0] == pytest.approx(0.397869, abs=5e-7)
    assert found["projectile_residue"][0] == pytest.approx(9.03713e-3, abs=5e-9)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(
    density=st.floats(2e3, 2e4),
    target_density=st.floats(2e3, 2e4),
    strength=st.floats(0.2e9, 4e9),
    target_strength=st.floats(0.1e9, 1e9),
    velocity=st.floats(100, 4000),
)
@example(17_500.0, 2500.0, 1.65e9, 400e6, 1400.0)
@example(7_800.0, 7_800.0, 1e9, 100e6, 1400.0)  # equal densities, where the textbook's u is 0/0
def test_depth_and_residue_agree_with_an_integration(
    density, target_density, strength, target_strength, velocity
):
    changes = {
        "projectile_density": density,
        "target_density": target_density,
        "projectile_yield_limit": strength,
        "target_yield_limit": target_strength,
        "impact_velocity": velocity,
    }
    depth, length = integrated(ROD | changes)
    found = outputs(AlekseevskiiTate(), **changes)
    assert found["penetration_depth"][0] == pytest.approx(depth, rel=1e-9, abs=1e-12)
    assert found["projectile_residue"][0] == pytest.approx(length, rel=1e-9, abs=1e-12)


def test_a_rod_stronger_than_its_target_ends_rigid():
    found = outputs(AlekseevskiiTate(), **STRONG_ROD)
    rod = ROD | STRONG_ROD
    assert found["termination"][0] == Termination.BREAKDOWN
    # The rest goes on as a rigid body of its length from the velocity at which erosion ends.
    resistance = target_resistance(rod)
    speed = np.sqrt(2 * (rod["projectile_yield_limit"] - resistance) / rod["target_density"])
    added = (7 * found["projectile_residue"][0]) * np.log1p(1250.0 * speed**2 / resistance)
    end = found["erosion_end_depth"][0]
    assert found["penetration_depth"][0] == pytest.approx(end + added, rel=1e-12)
    # A rod that arrives with no more than this velocity is rigid from the start.
    slow = outputs(AlekseevskiiTate(), **STRONG_ROD, impact_velocity=speed)
    whole = 7 * 0.16 * np.log1p(1250.0 * speed**2 / resistance)
    assert slow["penetration_depth"][0] == pytest.approx(whole, rel=1e-12)
    assert slow["projectile_residue"][0] == 0.16
    assert slow["erosion_end_depth"][0] == 0.0
    assert slow["termination"][0] == Termination.RIGID


def test_a_target_too_strong_for_a_slow_rod_is_not_penetrated():
    slowest = np.sqrt(2 * (target_resistance(ROD | STRONG_TARGET) - 1.65e9) / 17_500.0)
    speeds = [0.5 * slowest, 0.999 * slowest, 1.001 * slowest]
    found = outputs(AlekseevskiiTate(), **STRONG_TARGET, impact_velocity=speeds)
    assert (found["termination"] == Termination.STANDSTILL).all()
    assert found["penetration_depth"][:2].tolist() == [0, 0]
    assert found["projectile_residue"][:2].tolist() == [0.16, 0.16]
    assert 0 < found["penetration_depth"][2] < 1e-4


def test_a_resistance_equal_to_the_rods_strength_is_no_exception():
    limit = 1.65e9 / (7 / 3 * np.log(0.1 / 0.017))
    near = [limit * (1 - 1e-12), limit, limit * (1 + 1e-12)]
    depths = outputs(AlekseevskiiTate(), target_yield_limit=near)["penetration_depth"]
    np.testing.assert_allclose(depths, depths[1], rtol=1e-9)


def test_without_strength_depth_is_the_hydrodynamic_limit():
    limit = outputs(HydrodynamicLimit())
    assert limit["penetration_depth"][0] == pytest.approx(0.42332, abs=5e-6)
    assert limit["projectile_residue"][0] == 0.0
    weak = {"projectile_yield_limit": 1e4, "target_yield_limit": 1e4}
    found = outputs(AlekseevskiiTate(), **weak)
    depth = limit["penetration_depth"][0]
    assert found["penetration_depth"][0] == pytest.approx(depth, rel=1e-4)
    assert found["projectile_residue"][0] == pytest.approx(0.0, abs=1e-12)


@settings(max_examples=10, deadline=None, derandomize=True)
@given(length=st.floats(0.01, 100), stress=st.floats(0.01, 100))
def test_lengths_scale_together_and_so_do_densities_and_stresses(length, stress):
    scale = dict.fromkeys(("projectile_length", "plasticity_radius", "crater_radius"), length)
    for side in ("projectile", "target"):
        scale |= dict.fromkeys((f"{side}_density", f"{side}_yield_limit"), stress)
    for model in (AlekseevskiiTate(), HydrodynamicLimit()):
        found = outputs(model, **{name: ROD[name] * factor for name, factor in scale.items()})
        for name in ("penetration_depth", "projectile_residue"):
            expected = outputs(model)[name][0] * length
            assert found[name][0] == pytest.approx(expected, rel=1e-11)
