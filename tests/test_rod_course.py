"""The shipped study of a rod's course, against other integrations and what is known of its law."""

from pathlib import Path

import numpy as np
import pytest

import uqpen
from uqpen.models.rod_course import make_rod, trajectory

pytestmark = pytest.mark.slow

STUDY = Path(__file__).parents[1] / "studies" / "rod_course.toml"
CONSTANTS = (
    "projectile_density",
    "projectile_yield_limit",
    "projectile_length",
    "impact_velocity",
    "projectile_sound_speed",
    "target_density",
    "target_yield_limit",
    "plasticity_radius",
    "crater_radius",
)
CURVES = ("nose_velocity", "tail_velocity", "length", "plastic_extent", "time")


@pytest.fixture(scope="module")
def tree():
    """The study with fewer places and runs."""
    text = STUDY.read_text(encoding="utf-8")
    for old, new in (("= 41\n", "= 3\n"), ("= 51\n", "= 6\n"), ("2_000", "400")):
        assert old in text
        text = text.replace(old, new)
    return uqpen.run(uqpen.parse_study(text, folder=STUDY.parent))


def runs(tree, model):
    return tree[f"models/{model}/runs/monte_carlo"].to_dataset()


def test_a_run_is_that_of_another_integration(tree):
    made = runs(tree, "smoothed")
    constants = {name: float(made[name].values.flat[0]) for name in CONSTANTS}
    known = trajectory(make_rod({**constants, "smoothing": 1.0}), depths=2001)
    depths = made["target_depth"].values
    is_reached = depths <= known.depth[-1]
    assert 2 <= is_reached.sum() < 6
    for name in CURVES:
        curve = made[f"{name}_at_depth"].values[0]
        assert np.array_equal(np.isfinite(curve), is_reached)
        # Between 2 000 depths, a straight line is right to 1e-4 of what a curve is at most.
        expected = np.interp(depths[is_reached], known.depth, getattr(known, name))
        assert np.abs(curve[is_reached] - expected).max() <= 1e-4 * np.ptp(expected) + 1e-12


def test_a_rigid_rod_slows_down_as_its_closed_form_says(tree):
    made = runs(tree, "rigid")
    depths = made["target_depth"].values
    R, S, Yt, density = (
        made[name].values[:, np.newaxis]
        for name in ("crater_radius", "plasticity_radius", "target_yield_limit", "target_density")
    )
    with np.errstate(invalid="ignore"):
        resistance = 14 / 3 * Yt / density * np.log(S / R)
        inertia = 17_500 / density * 0.16 + R * (S - R) / (S + R)
        # K d(u²)/dz = -(u² + B), from u = v0.
        square = (1400**2 + resistance) * np.exp(-depths / inertia) - resistance
        expected = np.where(square >= 0, np.sqrt(square), np.nan)
    expected[made["status"].values != 0] = np.nan
    np.testing.assert_allclose(made["nose_velocity_at_depth"].values, expected, rtol=1e-7)


def test_as_many_rods_get_to_a_depth_as_are_known_to(tree):
    statistics = tree["models/original/statistics/monte_carlo"]
    reached = (
        statistics["nose_velocity_at_depth/reached"].sel(target_depth=0.6, method="nearest").values
    )
    # P(depth > 60 cm) and the mean depth from 25 million runs of an independent code.
    assert reached[1] < 0.13717 < reached[2]
    depth = statistics["penetration_depth/mean"].values
    assert depth[1] < 0.492739 < depth[2]
