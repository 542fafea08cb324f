"""Studies in notebooks, in a real kernel: those of pages, without a file, interrupted."""

import re
import time

import numpy as np
import pytest
from notebook_cells import PATIENCE, open_notebook, shown
from page_blocks import ROOT
from study_text import study_text
from test_how_to import IN_A_NOTEBOOK, section

import uqpen

pytestmark = pytest.mark.slow

STUDY = """
import uqpen
from pathlib import Path

factor = 2.0

def area(length, width):
    with Path("calls.txt").open("a") as calls:
        calls.write("x")
    return {"area": factor * length * width}

def study():
    return uqpen.Study(
        model=area,
        inputs={"length": uqpen.Normal("2 m", "0.1 m"), "width": "(3 ± 0.1) m"},
        outputs={"area": "m2"},
        designs={"mc": uqpen.MonteCarlo(runs=40)},
        seed=5,
    )
"""

FILE = study_text(
    {"python": "area.py:area", "inputs": {"length": "m", "width": "m"}, "outputs": {"area": "m2"}},
    seed=5,
    inputs={"length": {"normal": {"mean": "2 m", "std": "0.1 m"}}, "width": "(3 ± 0.1) m"},
    outputs={"area": {"unit": "m2"}},
    designs={"mc": {"kind": "monte-carlo", "runs": 40}},
)

MODEL = """
def area(length, width):
    return {"area": 2.0 * length * width}
"""


@pytest.fixture(scope="module")
def kernel(tmp_path_factory):
    with open_notebook(tmp_path_factory.mktemp("notebook")) as notebook:
        yield notebook


@pytest.fixture
def notebook(kernel, tmp_path):
    kernel.run(f"%cd -q {tmp_path}")
    return kernel


def test_cells_of_the_page_of_tasks_run_as_printed(notebook):
    study, estimates = (shown(notebook.run(block.text)) for block in section(IN_A_NOTEBOOK))
    assert "<td>normal (5 ± 0.5) kN</td>" in study
    assert "<progress" in estimates
    assert "<th>deflection [mm]</th><th>draws</th>" in estimates


def test_the_tutorial_ends_at_a_page_and_says_a_mistake_in_a_line(notebook, tmp_path):
    text = (ROOT / "docs" / "tutorials" / "notebook.md").read_text(encoding="utf-8")
    cells = re.findall(r"```{code-cell}\n((?::[^\n]*\n)*)(.*?)```", text, re.DOTALL)
    for options, code in cells:
        reply, outputs = notebook.finish(notebook.start(code))
        if "raises-exception" not in options:
            assert reply["status"] == "ok", "\n".join(reply["traceback"])
        else:
            assert len("\n".join(reply["traceback"]).splitlines()) <= 5
            assert "kg" in reply["traceback"][0]
        if ".values.round" in code:
            interval = re.findall(r"\d\.\d+", outputs[-1]["data"]["text/plain"])
    rng = np.random.default_rng(2)
    load, length = rng.normal(12, 1.5, 10**6), rng.uniform(2.95, 3.05, 10**6)
    stiffness = 48 * rng.normal(205, 8, 10**6) * rng.normal(830, 25, 10**6)
    lower, upper = map(float, interval)
    assert lower < (load * length**3 / stiffness * 1e5 > 5).mean() < upper
    assert (tmp_path / "beam.html").stat().st_size > 100_000


def test_its_archive_is_that_of_a_file(notebook, tmp_path):
    notebook.run(STUDY)
    assert "<td>normal: mean 2 m, std 0.1 m</td>" in shown(notebook.run("study()"))
    outputs = notebook.run('uqpen.make_archive(study(), "notebook.nc", workers=2)')
    assert "<progress" in shown(outputs)
    assert "<th>area [m2]</th><th>mc</th>" in shown(outputs)
    (tmp_path / "area.py").write_text(MODEL)
    (tmp_path / "study.toml").write_text(FILE)
    of_file = uqpen.run(uqpen.load_study(tmp_path / "study.toml"))
    archive = uqpen.open_archive(tmp_path / "notebook.nc")
    for group in ("runs/mc", "statistics/mc", "statistics/mc/area"):
        assert archive[group].to_dataset().identical(of_file[group].to_dataset()), group


def test_a_mistake_is_its_message_alone(notebook):
    message = notebook.start(
        STUDY + "\nstudy().replace(designs={'mc': uqpen.MonteCarlo(runs=40)}, seed=-1)"
    )
    reply, _ = notebook.finish(message)
    assert reply["status"] == "error"
    shown_lines = "\n".join(reply["traceback"]).splitlines()
    assert shown_lines[0] == "StudyError: uqpen.Study: 1 mistake; nothing was run"
    assert len(shown_lines) <= 5
    assert "Traceback" not in "\n".join(shown_lines)
    # The traceback is there for who wants it.
    asked = "import sys, traceback; traceback.print_exception(sys.last_value)"
    outputs = notebook.run(asked)
    assert "Traceback" in "".join(output.get("text", "") for output in outputs)


def test_an_interrupted_study_goes_on_where_it_was(notebook, tmp_path):
    notebook.run(STUDY)
    notebook.run(
        """
        import time

        def area(length, width):
            with Path("calls.txt").open("a") as calls:
                calls.write("x")
            while Path("calls.txt").stat().st_size > 20 and not Path("go.txt").exists():
                time.sleep(0.01)
            return {"area": 2.0 * length * width}
        """
    )
    message = notebook.start('archive = uqpen.make_archive(study(), "interrupted.nc")')
    calls = tmp_path / "calls.txt"
    deadline = time.monotonic() + PATIENCE
    while not calls.exists() or calls.stat().st_size <= 20:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    notebook.manager.interrupt_kernel()
    reply, _ = notebook.finish(message)
    assert reply["ename"] == "KeyboardInterrupt"
    kept = int(re.match(r"(\d+) runs are kept", reply["evalue"])[1])  # type: ignore[index]
    assert 0 < kept <= 20
    (tmp_path / "go.txt").touch()
    notebook.run('archive = uqpen.make_archive(study(), "interrupted.nc")')
    log = (tmp_path / "interrupted.nc.log").read_text(encoding="utf-8")
    compared = int(re.search(r"(\d+) of \d+ runs made again", log)[1])  # type: ignore[index]
    # One run in 20 shows whether the model has noise.
    made_again = compared + 2
    assert calls.stat().st_size == 21 + 40 - kept + made_again, "no other run is made again"
