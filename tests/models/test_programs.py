"""Studies of programs that people use, as they come with uqpen: ngspice and CalculiX."""

import shutil
from pathlib import Path

import numpy as np
import pytest

import uqpen

STUDIES = Path(__file__).parents[2] / "studies" / "programs"

pytestmark = pytest.mark.slow


def runs_of(name, program, package, tmp_path):
    """Run a study that is shipped, if its program is there."""
    if shutil.which(program) is None:
        pytest.skip(f"there is no {program} here (Debian's package {package})")
    shutil.copytree(STUDIES, tmp_path / "programs")
    tree = uqpen.run(uqpen.load_study(tmp_path / "programs" / f"{name}.toml"))
    runs = tree["runs/sample"].to_dataset()
    assert not runs["status"].values.any()
    return runs


def test_the_filter_has_the_cutoff_of_its_formula(tmp_path):
    runs = runs_of("filter", "ngspice", "ngspice", tmp_path)
    period = 2 * np.pi * runs["resistance"].values * runs["capacitance"].values
    # Seven digits are printed, and the frequency is interpolated between 200 in a decade.
    np.testing.assert_allclose(runs["cutoff"].values, 1 / period, rtol=1e-4)
    decibels = -10 * np.log10(1 + (1000 * period) ** 2)
    np.testing.assert_allclose(runs["gain"].values, decibels, rtol=1e-4)


def test_the_cantilever_bends_as_in_beam_theory(tmp_path):
    runs = runs_of("cantilever", "ccx", "calculix-ccx", tmp_path)
    inertia = runs["width"].values * runs["height"].values ** 3 / 12
    theory = runs["load"].values / (3 * runs["modulus"].values * inertia)
    ratio = runs["deflection"].values / theory
    # Four elements and a clamp that lets no section contract are 2.4 % too stiff; all the same way.
    np.testing.assert_allclose(ratio, 0.976, atol=0.005)
    assert np.ptp(ratio) < 1e-3
