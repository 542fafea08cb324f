"""A model class from a file of the user's own: in a study, its archive and checks."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

import uqpen
from uqpen.core.errors import ModelError, StudyError
from uqpen.core.model import Dimension, Input, Model, Output, Results
from uqpen.core.status import Status
from uqpen.models.user_module import load_module
from uqpen.testing import check_model
from uqpen.verification.archived_study import archived_study
from uqpen.verification.check_result import CheckOutcome

PAGE = (Path(__file__).parents[2] / "docs" / "extending" / "model.md").read_text(encoding="utf-8")
MODEL = re.findall(r"```python\n(# my_model.py.*?)```", PAGE, re.DOTALL)[0]
STUDY = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)[0]


@pytest.fixture
def folder(tmp_path):
    """A folder with the file of the page."""
    (tmp_path / "my_model.py").write_text(MODEL)
    return tmp_path


@pytest.fixture
def archive(folder):
    """The archive of the page's study, beside which the file is not."""
    uqpen.write(uqpen.run(uqpen.parse_study(STUDY, folder=folder)), folder / "a.nc")
    (folder / "my_model.py").unlink()
    return folder / "a.nc"


def _outcomes(path, **options):
    found = {check.name: check for check in uqpen.verify(path, **options)}
    return {
        name: check.text for name, check in found.items() if check.verdict is not CheckOutcome.EQUAL
    }


def test_its_contract_is_kept(folder):
    study = uqpen.parse_study(STUDY, folder=folder)
    inputs = {
        "mass": np.array([1.0, 10.0, 500.0]),
        "stiffness": np.full(3, 1500.0),
        "gravity": np.full(3, 9.81),
        "travel": np.full(3, 0.1),
    }
    check_model(study.model, inputs)


def test_settings_defaults_and_conditions_are_those_of_the_class(folder):
    study = uqpen.parse_study(STUDY, folder=folder)
    linear = 10 * 9.81 / 2000
    point = {"mass": 10.0, "stiffness": 2000.0, "gravity": 9.81, "travel": 0.1}
    results = study.model.evaluate({name: np.array([value]) for name, value in point.items()})
    assert results.outputs["deflection"][0] == linear / (1 + 1.5 * linear / 0.1)
    tree = uqpen.run(study)
    assert float(tree["runs/some"]["gravity"]) == 9.81
    assert tree["runs/some"]["deflection"].attrs["display_units"] == "mm"
    assert tree["trajectory"]["mass"].sizes == {"deflection": 20}
    heavy = STUDY.replace("(10 ± 1) kg", "(100 ± 60) kg")
    status = uqpen.run(uqpen.parse_study(heavy, folder=folder))["runs/some"]["status"].values
    assert {Status.OK, Status.INADMISSIBLE} <= set(status)


@pytest.mark.slow
def test_workers_and_an_object_of_python_give_the_same_archive(folder):
    study = uqpen.parse_study(STUDY, folder=folder)
    for workers in (1, 2):
        uqpen.make_archive(study, folder / f"{workers}.nc", workers=workers)
    assert (folder / "1.nc").read_bytes() == (folder / "2.nc").read_bytes()
    names = {"__name__": "__main__"}
    exec(MODEL, names)
    made = uqpen.Study(
        names["Spring"](hardening=1.5),
        inputs={
            "mass": uqpen.Normal("10 kg", "1 kg"),
            "stiffness": uqpen.Uniform("1 N/mm", "2 N/mm"),
        },
        outputs={"deflection": uqpen.OutputSpec(exceeds=["40 mm"])},
        designs={"some": uqpen.LatinHypercube(runs=160)},
        seed=1,
        folder=folder / "none",
    )
    assert 'object = "Spring"' in made.to_toml()
    with pytest.warns(RuntimeWarning, match='"Spring" is a class of your own, so another version'):
        tree = uqpen.make_archive(made, folder / "object.nc", workers=2)
    runs = uqpen.open_archive(folder / "1.nc")["runs/some"]["deflection"]
    assert np.array_equal(tree["runs/some"]["deflection"], runs)
    unchecked = _outcomes(folder / "object.nc")
    assert "Spring is an object of the Python program" in unchecked["runs"]
    assert _outcomes(folder / "object.nc", model=names["Spring"](hardening=1.5)) == {}
    (folder / "object.toml").write_text(made.to_toml())
    with pytest.raises(StudyError, match="a file cannot contain a Python object"):
        uqpen.load_study(folder / "object.toml")


