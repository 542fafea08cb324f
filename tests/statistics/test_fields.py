"""Which analyses take outputs with dimensions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import xarray as xr

from uqpen.core.labels import RUN
from uqpen.core.model import Dimension, Input, Output
from uqpen.core.sampling import Sampling
from uqpen.execution import Evaluator, evaluate
from uqpen.models.python_function import PythonFunction
from uqpen.statistics import ANALYSES, FIELD_ANALYSES, analyze
from uqpen.statistics.model_differences import model_differences
from uqpen.statistics.outside import OutsideAnalysis
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample

CURVE = Output("curve", "1", dims=(Dimension("time", "s", values=(0.0, 1.0, 2.0)),))
QUANTITIES = [QuantityOfInterest(output, "1") for output in (CURVE, Output("y", "1"))]


@pytest.fixture(scope="module")
def runs() -> xr.Dataset:
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


def mean_by_place(
    sample: Sample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """The mean at each place of a field."""
    dims = [dimension.name for dimension in quantity.output.dims]
    yield "mean", xr.DataArray(sample.values.mean(axis=0), dims=dims)


def test_every_field_analysis_is_an_analysis() -> None:
    assert ANALYSES.keys() >= FIELD_ANALYSES


def test_others_take_scalars_only(runs: xr.Dataset) -> None:
    found = analyze.analyze(runs, QUANTITIES)
    assert found["curve"] == {}
    assert {"mean", "quantile", "cdf", "first_order"} <= found["y"].keys()


def test_a_listed_one_takes_the_whole_field(
    runs: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(analyze, "ANALYSES", {"moments": [f"{__name__}:mean_by_place"]})
    monkeypatch.setattr(analyze, "FIELD_ANALYSES", frozenset({"moments"}))
    monkeypatch.setattr(analyze, "resolve", lambda text: mean_by_place)
    found = analyze.analyze(runs, QUANTITIES)
    assert found["curve"]["mean"].dims == ("time",)
    expected = runs["x"].values.mean() * np.array([1, 2, 3])
    assert found["curve"]["mean"].values == pytest.approx(expected)
    assert found["curve"]["mean"].attrs["runs_used"] == 40


def test_analyses_from_outside_take_scalars_only(runs: xr.Dataset) -> None:
    seen = []

    def note(sample: Sample, quantity: QuantityOfInterest) -> list[tuple[str, xr.DataArray]]:
        seen.append(quantity.output.name)
        return []

    analyze.analyze(runs, QUANTITIES, only=(), outside=[OutsideAnalysis("note.py:note", note)])
    assert seen == ["y"]


def test_differences_of_models_are_of_scalars(runs: xr.Dataset) -> None:
    assert model_differences(runs, runs, QUANTITIES).keys() == {"y"}
