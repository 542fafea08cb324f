"""What is said of a fit is of the fit that is kept."""

import dataclasses
import math

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.core.labels import RUN
from uqpen.core.model import Input, Model, Output, Results
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.distributions.univariate import Uniform
from uqpen.execution import Evaluator, evaluate
from uqpen.results.json import archive_json
from uqpen.surrogates.chaos.basis import ProductBasis
from uqpen.surrogates.chaos.coefficients import cross_validation, sparse_regression
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos
from uqpen.surrogates.chaos.term_selection import FitPoints, Terms, regression_terms
from uqpen.surrogates.diagnostics import shown_diagnostics

PAIR = JointDistribution(
    tuple(RandomInput(Input(name, "1"), Uniform(0.0, 1.0), "1") for name in "ab"),
    tuple(Input(name, "1") for name in "ab"),
)


class Line(Model):
    """A line in two inputs."""

    name = "line"
    inputs = PAIR.variables
    outputs = (Output("y", "m"),)

    def evaluate(self, inputs):
        return Results.all_ok({"y": inputs["a"] + 2 * inputs["b"] + inputs["a"] ** 2})


def chess(a, b):
    return np.sign(np.sin(40 * a) * np.sin(37 * b))


def fit_of_chess(seed, runs):
    """Points, values and folds of a fit that no polynomial of a few runs is any good for."""
    inputs = dict(zip("ab", np.random.default_rng(seed).random((2, runs)), strict=True))
    points = FitPoints(ProductBasis.from_distribution(PAIR, 20, logarithms=True), inputs, 1.0)
    values = chess(**inputs)
    values = (values - values.mean()) / values.std()
    terms = regression_terms(points, values, "sparse", 1, np.random.default_rng(seed))
    assert isinstance(terms, Terms)
    folds = np.random.default_rng(seed).permutation(np.arange(runs) % 5)
    return points, values, folds, terms


def test_a_fit_is_not_judged_by_the_terms_of_others():
    others = []
    for seed in range(40):
        points, values, folds, terms = fit_of_chess(seed, 14)
        matrix = points.matrix(points.basis.indices(1, 1.0))
        of_folds = cross_validation(matrix, values, folds)
        kept = sparse_regression(matrix, values)
        assert kept is not None
        assert terms.cross_validation >= kept.leave_one_out
        if len(terms.coefficients) == 1:
            # A constant predicts nothing: less than nothing, as the mean is of the other runs.
            assert terms.cross_validation == pytest.approx(14 / 13)
            others.append(of_folds)
        else:
            assert terms.cross_validation == max(of_folds, kept.leave_one_out)
    # The folds of constants found terms of their own, good ones and bad ones.
    assert min(others) < 1 < 1.4 < max(others)


STUDY = """
[designs.training]
kind = "monte-carlo"
runs = 24
[surrogates.pce]
kind = "polynomial-chaos"
design = "training"
order = 3
"""


@pytest.mark.slow
def test_archive_json_and_table_tell_the_q2_of_the_constant_that_is_kept(study_of):
    study = study_of("np.sign(np.sin(40 * a) * np.sin(37 * b))", STUDY, a=(0, 1), b=(0, 1))
    tree = uqpen.run(study)
    fit = tree["surrogates/pce/y"]
    assert fit.sizes["term"] == 1
    assert fit.attrs["q2"] == pytest.approx(-1 / 23)
    assert fit.attrs["cross_validation_error"] == fit.attrs["leave_one_out_error"]
    assert archive_json(tree)["surrogates"]["pce"]["outputs"]["y"]["fit"]["q2"] == fit.attrs["q2"]
    assert [each.text for each in shown_diagnostics(fit) if each.name == "q2"] == ["-0.04348"]


def test_an_error_that_the_runs_cannot_tell_is_no_q2():
    a = np.linspace(0, 1, 12)
    runs = evaluate(Evaluator(Line(), ()), xr.Dataset({"a": (RUN, a), "b": (RUN, a**2)}), {})
    fit = PolynomialChaos(design="training", order=1).fit("pce", runs, Line(), PAIR, Stream(1, "s"))
    unknown = dataclasses.replace(fit.expansions["y"], cross_validation=math.inf)
    assert math.isnan(unknown.q2)
    reported = xr.DataTree(unknown.to_dataset())
    assert [each.text for each in shown_diagnostics(reported) if each.name == "q2"] == [""]
