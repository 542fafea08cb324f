"""Tutorials work as printed, from an empty folder to a page, and physics gives the same answers.

Programs that a tutorial needs beside uqpen are installed by ``.ci/run``.
"""

import io
import re
import runpy
import shutil
import sys
import tomllib

import numpy as np
import pandas as pd
import pytest
from page_blocks import ROOT, blocks_of
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from test_how_to import run_as_printed

import uqpen

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="programs run on POSIX only"),
]

TUTORIALS = ROOT / "docs" / "tutorials"


@pytest.fixture
def follow(command_line, tmp_path):
    """Follows a tutorial in an empty folder, which it returns."""

    def follow_page(name):
        run_as_printed(blocks_of(TUTORIALS / f"{name}.md"), tmp_path, command_line)
        (page,) = (tmp_path / "archives").glob("*.html")
        assert page.stat().st_size > 100_000
        return tmp_path

    return follow_page


def completed_runs(folder, name, design):
    runs = uqpen.open_archive(folder / "archives" / f"{name}.nc")[f"runs/{design}"].to_dataset()
    return runs.isel(run=runs["status"].values == 0), runs.isel(run=runs["status"].values != 0)


@pytest.mark.parametrize("name", ["own_function", "program", "runs_in_a_file"])
def test_it_ends_at_a_page_of_ones_own_model(name, follow):
    follow(name)


def test_measurements_teach_the_values_that_they_were_made_with(follow):
    folder = follow("measurements")
    for name, truth in (("ward", [0.42, 0.14]), ("pump", [0.12, 0.12])):
        found = uqpen.open_archive(folder / "archives" / f"{name}.nc")["calibrations/fit"]
        values = found["unknown_value"].values
        scale = [1 / 86400] * 2 if name == "ward" else [1e6, 1]
        assert (values[:, 1] < np.multiply(truth, scale)).all()
        assert (values[:, 2] > np.multiply(truth, scale)).all()


def test_ignition_is_steepest_where_branching_overtakes_termination(follow):
    cantera = pytest.importorskip(
        "cantera", reason="there is no cantera here (pip install cantera)"
    )
    folder = follow("ignition")
    delay = runpy.run_path(str(folder / "ignition.py"))["ignition_delay"]
    gas = cantera.Solution("h2o2.yaml")
    equations = gas.reaction_equations()
    branching = [equations.index("H + O2 <=> O + OH")]
    ending = [i for i, each in enumerate(equations) if re.match(r"H \+ O2 \+ .+HO2", each)]

    # The extended second limit of explosion: a branching makes two radicals of one.
    def excess(temperature, pressure):
        gas.TPX = temperature, pressure * 1e5, "H2:2, O2:1, N2:3.76, H:1e-9"
        rates = gas.forward_rates_of_progress
        return 2 * rates[branching].sum() - rates[ending].sum()

    for pressure in (1, 2, 10):
        limit = brentq(excess, 800, 1400, args=(pressure,))
        temperatures = np.arange(limit - 90, limit + 91, 20)
        falls = -np.diff([np.log(delay(each, pressure, 1, 1)["delay"]) for each in temperatures])
        steepest = np.argmax(falls)
        assert abs(temperatures[steepest : steepest + 2].mean() - limit) <= 20


def test_a_battery_follows_the_diffusion_into_its_particles(follow):
    folder = follow("battery")
    functions = runpy.run_path(str(folder / "cell.py"))
    completed, failed = completed_runs(folder, "cell", "sample")
    assert failed.sizes["run"] == 0
    voltage = completed["voltage"].values
    assert np.nanmin(voltage) > 2.5
    assert np.isnan(voltage[:, -1]).all()
    # A full cell of this kind has 4.2 V at rest.
    assert functions["discharge"](1e-6, 85.2, 75.6, 5.22, 4)["voltage"][0] == pytest.approx(
        4.2, abs=0.03
    )

    # Shells of a sphere of radius 1 with a flux of 1 out of the last, by differences in space.
    edges = np.linspace(0, 1, 401)
    volumes = np.diff(edges**3) / 3

    def slopes(time, filled):
        flows = edges**2 * np.concatenate([[0], np.diff(filled) * 400, [-1]])
        return np.diff(flows) / volumes

    seconds = functions["SECONDS"]
    time = seconds * 3.3e-14 / 5.86e-6**2
    found = solve_ivp(
        slopes, (0, time[-1]), np.zeros(400), "LSODA", time, lband=1, uband=1, rtol=1e-8, atol=1e-8
    )
    surface = found.y[-1] - 0.5 / 400
    density = 5 * 5.86e-6 / (3 * 0.75 * functions["AREA"] * 85.2e-6)
    scale = density * 5.86e-6 / (functions["FARADAY"] * 3.3e-14)
    filled, _ = functions["electrode"](5, 85.2e-6, 0.75, 5.86e-6, 3.3e-14, 6.48e-7, 29866, 33133)
    there = np.isfinite(filled)
    assert there.sum() > 150
    # The differences are of the first order at the surface, and half a shell is 0.00125.
    np.testing.assert_allclose(filled[there], (29866 + scale * surface[there]) / 33133, atol=1e-3)


