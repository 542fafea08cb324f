"""Endings of a program that a study declares as outcomes: completed runs without numbers."""

import sys

import numpy as np
import pytest

import uqpen
from uqpen.statistics.joint_probability import joint_probabilities

COLUMN = """\
import os, signal, sys
load = float(sys.argv[1])
if load > 130:
    print("COLUMN UNSTABLE at step 3")
    os.kill(os.getpid(), signal.SIGKILL) if load > 138 else sys.exit(7)
if load < 70:
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
    # Failed, completed, not finite, completed, twice unstable; a signal is never an outcome.
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
runs = 60
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
    assert ends.sum() > 2
    found = tree["joint_probabilities/mc/joint_probability"].sel(bound="estimate")
    by_event = {str(each.event.values): each.item() for each in found}
    fails = (high | ends).sum() / known.sum()
    assert by_event["fails"] == pytest.approx(fails)
    assert by_event["holds"] == pytest.approx(1 - fails)
    whole, by_blocks = (
        joint_probabilities(runs, study.joint_events, 0.95, in_memory=size)["joint_probability"]
        for size in (1000, 20)
    )
    assert np.allclose(by_blocks, whole)
    says = ["in which all its outputs" in str(each) for each in whole["note"].values]
    assert dict(zip(by_event, says, strict=True)) == {"fails": False, "holds": False, "high": True}
    assert by_blocks["note"].values.tolist() == whole["note"].values.tolist()
    assert by_event["high"] == pytest.approx(high.sum() / (known & ~ends).sum())


def test_an_unknown_outcome_in_an_event_is_told_with_those_known(column):
    text = STUDY + '[joint_probabilities]\nfails = ["unstabel"]\n'
    with pytest.raises(uqpen.StudyError, match="or an outcome, unstable"):
        column("[model.outcomes]\nunstable = { exit = 7 }", text)


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ("unstable = { exit = 0 }", ".unstable.exit: 0; an exit code from 1 to 255"),
        ("unstable = { exit = true }", ".unstable.exit: true; an exit code from 1 to 255"),
        (
            "unstable = { text = '' }",
            '.unstable.text: ""; a text in a line that the program prints',
        ),
        (
            "unstable = { exit = 7, text = 'a' }",
            '.unstable: exit and text; how it is known, { exit = 7 } or { text = "UNSTABLE" }',
        ),
        (
            "unstable = 7",
            '.unstable: 7; how it is known, { exit = 7 } or { text = "UNSTABLE" }',
        ),
        ("unstable = { exit = 7, code = 8 }", ".unstable.code: an unknown key; known: exit, text"),
        (
            "completed = { exit = 7 }",
            '.completed: "completed"; another name: it has all other runs',
        ),
    ],
)
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
