"""The Walker-Anderson model: exact values, conservation, scaling, and every run on its own."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nominal_rod import KNOWN_POINTS, ROD
from scipy.integrate import solve_ivp

from uqpen.core.status import Status
from uqpen.models import rod_kernel, walker_anderson
from uqpen.models.rod_and_target import Termination
from uqpen.models.rod_course import erosion_slopes, integrate_erosion, make_rod, trajectory
from uqpen.models.walker_anderson import DEFAULT_TOLERANCE, WalkerAnderson

pytestmark = pytest.mark.processor

FloatArray = npt.NDArray[np.float64]
CASES = Path(__file__).parents[1] / "data" / "walker_anderson_cases.csv"

# What the default tolerance promises, relative; the largest error in 40 000 draws of the report's
# law was 1.9e-7.
PROMISED = 1e-6


class Penetration(NamedTuple):
    """The outputs of a batch, and whether each of its runs was solved."""

    depth: FloatArray
    residue: FloatArray
    erosion_end_depth: FloatArray
    termination: FloatArray
    solved: npt.NDArray[np.bool_]


def penetrate(*, tolerance=DEFAULT_TOLERANCE, **batch):
    results = WalkerAnderson(tolerance).evaluate(batch)
    return Penetration(*results.outputs.values(), results.status == Status.OK)


def rods(**changes):
    """A batch of the nominal rod with some inputs changed."""
    values = np.broadcast_arrays(*({**ROD, **changes}).values())
    shape = np.atleast_1d(values[0]).shape
    return {
        name: np.broadcast_to(value, shape).astype(float)
        for name, value in zip(ROD, values, strict=True)
    }


def concrete(runs, seed=5876):
    """Admissible draws of the report's law for concrete."""
    rng = np.random.default_rng(seed)
    batch = rods(
        target_density=rng.normal(2500.0, 50.0, runs),
        target_yield_limit=rng.normal(400e6, 40e6, runs),
        plasticity_radius=rng.normal(0.1, 0.025, runs),
        crater_radius=rng.normal(0.017, 0.003, runs),
    )
    return select(batch, batch["plasticity_radius"] > batch["crater_radius"])


def select(batch, which):
    return {name: values[which] for name, values in batch.items()}


def one(**changes):
    result = penetrate(**rods(**changes), tolerance=1e-11)
    assert result.solved.all()
    return float(result.depth[0]), float(result.residue[0])


