"""Statistics of fields: at each place those of a scalar output, of the runs that exist there."""

import numpy as np
import pytest
import xarray as xr

from uqpen.core.labels import RUN
from uqpen.core.model import Dimension, Input, Output
from uqpen.core.sampling import Sampling
from uqpen.execution import Evaluator, evaluate
from uqpen.models.python_function import PythonFunction
from uqpen.statistics import analyze
from uqpen.statistics.model_form import model_differences
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.user_defined_analysis import UserDefinedAnalysis

CURVE = Output("curve", "1", dims=(Dimension("time", "s", values=(0.0, 1.0, 2.0)),))
QUANTITIES = [QuantityOfInterest(output, "1") for output in (CURVE, Output("y", "1"))]


@pytest.fixture(scope="module")
def runs():
    outputs = (CURVE, Output("y", "1"))
    model = PythonFunction(
        lambda x: {"curve": [x, 2 * x, 3 * x], "y": x},
        "f",
        (Input("x", "1"),),
        outputs,
        dict.fromkeys(("x", "curve", "y"), "1"),
    )
    x = np.random.default_rng(1).normal(size=40)
    points = xr.Dataset({"x": (RUN, x, {"role": "input"})}, {RUN: np.arange(40)})
    made = evaluate(Evaluator(model), points, {})
    return made.assign_attrs(sampling=str(Sampling.INDEPENDENT))


def test_a_statistic_has_the_dimensions_of_its_field_first(runs):
    found = analyze.analyze(runs, QUANTITIES)
    assert list(found["curve"])[:3] == ["mean", "std", "quantile"]
    assert found["curve"]["mean"].dims == ("time", "bound")
    assert found["curve"]["quantile"].dims == ("time", "probability", "bound")
    expected = runs["x"].values.mean() * np.array([1, 2, 3])
    assert found["curve"]["mean"].values[:, 0] == pytest.approx(expected)
    assert found["curve"]["mean"].attrs["runs_used"] == 40
    assert {"mean", "quantile", "cdf", "first_order"} <= found["y"].keys()


def test_user_defined_analyses_take_scalars_only(runs):
    seen = []

    def note(sample, quantity):
        seen.append(quantity.output.name)
        return []

    analyze.analyze(
        runs, QUANTITIES, only=(), user_defined=[UserDefinedAnalysis("note.py:note", note)]
    )
    assert seen == ["y"]


def test_differences_of_models_are_at_each_place(runs):
    other = runs.assign(curve=runs["curve"] + runs["time"] * runs["x"])
    found = model_differences(runs, other, QUANTITIES)
    assert list(found["curve"])[:3] == ["mean", "std", "quantile"]
    expected = runs["x"].values.mean() * np.array([0, 1, 2])
    assert found["curve"]["mean"].values[:, 0] == pytest.approx(expected)
