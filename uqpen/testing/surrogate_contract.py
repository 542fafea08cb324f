"""Contract test for surrogates."""

from __future__ import annotations

import pickle
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

from uqpen.archive.netcdf import read_groups, write_tree
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import SAMPLING
from uqpen.core.model import Category, Input, Model, Output, Results
from uqpen.core.netcdf.opening import open_own
from uqpen.core.streams import Stream
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quadrature import Quadrature
from uqpen.designs.rounds import first_round
from uqpen.execution import Evaluator, evaluate
from uqpen.surrogates.fitted_surrogate import FittedSurrogate, Prediction
from uqpen.surrogates.surrogate import Surrogate
from uqpen.testing.example import example_joint_distribution

__all__ = ["check_surrogate"]


def check_surrogate(surrogate: Surrogate) -> None:
    """Check the contract of a surrogate, with a smooth function of two inputs.

    It is fitted to 80 runs, or to a quadrature if it needs one. It predicts other runs better than
    their mean does. Predictions depend neither on the batch nor on the order of points, and their
    standard deviations, if any, are not negative. The same stream gives the same predictions. An
    output that cannot be fitted has a reason. It survives pickling and an archive, to the bit.

    Parameters
    ----------
    surrogate : Surrogate
        With any settings; its design and its check may have any names.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    joint, model = example_joint_distribution(), _Smooth()
    design = Quadrature(order=6) if surrogate.needs_quadrature else LatinHypercube(80, 1)
    training, others = (
        evaluate(
            Evaluator(model), first_round(each, joint, Stream(1, "designs", str(number))), {}
        ).assign_attrs({SAMPLING: str(each.sampling)})
        for number, each in enumerate((design, MonteCarlo(100)))
    )
    fitted, repeated = (
        surrogate.fit("example", training, model, joint, Stream(1, "surrogates", "example"))
        for _ in range(2)
    )
    _check_description(fitted, training)
    inputs = {name: others[name].values for name in fitted.random_inputs}
    found = _check_prediction(fitted, inputs)
    _check_same_prediction(found, _check_prediction(repeated, inputs), "the same stream fits alike")
    error = found.mean - others["smooth"].values
    assert np.mean(error**2) < np.var(others["smooth"].values), "it predicts other runs"
    scale = float(np.ptp(found.mean))
    for rows, rule in (
        (slice(3, 4), "a prediction does not depend on the batch"),
        (slice(None, None, -1), "a prediction does not depend on the order of points"),
    ):
        part = _check_prediction(fitted, {name: v[rows].copy() for name, v in inputs.items()})
        # A product of matrices has other last bits for another number of rows.
        np.testing.assert_allclose(found.mean[rows], part.mean, atol=1e-6 * scale, err_msg=rule)
        assert (found.std is None) == (part.std is None), rule
        if found.std is not None and part.std is not None:
            # A variance near 0 is what is left of large numbers.
            one, other = found.std[rows] ** 2, part.std**2
            np.testing.assert_allclose(one, other, atol=1e-8 * scale**2, err_msg=rule)
    again = pickle.loads(pickle.dumps(fitted))
    rule = "a pickled copy is the same surrogate"
    _check_same_prediction(found, _check_prediction(again, inputs), rule)
    tree = fitted.with_check(others).to_tree()
    restored = type(surrogate).restore(_from_file(tree), "example", None)
    rule = "a restored surrogate is the same"
    _check_same_prediction(found, _check_prediction(restored, inputs), rule)
    _check_description(restored, training)
    assert restored.to_tree().identical(tree), rule


def _check_description(fitted: FittedSurrogate, training: xr.Dataset) -> None:
    """Check what a fitted surrogate says of itself and of its training runs."""
    assert isinstance(fitted, FittedSurrogate), "fit returns a FittedSurrogate"
    assert [output.name for output in fitted.outputs] == ["smooth"], "it fits what can be fitted"
    rule = "an output that cannot be fitted has a reason"
    assert {name for name, reason in fitted.reasons.items() if reason} == {"constant", "sign"}, rule
    assert set(fitted.random_inputs) == {"length", "share"}, "random_inputs are those that vary"
    assert dict(fitted.fixed) == {"mass": 5.0}, "fixed has the values of the other inputs"
    values = training["smooth"].values
    limits = float(values.min()), float(values.max())
    assert fitted.training_range("smooth") == limits, "training_range is that of the runs"


class _Smooth(Model):
    """Model with an output of each sort: smooth, constant and categorical."""

    name = "smooth"
    inputs = (Input("length", "m"), Input("mass", "kg"), Input("share", "1"))
    outputs = (
        Output("smooth", "m"),
        Output("constant", "m"),
        Output("sign", "1", categories=(Category("minus", "minus"), Category("plus", "plus"))),
    )

    def evaluate(self, inputs: Mapping[str, FloatArray]) -> Results:
        length, share = inputs["length"], inputs["share"]
        smooth = length**2 + np.sin(share) + 0.1 * inputs["mass"]
        sign = (share > 0).astype(np.float64)
        return Results.all_ok({"smooth": smooth, "constant": np.ones_like(share), "sign": sign})


def _check_prediction(fitted: FittedSurrogate, inputs: Mapping[str, FloatArray]) -> Prediction:
    """Return the prediction of the smooth output at some points."""
    found = fitted.predict(inputs)
    assert set(found) == {output.name for output in fitted.outputs}, "it predicts its outputs"
    prediction = found["smooth"]
    runs = len(next(iter(inputs.values())))
    assert prediction.mean.shape == (runs,), "a mean for each point"
    assert np.isfinite(prediction.mean).all(), "predictions are finite"
    if prediction.std is not None:
        assert prediction.std.shape == (runs,), "a std for each point, or None"
        assert (prediction.std >= 0).all(), "a std is not negative"
    return prediction


def _check_same_prediction(one: Prediction, other: Prediction, rule: str) -> None:
    assert np.array_equal(one.mean, other.mean), rule
    assert (one.std is None) == (other.std is None), rule
    if one.std is not None and other.std is not None:
        assert np.array_equal(one.std, other.std), rule


def _from_file(tree: xr.DataTree) -> xr.DataTree:
    """Return a group as it is read from an archive."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "surrogate.nc"
        write_tree(tree, path)
        with open_own(path) as root:
            return read_groups(root)
