"""Choice of truncation, order and terms by cross-validation."""

import numpy as np
import pytest

from uqpen.core.model import Input, Model, Output, Results
from uqpen.core.streams import Stream
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.distributions.univariate import Normal, Uniform
from uqpen.execution import Evaluator, evaluate
from uqpen.surrogates.chaos.basis import ProductBasis
from uqpen.surrogates.chaos.expansion import PolynomialChaosModel
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos
from uqpen.surrogates.chaos.term_selection import (
    TRUNCATIONS,
    FitPoints,
    Terms,
    chosen_terms,
    forward_selection,
)

pytestmark = pytest.mark.processor


def points_of(dimension, runs, seed=1):
    """Uniform points in a cube around the origin, and their values."""
    variables = tuple(Input(f"x{i}", "1") for i in range(dimension))
    joint = JointDistribution(
        tuple(RandomInput(each, Uniform(-1.0, 1.0), "1") for each in variables), variables
    )
    draws = np.random.default_rng(seed).uniform(-1, 1, (dimension, runs))
    inputs = {each.name: row for each, row in zip(variables, draws, strict=True)}
    return FitPoints(ProductBasis.from_distribution(joint, 20), inputs, 1.0), inputs


def chosen(function, dimension, runs, noise=0.0, order=None, seed=1):
    """Terms chosen from noisy values of a function, and their error at fresh points.

    The error is a share of the variance of the function; so is the square of the noise.
    """
    points, inputs = points_of(dimension, runs, seed)
    fresh, others = points_of(dimension, 4_000, seed=99)
    truth = function(others)
    spread = truth.std()
    scatter = np.random.default_rng(seed).normal(0, noise * spread, runs)
    values = function(inputs) + scatter
    centre, size = values.mean(), values.std()
    found = chosen_terms(points, (values - centre) / size, order, np.random.default_rng(4))
    assert isinstance(found, Terms)
    predicted = centre + size * fresh.matrix(found.indices) @ found.coefficients
    return found, float(np.mean((predicted - truth) ** 2) / spread**2)


def degrees(found):
    return {tuple(index) for index in found.indices.tolist()}


def test_a_sparse_polynomial_is_found_exactly():
    found, error = chosen(lambda x: 2 + x["x0"] * x["x1"] * x["x2"] + x["x3"] ** 5, 6, 100)
    assert error < 1e-20
    assert degrees(found) >= {(1, 1, 1, 0, 0, 0), (0, 0, 0, 5, 0, 0)}
    assert len(found.coefficients) == 5


def test_a_sum_of_functions_needs_no_interactions():
    found, error = chosen(lambda x: sum(np.exp(x[f"x{i}"] * i) for i in range(1, 4)), 4, 60)
    assert error < 1e-4
    assert found.truncation == TRUNCATIONS[0]
    assert ((found.indices > 0).sum(axis=1) <= 1).all()


def test_a_function_of_a_product_needs_interactions():
    found, error = chosen(lambda x: np.exp(x["x0"] * x["x1"]), 2, 50)
    assert error < 1e-6
    assert found.truncation > 0.5


def test_noise_does_not_explode():
    def smooth(x):
        return x["x0"] * x["x1"] + x["x2"] + x["x0"] ** 3

    errors = [chosen(smooth, 4, 60, noise=0.5, seed=seed)[1] for seed in range(3)]
    # The noise has a quarter of the variance, and a constant leaves all of it.
    assert np.median(errors) < 0.25
    assert max(errors) < 1


def test_pure_noise_is_a_constant():
    points, _ = points_of(3, 200)
    values = np.random.default_rng(8).normal(size=200)
    found = chosen_terms(points, values, None, np.random.default_rng(4))
    assert isinstance(found, Terms)
    assert len(found.coefficients) <= 3
    assert found.cross_validation > 0.9


def test_a_hundred_inputs():
    def some_matter(x):
        return x["x3"] + x["x50"] ** 2 + 2 * x["x7"] * x["x99"]

    found, error = chosen(some_matter, 100, 210)
    assert error < 1e-20
    assert len(found.coefficients) == 4


def test_a_given_order_is_kept():
    found, _ = chosen(lambda x: np.exp(x["x0"] + x["x1"]), 2, 60, order=3)
    assert found.order == 3
    assert found.indices.max() <= 3


def test_each_error_is_of_runs_left_out():
    points, inputs = points_of(2, 40)
    values = np.exp(inputs["x0"]) * inputs["x1"]
    matrix = points.matrix(points.basis.indices(2, 1.0))
    folds = np.arange(40) % 4
    is_in = np.vstack([folds != part for part in range(4)] + [np.full(40, True)])
    found = forward_selection(matrix, values, is_in)
    # With all of the terms, the choice is no matter.
    assert sorted(found.columns) == list(range(6))
    errors = np.empty(40)
    for part in range(4):
        out = folds == part
        fit = np.linalg.lstsq(matrix[~out], values[~out], rcond=None)[0]
        errors[out] = values[out] - matrix[out] @ fit
    expected = np.mean(errors**2) / values.var(ddof=1)
    assert found.errors[-1] == pytest.approx(expected, rel=1e-9)
    # The second term is the one that lowers the squares of all runs the most.
    left = [
        np.linalg.lstsq(matrix[:, [0, column]], values, rcond=None)[1][0] for column in range(1, 6)
    ]
    assert found.columns[1] == 1 + int(np.argmin(left))


def test_columns_that_depend_on_others_are_not_taken():
    rng = np.random.default_rng(5)
    x = rng.normal(size=50)
    matrix = np.column_stack([np.ones(50), x, 3 * x, x + 2, x**2])
    is_in = np.vstack([np.arange(50) % 5 != part for part in range(6)])
    found = forward_selection(matrix, x + 0.1 * x**2 + rng.normal(size=50), is_in)
    assert len(found.columns) == 3
    assert 4 in found.columns


class TwoOutputs(Model):
    """An output without interactions, and one that is an interaction."""

    name = "two"
    inputs = (Input("a", "1"), Input("b", "1"), Input("c", "1"))
    outputs = (Output("sum", "m"), Output("product", "m"))

    def evaluate(self, inputs):
        a, b, c = inputs.values()
        return Results.all_ok({"sum": np.exp(a) + np.sin(b) + c, "product": a * b * c})


@pytest.fixture(scope="module")
def fitted():
    return fit()


def fit(**settings):
    model = TwoOutputs()
    joint = JointDistribution(
        tuple(RandomInput(each, Normal(0.0, 1.0), "1") for each in model.inputs), model.inputs
    )
    points = next(MonteCarlo(80).rounds(joint, Stream(1, "designs", "d")))
    runs = evaluate(Evaluator(model), points, {})
    surrogate = PolynomialChaos(design="d", **settings)
    return surrogate.fit("pce", runs, model, joint, Stream(1, "surrogates", "pce"))


def test_each_output_has_a_truncation_of_its_own(fitted):
    of_sum, of_product = (fitted.expansions[name] for name in ("sum", "product"))
    assert of_sum.truncation < of_product.truncation
    assert fit(truncation=0.9).expansions["sum"].truncation == 0.9


def test_the_choice_is_the_same_again(fitted):
    assert fit().identity() == fitted.identity()


def test_an_archive_states_the_truncation_of_each_output(fitted):
    tree = fitted.to_tree()
    restored = PolynomialChaosModel.from_tree(tree, "pce", None)
    for name, expansion in fitted.expansions.items():
        assert tree[name].attrs["truncation"] == expansion.truncation
        assert restored.expansions[name].truncation == expansion.truncation
