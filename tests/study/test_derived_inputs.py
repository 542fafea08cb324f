"""Inputs that follow from others: computed after the draw, so all indices are valid."""

import numpy as np
import pytest
from click.testing import CliRunner

import uqpen
from uqpen.cli.main import uqpen as command

MODEL = """def f(diameter, pitch, depth):
    return {"load": diameter * pitch + depth}
"""

STUDY = """seed = 3
[model]
python = "m.py:f"
vectorized = true
[model.inputs]
diameter = "mm"
pitch = "mm"
depth = "mm"
[model.outputs]
load = "mm2"
[inputs]
diameter = { uniform = { lower = "8 mm", upper = "12 mm" } }
pitch = "%s"
depth = "%s"
[constraints]
keep = ["pitch < '1.15 mm'"]
[designs.mc]
kind = "monte-carlo"
runs = 400
"""


def study(tmp_path, pitch="0.1 * diameter", depth="pitch / 2 + '1 cm'", text=STUDY):
    (tmp_path / "m.py").write_text(MODEL)
    return uqpen.parse_study(text % (pitch, depth), folder=tmp_path)


def test_values_follow_and_constraints_use_them(tmp_path):
    runs = uqpen.run(study(tmp_path))["runs/mc"]
    diameter = runs["diameter"].values
    np.testing.assert_allclose(runs["pitch"], 0.1 * diameter, rtol=1e-15)
    np.testing.assert_allclose(runs["depth"], 0.05 * diameter + 0.01, rtol=1e-15)
    assert runs["depth"].attrs["derived_from"] == "pitch / 2 + '1 cm'"
    assert ((runs["status"].values == 1) == (diameter >= 0.0115)).all()
    assert runs["status"].values.any()


@pytest.mark.parametrize(
    ("pitch", "depth", "found", "expected"),
    [
        ("0.1 * diametre", "1 mm", '"diametre"', 'did you mean "diameter"?'),
        ("diameter ** 2", "1 mm", "in m2", "a length"),
        ("diameter / diameter", "1 mm", "without a unit", "a length"),
        ("depth", "2 * pitch", "pitch from depth from pitch: a cycle", "values of their own"),
        ("pitch * 2", "1 mm", '"pitch"', "an input of the model"),
        ("diameter + '1 s'", "1 mm", "compares m with s", "the same dimension"),
        ("0.1 * diameter if 1 else 2", "1 mm", "if 1", "names of inputs, numbers"),
    ],
)
def test_mistakes_are_met(pitch, depth, found, expected, tmp_path):
    with pytest.raises(uqpen.StudyError) as caught:
        study(tmp_path, pitch, depth)
    message = str(caught.value)
    assert found in message
    assert expected in message
    assert "study.toml:1" in message


ISHIGAMI = """seed = 1
[model]
python = "m.py:f"
vectorized = true
[model.inputs]
x1 = "1"
x2 = "1"
x3 = "1"
copy = "1"
[model.outputs]
y = "1"
[inputs]
copy = "%s"
x1 = { uniform = { lower = -3.141592653589793, upper = 3.141592653589793 } }
x2 = { uniform = { lower = -3.141592653589793, upper = 3.141592653589793 } }
x3 = { uniform = { lower = -3.141592653589793, upper = 3.141592653589793 } }
[designs.blocks]
kind = "saltelli"
base = 64
[designs.rule]
kind = "quadrature"
order = 4
[designs.some]
kind = "monte-carlo"
runs = 200
[surrogates.pce]
kind = "polynomial-chaos"
design = "some"
order = 3
"""


def test_indices_through_a_derived_copy_are_those_of_the_whole(tmp_path):
    found = []
    for body, copy in (("x1", "2 * x1"), ("copy / 2", "2 * x1")):
        (tmp_path / "m.py").write_text(
            "import numpy as np\ndef f(x1, x2, x3, copy):\n"
            "    a = 0 * copy + np.sin(x1)\n"
            f"    return {{'y': a + 7 * np.sin(x2) ** 2 + 0.1 * x3 ** 4 * np.sin({body})}}\n"
        )
        tree = uqpen.run(uqpen.parse_study(ISHIGAMI % copy, folder=tmp_path))
        assert "dependence" not in tree["runs/blocks"].attrs
        statistics = {}
        for source in ("blocks", "rule", "some", "pce"):
            names = tree[f"statistics/{source}/y"].data_vars
            statistics |= {(source, name): tree[f"statistics/{source}/y"][name] for name in names}
        found.append(statistics)
    whole, through = found
    assert whole.keys() == through.keys()
    assert any("first_order" in name for _, name in whole)
    for key, expected in whole.items():
        if expected.dtype.kind == "f":
            np.testing.assert_allclose(through[key], expected, rtol=1e-9, atol=1e-9, err_msg=key)
        if "input" in expected.coords:
            assert "copy" not in expected["input"].values


def test_check_run_and_exports_have_what_follows(tmp_path, monkeypatch):
    (tmp_path / "m.py").write_text(MODEL)
    (tmp_path / "study.toml").write_text(STUDY % ("0.1 * diameter", "2 * pitch"))
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        result = CliRunner().invoke(command, arguments, catch_exceptions=False)
        assert result.exit_code == 0, result.output
        return result.output

    assert "0.1 * diameter, which is 1 mm at the medians" in call("check", "study.toml")
    assert call("run", "study.toml").split()[-2:] == ["12", "mm2"]  # 10 × 1 + 2
    assert call("run", "study.toml", "--set", "depth=5 mm").split()[-2:] == ["15", "mm2"]
    # 9 × 0.9 + 1.8: what follows from a value that is set follows from it.
    assert call("run", "study.toml", "--set", "diameter=9 mm").split()[-2:] == ["9.9", "mm2"]
    call("study", "study.toml", "-o", "a.nc")
    assert "pitch [mm]" in call("export", "a.nc", "--runs").splitlines()[0]
    call("verify", "a.nc")
