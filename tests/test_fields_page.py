"""The page on curves and fields works as printed: SciPy, ngspice and a UM-Bridge server."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from model_servers import LISTENING
from page_blocks import ROOT, blocks_of
from scipy.integrate import solve_ivp
from test_how_to import check_shown, output_of, write_file

import uqpen

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="programs run on POSIX only"),
]

PAGE = ROOT / "docs" / "fields.md"
TEXT = PAGE.read_text(encoding="utf-8")


def section(title):
    return list(blocks_of(PAGE, TEXT.partition(f"## {title}")[2].partition("\n## ")[0]))


def run_as_printed(title, command_line):
    """Run the commands of a section in this folder, and check what they show."""
    output = ""
    for block in section(title):
        if block.file:
            write_file(block, Path())
        elif block.language == "sh":
            output = output_of(block, command_line)
        elif block.language == "text":
            check_shown(block, output)


def test_an_epidemic_by_scipy(command_line):
    run_as_printed("A Python function", command_line)
    runs = uqpen.open_archive("archives/epidemic.nc")["runs/sample"].to_dataset()
    assert not runs["status"].values.any()
    assert runs["infected"].sizes == {"run": 40, "time": 161}
    # The final size of an SIR epidemic: ln s = R0 (s - 1) where all but `first` were susceptible.
    left = 1 - runs["attack"].values
    ratio = runs["contact"].values / runs["recovery"].values
    final = runs["infected"].isel(time=-1).values
    np.testing.assert_allclose(np.log(left / (1 - 1e-4)), -ratio * (1 - left - final), atol=1e-4)


def test_a_solver_that_returns_its_own_steps_gives_the_same_curve():
    days = np.arange(0.0, 161.0, 10.0)

    def outbreak(contact, **options):
        def slopes(_, state):
            new = contact * state[0] * state[1]
            return [-new, new - 0.15 * state[1]]

        found = solve_ivp(slopes, (0, 160), [0.9999, 1e-4], rtol=1e-8, **options)
        return {"infected": found.y[1], "day": found.t}

    spec = uqpen.OutputSpec(
        "1",
        along={"time": {"unit": "day", "values": days}},
        on={"time": "day"},
        interpolation="cubic",
    )
    study = uqpen.Study(
        model=lambda contact: outbreak(contact, max_step=1.0),
        inputs={"contact": uqpen.Uniform("0.3 day-1", "0.5 day-1")},
        outputs={"infected": spec},
        designs={"few": uqpen.MonteCarlo(runs=3)},
        seed=1,
    )
    runs = uqpen.run(study)["runs/few"]
    rates = runs["contact"].values * 86_400
    expected = [outbreak(rate, t_eval=days)["infected"] for rate in rates]
    np.testing.assert_allclose(runs["infected"].values, expected, atol=1e-3)


def test_a_transient_of_ngspice(command_line):
    if shutil.which("ngspice") is None:
        pytest.skip("there is no ngspice here (Debian's package ngspice)")
    shutil.copytree(ROOT / "studies", "studies")
    run_as_printed("A program", command_line)
    runs = uqpen.open_archive("archives/charging.nc")["runs/sample"].to_dataset()
    assert not runs["status"].values.any()
    decay = runs["time"] / (runs["resistance"] * runs["capacitance"])
    # Another version of ngspice may choose other steps.
    np.testing.assert_allclose(runs["voltage"], 5 * (1 - np.exp(-decay)).transpose(), atol=2e-3)


def test_a_server(tmp_path):
    program, study = (block.text for block in section("A server"))
    (tmp_path / "server.py").write_text(LISTENING + program, encoding="utf-8")
    command = [sys.executable, str(tmp_path / "server.py")]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as server:
        try:
            address = f"http://127.0.0.1:{server.stdout.readline().strip()}"
            study = study.replace("http://127.0.0.1:4242", address)
            runs = uqpen.run(uqpen.parse_study(study))["runs/sample"].to_dataset()
        finally:
            server.kill()
    assert not runs["status"].values.any()
    place = runs["place"]
    excess = runs["heating"] * place * (2 - place) / (2 * runs["conductivity"])
    np.testing.assert_allclose(runs["temperature"], 293.15 + excess)
    np.testing.assert_allclose(runs["flux"], runs["heating"] * 1.0)
