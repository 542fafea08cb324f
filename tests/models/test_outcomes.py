"""Endings of a run that a study declares as outcomes: completed runs without numbers."""

import sys

import numpy as np
import pytest

import uqpen
from uqpen.report.sections.summary import summary_lines
from uqpen.statistics.joint_probability import joint_probabilities

COLUMN = """\
import os, signal, sys
load = float(sys.argv[1])
if load > 130:
    print("COLUMN UNSTABLE at step 3")
    os.kill(os.getpid(), signal.SIGKILL) if load > 138 else sys.exit(7)
if load < 70:
    os.remove("stdout")
    sys.exit(3)
print("{\\"stress\\": %s}" % ("NaN" if 90 < load < 95 else 2 * load))
"""
STUDY = """\
seed = 1
[model]
command = ["PYTHON", "-SE", "column.py", "{load}"]
[model.inputs]
load = "kN"
[model.outputs]
stress = "MPa"
OUTCOMES
[inputs]
load = "100 kN"
[outputs.twice]
formula = "2 * stress"
[designs.table]
kind = "table"
file = "loads.csv"
"""
LOADS = [60.0, 80.0, 92.0, 100.0, 131.0, 135.0, 139.0]


@pytest.fixture
def column(tmp_path):
    (tmp_path / "column.py").write_text(COLUMN)
    (tmp_path / "loads.csv").write_text("load [kN]\n" + "".join(f"{each}\n" for each in LOADS))

    def study(outcomes, text=STUDY):
        text = text.replace("PYTHON", sys.executable).replace("OUTCOMES", outcomes)
        return uqpen.parse_study(text, folder=tmp_path)

    return study


@pytest.mark.parametrize("ending", ["exit = 7", 'text = "COLUMN UNSTABLE"'])
def test_a_run_that_ends_so_is_completed_without_numbers(ending, column):
    table = f"[model.outcomes]\nother = {{ exit = 9 }}\nunstable = {{ {ending} }}"
    runs = uqpen.run(column(table))["runs/table"].to_dataset()
    # Failed without stdout, completed, not finite, completed, twice unstable; a signal is never an
    # outcome.
    assert runs["status"].values.tolist() == [2, 0, 3, 0, 0, 0, 5]
    assert runs["outcome"].values.tolist() == [-1, 0, -1, 0, 2, 2, -1]
    stress = np.array([np.nan, 160e6, np.nan, 200e6, np.nan, np.nan, np.nan])
    assert np.array_equal(runs["stress"], stress, equal_nan=True)
    assert np.array_equal(runs["twice"], 2 * stress, equal_nan=True)
    assert runs["twice_occurs"].values.tolist() == [-1, 0, -1, 0, 1, 1, -1]
    assert runs["stress"].attrs["absent"] == "the run ends as other or unstable"


def test_it_decides_events_that_name_it(column):
    text = (
        STUDY.partition("[designs")[0]
        + """
[designs.mc]
kind = "monte-carlo"
runs = 30
[joint_probabilities]
fails = { any = ["stress > 200 MPa", "unstable"], sensitivities = true }
holds = ["stress < 200 MPa", "not unstable"]
high = ["stress > 200 MPa"]
"""
    )
    text = text.replace('load = "100 kN"', 'load = "(105 ± 25) kN"')
    study = column("[model.outcomes]\nunstable = { exit = 7 }", text)
    tree = uqpen.run(study)
    runs = tree["runs/mc"].to_dataset()
    known, ends = runs["status"].values == 0, runs["outcome"].values == 1
    high = runs["stress"].values > 200e6
    assert ends.sum() > 1
    found = tree["joint_probabilities/mc/joint_probability"].sel(bound="estimate")
    by_event = {str(each.event.values): each.item() for each in found}
    fails = (high | ends).sum() / known.sum()
    assert by_event["fails"] == pytest.approx(fails)
    assert by_event["holds"] == pytest.approx(1 - fails)
    whole, by_blocks = (
        joint_probabilities(runs, study.joint_events, 0.95, in_memory=size)["joint_probability"]
        for size in (1000, 10)
    )
    assert np.allclose(by_blocks, whole)
    share = f"{100 * ends.sum() / known.sum():.0f}\N{NO-BREAK SPACE}%"
    (line,) = (each for each in summary_lines(tree) if each.startswith("Outcome: "))
    assert f"“unstable” in {share} of cases (" in line
    says = ["in which all its outputs" in str(each) for each in whole["note"].values]
    assert dict(zip(by_event, says, strict=True)) == {"fails": False, "holds": False, "high": True}
    assert by_blocks["note"].values.tolist() == whole["note"].values.tolist()
    assert by_event["high"] == pytest.approx(high.sum() / (known & ~ends).sum())