class TestArchive:
    def test_without_trust_its_runs_are_data(self, archive):
        named = "my_model.py:Spring"
        assert _outcomes(archive) == {
            "runs": f"not repeated: they execute code that the archive names ({named})",
            "surrogates": f"not checked: they follow from models that are not loaded ({named})",
        }
        study = archived_study(uqpen.open_archive(archive), archive.parent, trust=False)
        names = [each.name for each in study.model.inputs]
        assert names == ["mass", "stiffness", "gravity", "travel"]
        with pytest.raises(ModelError, match=r"my_model.py:Spring is not loaded"):
            study.model.evaluate({})

    def test_with_trust_all_is_repeated(self, archive):
        assert _outcomes(archive, trust=True) == {}

    def test_it_is_prepared_before_runs_are_made_and_made_again(self, folder):
        prepares = "    def prepare(self):\n        type(self).is_ready = True\n\n"
        evaluates = "    def evaluate(self, inputs):\n"
        model = MODEL.replace(evaluates, f"{prepares}{evaluates}        assert self.is_ready\n")
        (folder / "my_model.py").write_text(model)
        tree = uqpen.run(uqpen.parse_study(STUDY, folder=folder))
        assert (tree["runs/some"]["status"] == Status.OK).all()
        uqpen.write(tree, folder / "a.nc")
        assert _outcomes(folder / "a.nc", trust=True) == {}

    def test_code_is_executed_only_with_trust(self, folder, command_line):
        trace = folder / "executed"
        touch = f"import pathlib\npathlib.Path({str(trace)!r}).touch()\n"
        (folder / "my_model.py").write_text(touch + MODEL)
        uqpen.write(uqpen.run(uqpen.parse_study(STUDY, folder=folder)), folder / "a.nc")
        trace.unlink()
        for command in ("show", "verify", "report"):
            assert command_line(command, "a.nc").code == 0
        refused = command_line("rerun", "a.nc")
        assert refused.code == 2
        assert "my_model.py:Spring" in refused.err
        assert not trace.exists()
        assert command_line("rerun", "a.nc", "--trust").code == 0
        assert command_line("diff", "a.nc", "a_rerun.nc").code == 0
        assert trace.exists()


class Raising(Model):
    """Fails for some inputs in every way that a class can."""

    name = "raising"
    inputs = (Input("x", "m"),)
    outputs = (Output("y", "m"),)

    def evaluate(self, inputs):
        if (inputs["x"] > 2).any():
            raise ZeroDivisionError("nothing left")
        return Results.all_ok({"y": inputs["x"][:1] if (inputs["x"] < 1).all() else inputs["x"]})


def test_an_exception_costs_one_run(tmp_path):
    study = uqpen.Study(
        Raising(),
        inputs={"x": uqpen.Uniform("0 m", "2.2 m")},
        designs={"some": uqpen.MonteCarlo(runs=100)},
        failures={"at_most": 0.5},
        seed=1,
        folder=tmp_path,
    )
    runs = uqpen.run(study)["runs/some"]
    failed = runs["x"].values > 2
    assert 0 < failed.sum() < 30
    assert np.array_equal(runs["status"] == Status.FAILED, failed)
    assert set(runs["lost_reason"].values) == {"ZeroDivisionError: nothing left"}
    assert np.array_equal(runs["y"].values[~failed], runs["x"].values[~failed])


