"""What a user of the library calls: studies in any form, changes of them, summaries, figures."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from study_text import study_text

import uqpen

FILE = study_text(
    {"python": "tank.py:tank", "inputs": {"a": "m", "b": "m"}, "outputs": {"volume": "m2"}},
    title="A tank",
    seed=5,
    inputs={"a": ("1 m", "2 m"), "b": "(3 ± 0.1) m"},
    constraints={"keep": ["b > a"]},
    outputs={"volume": {"exceeds": ["5 m2"]}},
    designs={"draws": {"kind": "monte-carlo", "runs": 40}},
)


def tank(a, b):
    return {"volume": a * b}


@pytest.fixture
def path(tmp_path):
    (tmp_path / "tank.py").write_text("def tank(a, b):\n    return {'volume': a * b}\n")
    path = tmp_path / "tank.toml"
    path.write_text(FILE)
    return path


def values(archive):
    return archive["runs/draws/volume"].values


def test_a_path_a_study_and_a_function_give_the_same_runs(path):
    stated = {
        "inputs": {"a": uqpen.Uniform("1 m", "2 m"), "b": "(3 ± 0.1) m"},
        "outputs": {"volume": "m2"},
        "designs": {"draws": uqpen.MonteCarlo(runs=40)},
        "constraints": ["b > a"],
        "seed": 5,
    }
    of_path = values(uqpen.run(path))
    for archive in (
        uqpen.run(str(path)),
        uqpen.run(uqpen.load_study(path)),
        uqpen.run(tank, **stated),
        uqpen.run(uqpen.Study(tank, **stated)),
        uqpen.make_archive(path, path.parent / "a.nc"),
        uqpen.make_archive(tank, path.parent / "b.nc", **stated),
    ):
        np.testing.assert_array_equal(values(archive), of_path)


def test_a_study_is_changed_by_an_argument(path):
    study = uqpen.load_study(path)
    assert study.inputs["b"] == "(3 ± 0.1) m"
    assert list(study.outputs) == ["volume"]
    np.testing.assert_array_equal(values(uqpen.run(study.replace())), values(uqpen.run(study)))
    fixed = study.replace(inputs={**study.inputs, "a": "2 m"}, title="Another")
    assert (fixed.title, study.title, fixed.name) == ("Another", "A tank", "tank")
    archive = uqpen.run(fixed)
    np.testing.assert_allclose(values(archive), 2 * archive["runs/draws/b"].values, rtol=1e-15)
    free = fixed.replace(constraints=None, designs=uqpen.LatinHypercube(runs=20))
    assert (list(free.designs), free.constraints) == (["latin_hypercube"], ())
    # What is given beside a study takes the place of its own.
    archive = uqpen.run(path, designs={"few": uqpen.MonteCarlo(runs=5)})
    assert archive["runs"].children.keys() == {"few"}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda path: uqpen.run(3), "found an object of class int; expected a uqpen.Study, the"),
        (lambda path: uqpen.run(tank), r"uqpen.Study\(inputs=…\)  inputs\n    found     nothing"),
        (lambda path: uqpen.run("absent.toml"), "absent.toml: cannot be read"),
        (lambda path: uqpen.run(path, seed=-1), r"uqpen.Study\(seed=…\)  seed\n    found     -1"),
        (lambda path: uqpen.load_study(path).replace(designs=10), "found     10"),
    ],
    ids=["a number", "a bare function", "no file", "a wrong argument", "a wrong change"],
)
def test_a_mistake_is_met_before_any_run(call, message, path):
    with pytest.raises(uqpen.StudyError, match=message):
        call(path)


def test_an_archive_shows_itself_in_few_lines(path):
    archive = uqpen.run(path)
    first, *groups = repr(archive).splitlines()
    assert first == "<uqpen.Archive 'A tank'>"
    assert "  /runs: draws" in groups
    assert len(groups) < 10
    lines = archive.summary().splitlines()
    assert lines[0].startswith("volume, P(> 5 m2): ")
    assert "\u00a0" not in archive.summary()
    assert len(lines) < 10


def test_figures_are_methods_of_an_archive(path):
    archive = uqpen.run(path)
    assert {"cdf", "histogram", "exceedance", "scatter"} <= {*dir(archive.plot)}
    assert isinstance(archive.plot.cdf("volume"), Figure)
    axes = Figure().subplots()
    assert archive.plot.cdf(ax=axes) is axes
    assert axes.get_xlabel().startswith("volume")
    with pytest.raises(AttributeError, match="no figure 'pie'; this archive has: cdf, "):
        archive.plot.pie()
    with pytest.raises(uqpen.UqpenError, match="2 panels, and ax is one"):
        archive.plot.scatter(ax=axes)
    assert not Path("cdf.svg").exists(), "nothing is written unless it is asked for"