def test_an_unknown_outcome_in_an_event_is_told_with_those_known(column):
    text = STUDY + '[joint_probabilities]\nfails = ["unstabel"]\n'
    with pytest.raises(uqpen.StudyError, match="or an outcome, unstable"):
        column("[model.outcomes]\nunstable = { exit = 7 }", text)
    # Another mistake in the model does not make it unknown.
    text = text.replace('load = "kN"', 'load = "kM"').replace("unstabel", "unstable")
    with pytest.raises(uqpen.StudyError) as error:
        column("[model.outcomes]\nunstable = { exit = 7 }", text)
    assert [each.key for each in error.value.problems] == ["model.inputs.load"]


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ("unstable = { exit = 0 }", ".unstable.exit: 0; an exit code from 1 to 255"),
        ("unstable = { exit = true }", ".unstable.exit: true; an exit code from 1 to 255"),
        ("unstable = { text = '' }",
         '.unstable.text: ""; a text in a line that the program prints'),
        ("unstable = { exit = 7, text = 'a' }",
         '.unstable: exit and text; how it is known, { exit = 7 } or { text = "UNSTABLE" }'),
        ("unstable = 7", '.unstable: 7; how it is known, { exit = 7 } or { text = "UNSTABLE" }'),
        ("unstable = { exit = 7, code = 8 }", ".unstable.code: an unknown key; known: exit, text"),
        ("completed = { exit = 7 }",
         '.completed: "completed"; another name: it has all other runs'),
        ('unstable = { exit = "7" }', '.unstable.exit: "7"; an exit code from 1 to 255'),
        ("stress = { exit = 7 }", '.stress: "stress"; another name: an output has it'),
        ("not = { exit = 7 }", '.not: "not"; another name: it joins the limits of an event'),
        ("a = { exit = 7 }\nb = { exit = 7 }",
         '.b: the ending of a; an ending of its own: all these runs have the outcome "a"'),
        ('a = { exception = "ValueError" }',
         '.a: exception; how it is known, { exit = 7 } or { text = "UNSTABLE" }'),
    ],
)  # fmt: skip
def test_mistakes_are_told(table, expected, column):
    with pytest.raises(uqpen.StudyError) as error:
        column(f"[model.outcomes]\n{table}")
    (problem,) = error.value.problems
    assert f"{problem.key}: {problem.found}; {problem.expected}" == f"model.outcomes{expected}"


@pytest.mark.parametrize("kind", ["form", "active-learning"])
def test_what_follows_numbers_is_refused(kind, column):
    design = f'kind = "{kind}"\nevent = "stress > 250 MPa"'
    text = STUDY.partition("kind =")[0] + design
    text = text.replace('load = "100 kN"', 'load = "(100 ± 10) kN"')
    with pytest.raises(uqpen.StudyError, match="runs that end so have no numbers to follow"):
        column("[model.outcomes]\nunstable = { exit = 7 }", text)
    column("", text)


# An exception of a Python function.


class SolverError(Exception):
    """Any failure of the solver."""


class UnstableError(SolverError):
    """The column buckles."""


def bend(load):
    if (load > 130).any():
        raise UnstableError(f"at {load}")
    if (load < 70).any():
        raise SolverError("the step is too small")
    return {"stress": np.where((load > 90) & (load < 95), np.nan, 2 * load)}


def bend_one(load):
    return {"stress": bend(np.array([load]))["stress"].item()}


@pytest.mark.parametrize(("function", "vectorized"), [(bend_one, False), (bend, True)])
@pytest.mark.parametrize("cls", [UnstableError, "UnstableError"])
def test_an_exception_is_an_outcome(function, vectorized, cls, tmp_path):
    units = {"load": "kN"}, {"stress": "MPa"}
    model = uqpen.PythonModel(function, *units, vectorized=vectorized, outcomes={"unstable": cls})
    (tmp_path / "loads.csv").write_text("load [kN]\n" + "".join(f"{each}\n" for each in LOADS))
    design = uqpen.TableDesign(tmp_path / "loads.csv")
    study = uqpen.Study(model, {"load": "100 kN"}, designs={"table": design}, seed=1)
    runs = uqpen.run(study)["runs/table"].to_dataset()
    # An exception above the class has failed, and a run without the number at its usual end, too.
    assert runs["status"].values.tolist() == [2, 0, 3, 0, 0, 0, 0]
    assert runs["outcome"].values.tolist() == [-1, 0, -1, 0, 1, 1, 1]
    assert runs["lost_reason"].values[1] == "stress is nan"


@pytest.mark.parametrize(
    ("named", "expected"),
    [
        ("UnstableErorr", 'the module of the function defines or imports; did you mean "Unst'),
        ("sys.path", "the class of an exception that the module of the function"),
        ("MemoryError", "another exception: MemoryError depends on the machine"),
        ("Exception", "a narrower class: TimeoutError is one of these, too"),
        ("OSError", "a narrower class: TimeoutError is one of these, too"),
    ],
)
def test_an_exception_that_cannot_be_one_is_told(named, expected):
    model = uqpen.PythonModel(
        bend_one, {"load": "kN"}, {"stress": "MPa"}, outcomes={"unstable": named}
    )
    with pytest.raises(uqpen.StudyError, match=expected):
        uqpen.Study(
            model, {"load": "(100 ± 9) kN"}, designs={"mc": uqpen.MonteCarlo(runs=9)}, seed=1
        )


def test_a_server_has_no_outcomes():
    model = 'umbridge = "http://127.0.0.1:1"\ninputs = { a = "1" }\noutputs = { b = "1" }\n'
    text = f"seed = 1\n[model]\n{model}[model.outcomes]\nbad = {{ text = 'BAD' }}\n"
    with pytest.raises(uqpen.StudyError, match="whose errors do not say how a run ended"):
        uqpen.parse_study(text, trust=False)


def test_several_models_have_the_same_outcomes():
    models = {
        name: uqpen.PythonModel(
            bend_one, {"load": "kN"}, {"stress": "MPa"}, outcomes={own: UnstableError}
        )
        for name, own in {"first": "unstable", "second": "buckled"}.items()
    }
    with pytest.raises(uqpen.StudyError, match="outcomes of its own") as error:
        uqpen.Study(models=models, inputs={"load": "9 kN"}, designs={}, seed=1)
    assert error.value.problems[0].key == "models.second.outcomes"
