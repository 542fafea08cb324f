"""A target whose yield limit depends on pressure, against closed forms and integrations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nominal_rod import ROD
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from uqpen.core.status import Status
from uqpen.execution import Evaluator
from uqpen.models.walker_anderson import WalkerAnderson
from uqpen.models.walker_anderson_drucker_prager import (
    WalkerAndersonDruckerPrager,
    effective_yield_limit,
    plastic_extent,
)

TARGET = {"zero_pressure_yield_limit": 100e6, "yield_limit_slope": 0.6}


def results(model, given, **changes):
    given = given | changes  # type: ignore[assignment]
    arrays = np.broadcast_arrays(*map(np.atleast_1d, given.values()))
    return Evaluator(model)(
        {name: array.astype(float) for name, array in zip(given, arrays, strict=True)}
    )


def outputs(model, given, **changes):
    found = results(model, given, **changes)
    assert not found.status.any()
    return found.outputs


def integrated_yield_limit(logarithm, lowest, highest, k):
    """Integrate the balance of momentum from the outer boundary inwards, at rest."""

    def slopes(q, state, slope):
        Y = min(lowest + k * state[0], highest)
        return [7 / 3 * Y / (1 + 2 / 3 * slope), Y]

    def plateau(q, state, slope):
        return lowest + k * state[0] - highest

    plateau.terminal = True  # type: ignore[attr-defined]
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12 * lowest}
    rise = solve_ivp(slopes, (0, logarithm), [0.0, 0.0], events=plateau, args=(k,), **options)
    flat = solve_ivp(slopes, (rise.t[-1], logarithm), rise.y[:, -1], args=(0.0,), **options)
    return flat.y[1, -1] / logarithm


@settings(max_examples=15, deadline=None, derandomize=True)
@given(logarithm=st.floats(0.1, 4), ratio=st.floats(1.01, 20), slope=st.floats(0.01, 3))
def test_the_resistance_agrees_with_an_integration(logarithm, ratio, slope):
    arguments = (logarithm, 50e6, 50e6 * ratio, slope)
    found = effective_yield_limit(*map(np.atleast_1d, arguments))[0]
    assert found == pytest.approx(integrated_yield_limit(*arguments), rel=1e-9)
    assert 50e6 <= found <= 50e6 * ratio


@settings(max_examples=15, deadline=None, derandomize=True)
@given(share=st.floats(1e-6, 5.9))
def test_the_plastic_zone_gives_its_volume_to_the_cavity(share):
    found = plastic_extent(np.array([2.0]), np.array([share]), np.array([1.0]))[0]
    # The boundary at S was at S (1 - Y0/6G) before the cavity of radius 2 was opened.
    volume = lambda S: S**3 - (S * (1 - share / 6)) ** 3 - 2.0**3  # noqa: E731
    assert found == pytest.approx(brentq(volume, 2.0, 1e4, xtol=1e-13), rel=1e-9)
    assert found > 2


def test_a_weak_target_flows_as_far_as_the_theory_of_indentation_has_it():
    found = plastic_extent(np.array([1.0]), np.array([1e6]), np.array([30e9]))[0]
    assert found**3 == pytest.approx(2 * 30e9 / 1e6, rel=1e-4)


@pytest.mark.parametrize(
    ("target", "limit"),
    [
        ({"zero_pressure_yield_limit": 400e6, "yield_limit_slope": 0.6}, 400e6),
        ({"zero_pressure_yield_limit": 300e6, "yield_limit_slope": 0.0}, 300e6),
        ({"zero_pressure_yield_limit": 300e6, "yield_limit_slope": 1e-13}, 300e6),
    ],
)
def test_a_constant_limit_gives_the_rod_as_it_was(target, limit):
    found = outputs(WalkerAndersonDruckerPrager(), ROD | target)
    expected = outputs(WalkerAnderson(), ROD, target_yield_limit=limit)
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-9)


def test_a_shear_modulus_decides_how_far_the_target_flows():
    found = outputs(WalkerAndersonDruckerPrager(), ROD | TARGET, target_shear_modulus=14e9)
    S = plastic_extent(np.array([0.017]), np.array([100e6]), np.array([14e9]))[0]
    given = outputs(WalkerAndersonDruckerPrager(), ROD | TARGET, plasticity_radius=S)
    np.testing.assert_array_equal(found["penetration_depth"], given["penetration_depth"])
    without = {name: value for name, value in ROD.items() if name != "plasticity_radius"}
    alone = outputs(WalkerAndersonDruckerPrager(), without | TARGET, target_shear_modulus=14e9)
    np.testing.assert_array_equal(found["penetration_depth"], alone["penetration_depth"])


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"zero_pressure_yield_limit": 401e6}, "zero_pressure_yield_limit <= target_yield_limit"),
        ({"target_shear_modulus": 16e6}, "zero_pressure_yield_limit < 6 target_shear_modulus"),
        ({"yield_limit_slope": -0.1}, "yield_limit_slope >= 0"),
        ({"plasticity_radius": 0.01}, "plasticity_radius > crater_radius"),
    ],
)
def test_an_impossible_target_is_inadmissible(changes, reason):
    found = results(WalkerAndersonDruckerPrager(), ROD | TARGET, **changes)
    assert found.status.tolist() == [Status.INADMISSIBLE]
    assert found.reasons == {0: reason}


def test_the_course_of_a_run_ends_where_the_run_does():
    course = WalkerAndersonDruckerPrager().trajectory(ROD | TARGET)
    depth = outputs(WalkerAndersonDruckerPrager(), ROD | TARGET)["penetration_depth"][0]
    assert course["penetration_depth"].values[-1] == pytest.approx(depth, rel=1e-6)