@pytest.mark.parametrize(
    ("before", "after", "key", "found"),
    [
        ("my_model.py:Spring", "no.py:Spring", "model.use", 'there is no file "no.py"'),
        ("my_model.py:Spring", "sub/my_model.py:Spring", "model.use", 'no file "sub/my_model.py"'),
        ("my_model.py:Spring", "my_model.py:Sprig", "model.use", "it defines Spring"),
        ("my_model.py:Spring", "spring", "model.use", '"spring"'),
        ("hardening = 1.5", "hardening = -1", "model.hardening", "-1"),
        ("hardening = 1.5", "stiff = 1", "model.stiff", "an unknown key"),
        ("class Spring(Model)", "class Spring", "model.use", "does not derive from Model"),
        ("@dataclass(frozen=True)", "@dataclass", "model.use", "is no frozen dataclass"),
        ('name = "spring"', "", "model.use", "which has no name"),
        ('outputs = (Output("deflection", "m", display_unit="mm"),)', "", "use", "no outputs"),
        ('"kg s-2", "s', '"N/mm", "s', "model.use", "Input('stiffness', 'N/mm')"),
        ('"kg s-2", "s', '"foo", "s', "model.use", "Input('stiffness', 'foo')"),
        ('Input("gravity"', 'Input("mass"', "model.use", "Input('mass', 'm s-2')"),
        ("import numpy as np\n", "import numpi as np\n", "model.use", "No module named 'numpi'"),
    ],
)
def test_a_mistake_is_reported_with_its_line(folder, before, after, key, found):
    study = re.sub(" +=", " =", STUDY)
    assert before in MODEL + study
    (folder / "my_model.py").write_text(MODEL.replace(before, after))
    with pytest.raises(StudyError) as caught:
        uqpen.parse_study(study.replace(before, after), folder=folder)
    (problem, *_) = [each for each in caught.value.problems if found in each.found]
    assert key in problem.key
    assert re.search(r"study\.toml:\d+ ", str(caught.value))


def test_a_condition_that_raises_names_the_class_and_the_method(folder):
    (folder / "my_model.py").write_text(MODEL.replace("linear < 10", "1 / 0 < 10"))
    with pytest.raises(ModelError, match="Spring: conditions failed: ZeroDivisionError"):
        uqpen.parse_study(STUDY, folder=folder)


@pytest.mark.parametrize(
    ("variables", "found"),
    [
        ({"inputs": (Input("x", "mm"),)}, "Own, which has Input('x', 'mm')"),
        ({"outputs": ()}, "Own, which has no outputs"),
        ({"name": None}, "Own, which has no name"),
        ({"outputs": (Output("y", "m", display_unit="kg"),)},
         "Own, which has Output('y', 'm') with display_unit='kg'"),
        (
            {"inputs": (Input("x", "m", default="5 mm"),)},  # type: ignore[arg-type]
            "Own, which has Input('x', 'm') with default='5 mm'",
        ),
        (
            {"inputs": (Input("x", "m", bounds=(0, 1)),)},  # type: ignore[arg-type]
            "Own, which has Input('x', 'm') with bounds=(0, 1)",
        ),
        ({"enforced_limits": 3}, "Own, which has enforced_limits = 3"),
        ({"alternatives": (("x", "z"),)}, "Own, which has alternatives = (('x', 'z'),)"),
        ({"outputs": (Output("y", "m", dims=(Dimension("x", "m", values=(1.0,)),)),)},
         "Own, which has Dimension('x', 'm') with the name of a variable"),
        ({"outputs": (Output("y", "m", dims=(Dimension("t", "ms", values=(1.0,)),)),)},
         "Own, which has Dimension('t', 'ms')"),
        (
            {
                "outputs": tuple(
                    Output(name, "m", dims=(Dimension("t", "s", values=(end,)),))
                    for name, end in (("y", 1.0), ("z", 2.0))
                )
            },
            "Own, which has Dimension('t', 's') with other coordinates in z",
        ),
    ],
)  # fmt: skip
def test_a_mistake_of_an_object_names_the_argument(tmp_path, variables, found):
    own = type("Own", (Raising,), variables)
    with pytest.raises(StudyError, match=r"uqpen\.Study\(model=…\)") as caught:
        uqpen.Study(
            own(),
            inputs={"x": uqpen.Uniform("0 m", "1 m")},
            designs={"some": uqpen.MonteCarlo(runs=10)},
            seed=1,
            folder=tmp_path,
        )
    (problem,) = caught.value.problems
    assert problem.found == found


def test_an_object_among_the_modules_that_raises_is_none_of_the_study(tmp_path, monkeypatch):
    class Strange:
        def __getattr__(self, name):
            raise RuntimeError(name)

    monkeypatch.setitem(sys.modules, "strange", Strange())
    (tmp_path / "own.py").write_text("def f(x):\n    return x\n")
    module, name, _ = load_module("own.py:f", tmp_path)
    assert getattr(module, name)(3) == 3