def assert_same_bits(left, right):
    for ours, theirs in zip(left, right, strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.fixture(scope="module")
def cases():
    with CASES.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    columns = {
        name: np.array([float(row[name]) for row in rows])
        for name in rows[0]
        if name not in ("case", "termination")
    }
    inputs = {name: columns.pop(name) for name in ROD}
    return inputs, columns, [row["termination"] for row in rows]


# Against values known to 16 digits


@pytest.mark.parametrize(
    ("tolerance", "error"),
    [
        (1e-6, PROMISED),
        # Rounding in some thousand steps stays below 1e-12; 1e-9 leaves the method its own error.
        (1e-11, 1e-9),
    ],
)
def test_reference_cases_are_met_to_the_promised_accuracy(cases, tolerance, error):
    inputs, expected, _ = cases
    result = penetrate(**inputs, tolerance=tolerance)
    np.testing.assert_allclose(result.depth, expected["penetration_depth"], rtol=error)
    np.testing.assert_allclose(result.residue, expected["projectile_residue"], rtol=error)
    np.testing.assert_allclose(result.erosion_end_depth, expected["erosion_end_depth"], rtol=error)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_the_event_that_comes_first_ends_erosion_however_close_the_other(cases, tolerance):
    inputs, _, termination = cases
    expected = [
        Termination.BREAKDOWN if end == "v=u" else Termination.STANDSTILL for end in termination
    ]
    np.testing.assert_array_equal(penetrate(**inputs, tolerance=tolerance).termination, expected)


def test_default_tolerance_keeps_its_promise_over_the_reports_law():
    batch = concrete(5000)
    default, tight = penetrate(**batch), penetrate(**batch, tolerance=1e-10)
    np.testing.assert_allclose(default.depth, tight.depth, rtol=PROMISED)
    np.testing.assert_allclose(default.residue, tight.residue, rtol=PROMISED)
    np.testing.assert_array_equal(default.termination, tight.termination)
    # About three draws in ten stop while they erode; four standard deviations are 0.03.
    assert np.mean(default.termination == Termination.STANDSTILL) == pytest.approx(0.319, abs=0.03)


# Exact properties of the equations


@given(exponent=st.integers(-12, 12), smoothing=st.floats(0.0, 1.9))
@settings(max_examples=25, deadline=None)
def test_lengths_scale_depth_and_residue_with_them(exponent, smoothing):
    scale = 2.0**exponent  # exact in binary, so the bits must agree too
    lengths = ("projectile_length", "plasticity_radius", "crater_radius")
    scaled = {name: scale * ROD[name] for name in lengths}
    depth, residue = one(smoothing=smoothing)
    assert one(smoothing=smoothing, **scaled) == (scale * depth, scale * residue)


def test_long_rods_without_strength_reach_the_hydrodynamic_limit():
    length = 50.0
    for density in (2500.0, 17_500.0):
        weak = {
            "projectile_length": length,
            "target_density": density,
            "projectile_yield_limit": 1e6,
            "target_yield_limit": 1e6,
        }
        depth, residue = one(**weak)
        steady = np.sqrt(density / ROD["projectile_density"])
        # The start and the end take a depth of some crater radii, of which the rod is 3000 long.
        assert depth == pytest.approx(length / steady, rel=3e-3)
        assert residue < 1e-5 * length
    course = trajectory(make_rod({**ROD, **weak}), depths=3)
    # Steady flow: v = u (1 + sqrt(ρt/ρp)), but for strengths 5e-4 of the pressure and s/L.
    assert course.tail_velocity[1] / course.nose_velocity[1] == pytest.approx(1 + steady, rel=3e-3)


def test_momentum_changes_by_the_forces_on_rod_and_target_only():
    values = {**ROD, "smoothing": 0.7}
    rod = make_rod(values)
    steps, _, _ = integrate_erosion(rod, 1e-8)
    assert steps is not None
    Omega, profile, kappa, added = rod[0], rod[1], rod[2], rod.added_length
    for u, x, L, z in steps.before.T.tolist():
        du, dx, dL, _ = erosion_slopes(np.array([u, x, L, z]), rod)
        v, dv, s, ds = u * (1 + x), du * (1 + x) + u * dx, kappa * x, kappa * dx
        change = Omega * (dv * L + v * dL + (ds * (u - v) + s * (du - dv)) / profile) + added * du
        force = -0.5 * (Omega * (v**2 - u**2) + u**2 + rod.resistance)
        # The terms of the sum cancel to a tenth of their size; rounding leaves 1e-14.
        assert change == pytest.approx(force, rel=1e-12)


def test_weights_of_the_runge_kutta_pair_satisfy_the_order_conditions():
    stages = [(), *(getattr(rod_kernel, f"STAGE_{stage}") for stage in range(2, 7))]
    a = np.zeros((7, 7))
    for row, weights in enumerate([*stages, rod_kernel.SOLUTION]):
        a[row, : len(weights)] = weights
    c = a.sum(axis=1)
    trees = [
        (np.ones(7), 1), (c, 2), (c**2, 3), (a @ c, 6),
        (c**3, 4), (c * (a @ c), 8), (a @ c**2, 12), (a @ a @ c, 24),
        (c**4, 5), (c**2 * (a @ c), 10), (c * (a @ c**2), 15), (c * (a @ a @ c), 30),
        ((a @ c) ** 2, 20), (a @ c**3, 20), (a @ (c * (a @ c)), 40), (a @ a @ c**2, 60),
        (a @ a @ a @ c, 120),
    ]  # fmt: skip
    # Rounding of weights up to 13 in size, through products of up to four of them.
    for tree, density in trees:
        assert a[6] @ tree == pytest.approx(1 / density, abs=1e-13)
    for tree, _ in trees[:8]:
        assert np.array(rod_kernel.ERROR) @ tree == pytest.approx(0.0, abs=1e-13)


# Every run on its own


def test_a_run_has_the_same_bits_in_any_order_and_any_part_of_a_batch():
    batch = concrete(500)
    whole = penetrate(**batch)
    order = np.random.default_rng(1).permutation(whole.depth.size)
    shuffled = penetrate(**select(batch, order))
    assert_same_bits(shuffled, Penetration(*(values[order] for values in whole)))
    for size in (1, 3, 16, 17):
        first = slice(40, 40 + size)
        part = penetrate(**select(batch, first))
        assert_same_bits(part, Penetration(*(values[first] for values in whole)))


@pytest.mark.parametrize("lane", range(16))
def test_a_run_has_the_same_bits_in_every_lane(lane):
    batch = rods(target_yield_limit=np.linspace(300e6, 500e6, 16))
    rolled = {name: np.roll(values, lane) for name, values in batch.items()}
    expected = Penetration(*(np.roll(values, lane) for values in penetrate(**batch)))
    assert_same_bits(penetrate(**rolled), expected)


def test_a_run_has_the_same_bits_with_any_number_of_threads(monkeypatch):
    batch = concrete(3000)
    monkeypatch.setenv("UQPEN_THREADS", "1")
    alone = penetrate(**batch)
    monkeypatch.delenv("UQPEN_THREADS")
    for processors in (2, 3, 5):
        monkeypatch.setattr("uqpen.core.processors.processors", lambda number=processors: number)
        assert_same_bits(penetrate(**batch), alone)


def test_a_run_of_the_reports_law_takes_326_evaluations_of_the_slopes():
    erode = walker_anderson.erode
    with mock.patch.object(walker_anderson, "erode", wraps=erode) as watched:
        penetrate(**concrete(2000))
    (all_rods, _), _ = watched.call_args
    found, tighter = (
        1 + 6 * erode(all_rods, tolerance)[5] + 7  # the start, steps, the event
        for tolerance in (DEFAULT_TOLERANCE, DEFAULT_TOLERANCE / 32)
    )
    # The standard deviation among runs is 100, so that of the mean is 2.
    assert found.mean() == pytest.approx(326, abs=10)
    # Steps of order 5 go with the fifth root of the tolerance.
    assert tighter.mean() / found.mean() == pytest.approx(2.0, rel=0.2)


def test_a_run_that_cannot_be_solved_is_reported_and_harms_no_other():
    batch = concrete(100)
    sound = penetrate(**batch)
    batch["target_density"][[3, 50]] = np.nan  # never finite
    batch["plasticity_radius"][70] = batch["crater_radius"][70] * (1 + 1e-9)  # far too stiff
    result = penetrate(**batch)
    np.testing.assert_array_equal(np.flatnonzero(~result.solved), [3, 50, 70])
    assert np.isnan(result.depth[~result.solved]).all()
    kept = Penetration(*(values[result.solved] for values in result))
    assert_same_bits(kept, Penetration(*(values[result.solved] for values in sound)))


def test_an_empty_batch_gives_an_empty_result():
    assert penetrate(**rods(smoothing=np.empty(0))).depth.shape == (0,)


# The corners of the inputs' domain


def test_the_stiffest_runs_solved_agree_with_those_of_a_tighter_tolerance():
    ratios = np.array([1.001, 1.0005])
    batch = rods(plasticity_radius=ratios * ROD["crater_radius"])
    result, tight = penetrate(**batch), penetrate(**batch, tolerance=1e-10)
    assert result.solved.all()
    np.testing.assert_allclose(result.depth, tight.depth, rtol=PROMISED)


@pytest.mark.parametrize("velocity", [1.0, 10.0, 100.0])
def test_a_rod_too_slow_to_erode_penetrates_as_a_rigid_body(velocity):
    result = penetrate(**rods(impact_velocity=velocity))
    rod = make_rod({**ROD, "impact_velocity": velocity})
    inertia = rod.density_ratio * rod.length + rod.added_length
    # A closed form: only rounding in its few operations.
    depth = inertia * np.log1p(velocity**2 / rod.resistance)
    assert result.depth[0] == pytest.approx(depth, rel=1e-14)
    assert result.residue[0] == ROD["projectile_length"]
    assert result.erosion_end_depth[0] == 0
    assert result.termination[0] == Termination.RIGID


@pytest.mark.parametrize(
    "changes",
    [
        {"smoothing": 1.0},
        {"plasticity_radius": 0.125},  # comes to a standstill
        {"target_yield_limit": 4e12},  # stops almost at once
        {"smoothing": 1.99},
        {"plasticity_radius": 1.02 * ROD["crater_radius"]},  # stiff
        {"projectile_length": 0.01, "projectile_yield_limit": 1e8},  # shorter than its crater
        {"projectile_density": 1250.0},  # lighter than the target
        {"impact_velocity": 10_000.0},
        {"projectile_yield_limit": 1.65e6, "target_yield_limit": 4e5},
    ],
)
def test_rods_end_where_an_independent_integration_ends(changes):
    result = penetrate(**rods(**changes))
    course = trajectory(make_rod({**ROD, **changes}), depths=2)
    assert result.depth[0] == pytest.approx(course.depth[-1], rel=PROMISED)
    assert result.residue[0] == pytest.approx(course.length[-1], rel=PROMISED)


# The course of one run


@pytest.fixture(scope="module")
def course():
    return trajectory(make_rod(ROD), depths=10_001)


@pytest.mark.parametrize("depth", KNOWN_POINTS)
def test_trajectory_passes_through_known_points(course, depth):
    found = [np.interp(depth, course.depth, values) for values in course[1:]]
    # The values have six digits; linear interpolation over 46 µm adds less than 1e-8.
    assert found == pytest.approx(KNOWN_POINTS[depth], rel=3e-6)


def test_tail_and_nose_meet_at_the_known_time_depth_and_velocity():
    _, (u, x, _, z), time = integrate_erosion(make_rod(ROD), 1e-10)
    # Seven digits are known.
    assert (time, z, u) == pytest.approx((583.1932e-6, 0.4538407, 244.4509), rel=2e-7)
    assert x == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    "changes",
    [{}, {"smoothing": 1.0}, {"target_yield_limit": 5e9}],
    ids=["breakdown", "smoothed", "standstill"],
)
def test_erosion_is_that_of_an_integration_by_scipy(changes):
    rod = make_rod({**ROD, **changes})
    steps, _, end = integrate_erosion(rod, 1e-10)
    assert steps is not None
    known = solve_ivp(
        lambda _, state: erosion_slopes(state, rod),
        (0.0, end),
        [rod.impact_velocity, 0.0, rod.length, 0.0],
        method="DOP853",
        t_eval=steps.start,
        rtol=1e-12,
        atol=1e-14 * np.array([rod.impact_velocity, 1.0, rod.length, rod.length]),
    )
    scales = np.abs(known.y).max(axis=1, keepdims=True)
    np.testing.assert_allclose(steps.before / scales, known.y / scales, atol=2e-9)
