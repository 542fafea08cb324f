"""What a model class of the user's returns: fields, curves that end, and everything wrong."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from study_text import study_text

import uqpen
from uqpen.core.errors import ModelError, TrajectoryError
from uqpen.core.model import Dimension, Input, Model, Output, Results
from uqpen.core.status import Status
from uqpen.models.user_defined_model import UserDefinedModel

PLACE = Dimension("place", "m", values=(0.0, 1.0, 2.0))
RUNS = {"x": np.array([0.5, 1.5, 2.5])}
STATUSES = "Status.OK, Status.INADMISSIBLE, Status.FAILED, Status.NOT_FINITE, "
KNOWN = f"{STATUSES}Status.TIMED_OUT, Status.CRASHED"


class Bar(Model):
    """A curve that ends early where x is large, and its length."""

    name = "bar"
    inputs = (Input("x", "m"),)
    outputs = (Output("y", "m"), Output("curve", "m", dims=(PLACE,), may_end=True))

    def evaluate(self, inputs):
        curve = inputs["x"][:, np.newaxis] * np.arange(1.0, 4.0)
        return Results.all_ok({"y": inputs["x"], "curve": np.where(curve > 4, np.nan, curve)})


def answering(evaluate, *outputs):
    """A user-defined model whose `evaluate` is a function."""
    methods = {"evaluate": lambda self, inputs: evaluate(inputs)}
    if outputs:
        methods["outputs"] = outputs
    return UserDefinedModel(type("Answering", (Bar,), methods)(), "own")


def test_curves_that_end_are_archived_and_verified(tmp_path):
    own = type("Own", (Bar,), {})()
    study = uqpen.Study(
        own,
        inputs={"x": uqpen.Uniform("0 m", "2 m")},
        designs={"some": uqpen.MonteCarlo(runs=40)},
        seed=1,
        folder=tmp_path,
    )
    with pytest.warns(RuntimeWarning, match="class of your own"):
        tree = uqpen.make_archive(study, tmp_path / "a.nc")
    runs = tree["runs/some"]
    assert runs["curve"].dims == ("run", "place")
    assert (runs["status"] == Status.OK).all()
    ended = runs["x"].values > 4 / 3
    assert 0 < ended.sum() < 40
    assert np.array_equal(np.isnan(runs["curve"].values[:, 2]), ended)
    checks = uqpen.verify(tmp_path / "a.nc", model=own)
    assert {check.name: check.verdict.name for check in checks}["runs"] == "EQUAL"


def test_a_wrong_shape_costs_the_runs_that_have_it():
    def evaluate(inputs):
        places = 2 if (inputs["x"] > 2).any() else 3
        return Results.all_ok({"y": inputs["x"], "curve": np.ones((len(inputs["x"]), places))})

    results = answering(evaluate).evaluate(RUNS)
    assert results.status.tolist() == [Status.OK, Status.OK, Status.FAILED]
    assert results.outputs["curve"].shape == (3, 3)
    reason = 'returned a "curve" of shape (1, 2), not (1, 3) along (run, place)'
    assert results.reasons == {2: reason}


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (None, "returned NoneType, not Results"),
        (Results({}, np.zeros(1, np.int8)), 'returned no "y"'),
        (Results({"y": np.array(["a"])}, np.zeros(1, np.int8)), 'returned a "y" of '),
        (Results({"y": np.ones(1)}, np.zeros((), np.int8)),
         "returned a status of shape (), not (1,)"),
        (Results({"y": np.ones(1)}, np.full(1, 77, np.int8)),
         f"returned a status 77, not one of {KNOWN}"),
        (Results({"y": np.ones(1)}, np.zeros(1, np.int8), files=None), "TypeError: "),  # type: ignore[arg-type]
        (Results({"y": np.ones(1)}, np.full(1, 2, np.int8), {0: "two\nlines"}), "two lines"),
    ],
)  # fmt: skip
def test_an_answer_of_another_kind_is_the_reason_of_a_failed_run(answer, reason):
    model = answering(lambda inputs: answer, Output("y", "m"))
    results = model.evaluate({"x": np.ones(1)})
    assert results.status.tolist() == [Status.FAILED]
    assert results.reasons[0].startswith(reason)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), SystemExit(3), GeneratorExit()])
@pytest.mark.parametrize("method", ["evaluate", "conditions", "prepare"])
def test_an_exit_of_its_own_ends_no_study(error, method, monkeypatch):
    def leave(*arguments):
        raise error

    monkeypatch.setattr("uqpen.models.user_defined_model.is_user_interrupt", lambda error: False)
    monkeypatch.setattr("uqpen.models.user_code.is_user_interrupt", lambda error: False)
    model = UserDefinedModel(type("Leaving", (Bar,), {method: leave})(), "own")
    named = type(error).__name__
    if method == "evaluate":
        reasons = model.evaluate(RUNS).reasons.values()
        assert {reason.partition(":")[0] for reason in reasons} == {named}
        return
    with pytest.raises(ModelError, match=f"own: {method} failed: {named}"):
        list(model.conditions(RUNS)) if method == "conditions" else model.prepare()


def test_the_users_interrupt_ends_it(monkeypatch):
    def leave(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("uqpen.models.user_defined_model.is_user_interrupt", lambda error: True)
    with pytest.raises(KeyboardInterrupt):
        answering(leave).evaluate(RUNS)
    with pytest.raises(KeyboardInterrupt):
        UserDefinedModel(type("Leaving", (Bar,), {"prepare": leave})(), "own").prepare()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_child_that_it_forks_ends():
    parent = os.getpid()

    def evaluate(inputs):
        child = os.fork()
        if child:
            os.waitpid(child, 0)
        return Bar().evaluate(inputs)

    results = answering(evaluate).evaluate(RUNS)
    assert os.getpid() == parent
    assert (results.status == Status.OK).all()


def test_its_inputs_and_streams_are_its_own():
    def evaluate(inputs):
        sys.stdout = None  # type: ignore[assignment]
        inputs["x"] *= 2
        return Bar().evaluate(inputs)

    stdout, points = sys.stdout, np.broadcast_to(RUNS["x"], 3)
    results = answering(evaluate).evaluate({"x": points})
    assert sys.stdout is stdout
    assert results.outputs["y"].tolist() == [1.0, 3.0, 5.0]
    assert points.tolist() == [0.5, 1.5, 2.5]


@pytest.mark.parametrize(
    ("mask", "found"),
    [
        (np.ones(2, np.bool_), "bool of shape (2,), not bool of shape (3,)"),
        (np.ones(3), "float64 of shape (3,), not bool of shape (3,)"),
    ],
)
def test_a_condition_is_a_truth_value_for_each_run(mask, found):
    conditions = {"conditions": lambda self, inputs: [(mask, "x > 0")]}
    model = UserDefinedModel(type("Conditional", (Bar,), conditions)(), "own")
    with pytest.raises(ModelError) as caught:
        list(model.conditions(RUNS))
    assert str(caught.value) == f"own: conditions failed: ValueError: a condition is {found}"


def test_a_trajectory_is_a_dataset():
    other = {"trajectory": lambda self, inputs: {"x": 1}}
    model = UserDefinedModel(type("Other", (Bar,), other)(), "own")
    with pytest.raises(TrajectoryError, match=r"returned dict, not an xarray\.Dataset"):
        model.trajectory({"x": 1.0})


def test_without_trust_the_fields_of_an_archive_are_data(tmp_path):
    (tmp_path / "bar.py").write_text(Path(__file__).read_text(encoding="utf-8"))
    text = study_text(
        "bar.py:Bar",
        inputs={"x": ("0 m", "2 m")},
        designs={"some": {"kind": "monte-carlo", "runs": 20}},
    )
    uqpen.write(uqpen.run(uqpen.parse_study(text, folder=tmp_path)), tmp_path / "a.nc")
    without, with_trust = (
        {check.name: check for check in uqpen.verify(tmp_path / "a.nc", trust=trust)}
        for trust in (False, True)
    )
    assert "they execute code" in without["runs"].text
    assert without["statistics"].verdict.name == with_trust["runs"].verdict.name == "EQUAL"
