"""Runs of models whose outputs have dimensions."""

import numpy as np
import pytest
import xarray as xr

from uqpen.core.labels import FAILURE_REASON, RUN, STATUS
from uqpen.core.lookup import resolve
from uqpen.core.model import Dimension, Input, Output
from uqpen.core.status import Status
from uqpen.execution import EvaluationOptions, Evaluator, evaluate
from uqpen.execution.processes import processes
from uqpen.models.python_function import PythonFunction
from uqpen.reductions import REDUCTIONS
from uqpen.reductions.derived import derived_outputs

DAY = 86_400.0
TIME = Dimension("time", "s", "", "day", (0.0, DAY, 2 * DAY, 3 * DAY))
DEPTH = Dimension("depth", "m", values=(0.0, 0.5))
CURVE = Output("curve", "m", display_unit="cm", dims=(TIME,))
ENDING = Output("curve", "m", display_unit="cm", dims=(TIME,), may_end=True)
SHEET = Output("sheet", "1", dims=(TIME, DEPTH))


def model(function, *outputs, vectorized=False):
    units = {"x": "1", **{output.name: output.preferred_unit for output in outputs}}
    return PythonFunction(function, "f", (Input("x", "1"),), outputs, units, vectorized)


def made(function, *outputs, runs=4, **options):
    return evaluate(Evaluator(model(function, *outputs, **options)), points_of(runs), {})


def points_of(runs):
    return xr.Dataset({"x": (RUN, np.arange(float(runs)))}, {RUN: np.arange(runs)})


def curve(x):
    """A curve in cm, with faults in some runs."""
    values = x + np.arange(4.0)
    if x == 1:
        values[2] = np.nan
    if x == 2:
        values[2:] = np.nan
    if x == 3:
        values = values[:3]
    return {"curve": values, "sheet": np.outer(values, [1.0, 2.0])}


def test_a_field_has_the_runs_first_and_its_coordinates():
    runs = made(curve, CURVE, SHEET, runs=1)
    assert runs["curve"].dims == (RUN, "time")
    assert runs["sheet"].dims == (RUN, "time", "depth")
    assert runs["curve"].values.tolist() == [[0.0, 0.01, 0.02, 0.03]]
    assert runs["sheet"].sel(depth=0.5).values.tolist() == [[0.0, 2.0, 4.0, 6.0]]
    assert runs["time"].values.tolist() == [0.0, DAY, 2 * DAY, 3 * DAY]
    described = {"units": "s", "display_units": "day", "long_name": "time"}
    assert runs["time"].attrs == described


def test_the_reason_of_a_failed_run_names_the_place():
    runs = made(curve, CURVE)
    lost = [Status.NOT_FINITE, Status.NOT_FINITE, Status.FAILED]
    assert runs[STATUS].values.tolist() == [Status.OK, *lost]
    assert runs[FAILURE_REASON].values.tolist() == [
        *(["curve is nan at time = 2 day"] * 2),
        'returned a "curve" of shape (3,), not (4,) along (time)',
    ]
    assert np.isnan(runs["curve"].values[1:]).all()


def test_of_several_dimensions_all_coordinates_are_named():
    runs = made(curve, SHEET, runs=2)
    assert runs[FAILURE_REASON].values.tolist() == ["sheet is nan at time = 2 day, depth = 0 m"]


def test_a_curve_that_may_end_is_a_result():
    runs = made(curve, ENDING)
    assert runs[STATUS].values.tolist() == [Status.OK, Status.NOT_FINITE, Status.OK, Status.FAILED]
    assert np.isnan(runs["curve"].values[2]).tolist() == [False, False, True, True]
    assert runs["curve"].attrs["comment"] == "NaN after the end of the curve"


@pytest.mark.parametrize(
    ("returned", "reason"),
    [
        (1.0, 'returned a "curve" of shape (), not (4,) along (time)'),
        (["a"] * 4, 'returned a "curve" of text in place of numbers'),
        ([[1.0], [2.0, 3.0]], 'returned a "curve" of lists of different lengths'),
        ([[1.0] * 4], 'returned a "curve" of shape (1, 4), not (4,) along (time)'),
    ],
)
def test_another_shape_is_a_failed_run(returned, reason):
    runs = made(lambda x: {"curve": returned}, CURVE, runs=1)
    assert runs[FAILURE_REASON].values.tolist() == [reason]


def test_a_labelled_array_is_taken_by_the_names_of_its_dimensions():
    other = Dimension("depth", "m", values=(0.0, 0.5, 1.0, 1.5))  # as many as of the time
    values = xr.DataArray(np.arange(16.0).reshape(4, 4), dims=["depth", "time"])
    output = Output("sheet", "1", dims=(TIME, other))
    runs = made(lambda x: {"sheet": values}, output, runs=1)
    assert runs["sheet"].values[0].tolist() == values.T.values.tolist()
    unnamed = made(lambda x: {"sheet": values.values}, output, runs=1)
    assert unnamed["sheet"].values[0].tolist() == values.values.tolist()


def derived(function, *named):
    outputs = [
        derived
        for name in named
        for derived in derived_outputs(name, CURVE, resolve(REDUCTIONS[name])())
    ]
    return evaluate(Evaluator(model(function, CURVE).with_derived(outputs)), points_of(3), {})


def test_a_run_whose_derived_number_overflows_is_lost_with_a_reason():
    runs = derived(lambda x: {"curve": np.full(4, 1e307 * x)}, "integral", "max")
    assert runs[STATUS].values.tolist() == [Status.OK, Status.NOT_FINITE, Status.NOT_FINITE]
    assert runs[FAILURE_REASON].values.tolist() == ["integral is inf, from curve"] * 2
    for name in ("curve", "integral", "max"):
        assert np.isnan(runs[name].values[1:]).all()
        assert np.isfinite(runs[name].values[0]).all()


def vectorized(x):
    if (x == 5).any():
        raise ValueError("five")
    return {"curve": x[:, None] + np.arange(4.0)}


def test_a_vectorised_function_returns_runs_first():
    runs = made(vectorized, CURVE, runs=8, vectorized=True)
    assert runs[STATUS].values.tolist() == [0, 0, 0, 0, 0, Status.FAILED, 0, 0]
    assert runs[FAILURE_REASON].values.tolist() == ["ValueError: five"]
    assert runs["curve"].values[7].tolist() == [0.07, 0.08, 0.09, 0.1]
    wrong = made(lambda x: {"curve": np.zeros(4)}, CURVE, runs=3, vectorized=True)
    text = 'returned a "curve" of shape (4,), not (1, 4) along (run, time)'
    assert wrong[FAILURE_REASON].values.tolist() == [text] * 3


@pytest.mark.parametrize("options", [{}, {"vectorized": True}])
def test_workers_give_the_same_bytes(options):
    function = vectorized if options else curve
    alone = made(function, ENDING, runs=40, **options)
    evaluator = Evaluator(model(function, ENDING, **options))
    with processes(2) as pool:
        together = evaluate(evaluator, points_of(40), {}, EvaluationOptions(map=pool))
    xr.testing.assert_identical(alone, together)
    assert alone["curve"].values.tobytes() == together["curve"].values.tobytes()