def test_a_column_bends_by_the_formula_of_perry_and_robertson_until_it_buckles(follow):
    if shutil.which("gfortran") is None:
        pytest.skip("there is no gfortran here (Debian's package gfortran)")
    folder = follow("column")

    def critical(runs):
        inertia = np.pi * runs["diameter"].values ** 4 / 64
        # Differences between 101 places are softer than the column.
        steps = (2 * 100 / np.pi * np.sin(np.pi / 200)) ** 2
        return np.pi**2 * runs["modulus"].values * inertia / runs["length"].values ** 2 * steps

    runs, failed = completed_runs(folder, "column", "sample")
    assert failed.sizes["run"] == 0
    unstable = runs.isel(run=runs["outcome"].values == 1)
    completed = runs.isel(run=runs["outcome"].values == 0)
    assert unstable.sizes["run"] == 8
    assert (unstable["load"].values >= critical(unstable)).all()
    assert (completed["load"].values < critical(completed)).all()
    load, diameter = completed["load"].values, completed["diameter"].values
    lever = completed["bow"].values / (1 - load / critical(completed))
    stress = load * (4 / (np.pi * diameter**2) + 32 * lever / (np.pi * diameter**3))
    # The deck has 12 digits, the table five behind the point.
    far = load < 0.99 * critical(completed)
    np.testing.assert_allclose(completed["stress"].values[far], stress[far], rtol=1e-6)


def test_floods_are_those_of_the_curve_number_method(follow, command_line):
    folder = follow("floods")
    # The page's study is the one of `init`, in ten lines, but for a distribution.
    assert command_line("init", "runs.csv", "-o", "first.toml").code == 0
    first = (folder / "first.toml").read_text(encoding="utf-8")
    lines = [line for line in first.splitlines() if line.strip() and not line.startswith("#")]
    assert len(lines) == 10
    shown = tomllib.loads((folder / "floods.toml").read_text(encoding="utf-8"))
    assert tomllib.loads(first) == {key: shown[key] for key in shown if key != "inputs"}
    predicted = pd.read_csv(
        io.StringIO(command_line("predict", "archives/floods.nc", "points.csv").out)
    )
    # 5 inches of rain on curve number 80: (5 - 0.5)² / (5 + 2) inches run off.
    exact = 0.208 * 10 * 4.5**2 / 7 * 25.4 / 2.5
    assert predicted["Peak_flow [m3/s]"][0] == pytest.approx(exact, rel=0.01)
    assert 0 < predicted["Peak_flow_std [m3/s]"][0] < 0.02 * exact
    assert predicted["Soil_type"].tolist() == ["B", "B"]
    assert predicted["extrapolated"].fillna("").tolist() == ["", "Rain"]
    tree = uqpen.open_archive(folder / "archives" / "floods.nc")
    indices = {
        output: tree[f"statistics/data/{output}/first_order"].sel(bound="estimate")
        for output in ("Peak_flow", "T_peak")
    }
    assert indices["Peak_flow"].idxmax() == "Rain"
    assert indices["T_peak"].sel(input="Slope") > 0.99
    # What the means over the runs of a soil explain, by hand.
    runs = pd.read_csv("runs.csv").dropna()
    peak, soils = runs["Peak flow (m3/s)"], runs.groupby("Soil type")["Peak flow (m3/s)"]
    share = 1 - (soils.var() * soils.size()).sum() / len(runs) / peak.var()
    assert indices["Peak_flow"].sel(input="Soil_type").item() == pytest.approx(share, rel=1e-4)
