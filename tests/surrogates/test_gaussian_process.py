import numpy as np
import pytest
from scipy.spatial.distance import cdist

from uqpen.core.model import Input, Model, Output, Results
from uqpen.core.streams import Stream
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.distributions.univariate import Lognormal, Uniform
from uqpen.execution import Evaluator, evaluate
from uqpen.models.known_functions import Campbell
from uqpen.surrogates.archived_surrogate import restore_surrogate
from uqpen.surrogates.fitting import fit_surrogate
from uqpen.surrogates.gaussian_process import GaussianProcess, LeftOutErrors
from uqpen.surrogates.gaussian_process_fit import (
    ConditionedProcess,
    GaussianProcessFit,
    Parameters,
    ProcessData,
    StandardisedInputs,
    negative_log_likelihood,
)
from uqpen.surrogates.separate_fits import SeparateFits

UNIT = Uniform(0.0, 1.0)


class OneOutput(Model):
    """Model with one output, a function of the inputs' values in columns."""

    name = "example"
    outputs = (Output("y", "m"),)

    def __init__(self, function, inputs):
        self.inputs = tuple(Input(f"x{number + 1}", "1") for number in range(inputs))
        self.function = function

    def evaluate(self, inputs):
        points = np.column_stack([inputs[variable.name] for variable in self.inputs])
        return Results.all_ok({"y": self.function(points)})


def fitted(function, runs, distributions, **settings):
    """Return a process fitted to a function, and the points of its runs."""
    model = OneOutput(function, len(distributions))
    random = map(RandomInput, model.inputs, distributions, ["1"] * len(distributions))
    joint = JointDistribution(tuple(random), model.inputs)
    points = next(LatinHypercube(runs, 1).rounds(joint, Stream(1, "designs", "lhs")))
    made = evaluate(Evaluator(model), points, {})
    surrogate = GaussianProcess(design="lhs", **settings)  # type: ignore[arg-type]
    found = surrogate.fit("gp", made, model, joint, Stream(1, "surrogates", "gp"))
    return found, np.column_stack([made[variable.name].values for variable in model.inputs])


def predicted(surrogate, points):
    names = surrogate.random_inputs
    return surrogate.predict(dict(zip(names, points.T, strict=True)))["y"]


def wave(points):
    return np.sin(3 * points[:, 0]) + points[:, -1] ** 2


def noisy(points):
    return wave(points) + np.random.default_rng(5).normal(0, 0.2, len(points))


def friedman(points):
    x1, x2, x3, x4, x5 = points.T
    return 10 * np.sin(np.pi * x1 * x2) + 20 * (x3 - 0.5) ** 2 + 10 * x4 + 5 * x5


def example_data(smoothness=2.5, *, is_linear=False):
    rng = np.random.default_rng(3)
    points = rng.normal(size=(12, 3))
    trend = np.hstack([np.ones((12, 1)), points if is_linear else np.empty((12, 0))])
    values = points[:, 0] + np.cos(points[:, 1]) + 0.1 * rng.normal(size=12)
    return ProcessData(points, values, trend, smoothness)


PARAMETERS = Parameters(np.array([0.7, 1.5, 4.0]), 0.02)


@pytest.mark.parametrize("smoothness", [1.5, 2.5])
@pytest.mark.parametrize("is_linear", [False, True])
def test_the_gradient_is_that_of_differences(smoothness, is_linear):
    data = example_data(smoothness, is_linear=is_linear)
    at = np.log([*PARAMETERS.lengths, PARAMETERS.nugget])

    def loss(logarithms):
        *lengths, nugget = np.exp(logarithms)
        return negative_log_likelihood(data, Parameters(np.array(lengths), nugget))[0]

    step = 1e-5
    steps = step * np.eye(len(at))
    differences = [(loss(at + each) - loss(at - each)) / (2 * step) for each in steps]
    found = negative_log_likelihood(data, PARAMETERS)[1]
    assert found == pytest.approx(differences, rel=1e-5, abs=1e-6)


def test_errors_at_runs_left_out_are_those_without_the_run():
    data = example_data(is_linear=True)
    process = ConditionedProcess.of_runs(data, PARAMETERS)
    assert process is not None
    found = process.weights / np.diag(process.inverse)
    for run in range(3):
        others = np.arange(12) != run
        z = data.points / PARAMETERS.lengths
        kernel = matern(cdist(z, z))
        matrix = kernel[np.ix_(others, others)] + PARAMETERS.nugget * np.eye(11)
        mean, _ = universal_kriging(
            matrix, kernel[run, others], data.trend[others], data.trend[run], data.values[others]
        )
        assert found[run] == pytest.approx(data.values[run] - mean, rel=1e-9)


def matern(distance):
    root = np.sqrt(5) * distance
    return (1 + root + root**2 / 3) * np.exp(-root)


def universal_kriging(matrix, kernel, trend, trend_there, values):
    """Return mean and variance by the weights that are unbiased and of least variance."""
    terms = len(trend_there)
    bordered = np.block([[matrix, trend], [trend.T, np.zeros((terms, terms))]])
    solved = np.linalg.solve(bordered, np.append(kernel, trend_there))
    return float(solved[: len(values)] @ values), float(solved @ np.append(kernel, trend_there))


@pytest.mark.parametrize("trend", ["constant", "linear"])
def test_predictions_are_those_of_universal_kriging(trend):
    surrogate, points = fitted(wave, 9, [UNIT, UNIT], trend=trend, nugget=0.01)
    fit = surrogate.fitted["y"].fit
    values, place = wave(points), np.array([0.3, 0.8])
    lengths = fit.lengths * points.std(axis=0)
    terms = lambda x: np.hstack([np.ones((len(x), 1)), x if trend == "linear" else x[:, :0]])  # noqa: E731
    mean, known = universal_kriging(
        matern(cdist(points / lengths, points / lengths)) + 0.01 * np.eye(9),
        matern(cdist([place / lengths], points / lengths))[0],
        terms(points),
        terms(place[None])[0],
        values,
    )
    found = predicted(surrogate, place[None])
    assert found.mean == pytest.approx([mean], rel=1e-7)
    std = fit.scale * fit.std * np.sqrt(1 + 0.01 - known)
    assert found.std == pytest.approx([std], rel=1e-6)


def test_without_a_nugget_it_goes_through_the_runs():
    # Of a smoother function, correlations are singular to rounding, and so errors are larger.
    surrogate, points = fitted(lambda x: np.sin(9 * x.sum(axis=1)), 30, [UNIT, UNIT], nugget=0.0)
    found = predicted(surrogate, points)
    assert found.mean == pytest.approx(np.sin(9 * points.sum(axis=1)), abs=1e-6)
    assert found.std is not None
    assert found.std.max() < 1e-3


def test_the_nugget_is_the_variance_of_the_noise():
    surrogate, _ = fitted(noisy, 200, [UNIT, UNIT])
    fit = surrogate.fitted["y"].fit
    noise = np.sqrt(fit.nugget) * fit.std / fit.std_factor * fit.scale
    assert noise == pytest.approx(0.2, rel=0.2)


def test_intervals_hold_95_of_100_fresh_points():
    surrogate, _ = fitted(friedman, 100, [UNIT] * 5)
    points = np.random.default_rng(2).random((2000, 5))
    found, truth = predicted(surrogate, points), friedman(points)
    assert found.std is not None
    # One design: benchmarks/gaussian_process.py has the median over many.
    assert 0.91 < np.mean(np.abs(truth - found.mean) < 1.96 * found.std) < 0.99
    assert np.mean((truth - found.mean) ** 2) < 8.7e-4 * np.var(truth)


def test_parameters_that_have_seen_a_run_would_make_its_error_too_small():
    surrogate, points = fitted(noisy, 25, [UNIT] * 6)
    fit = surrogate.fitted["y"].fit
    coordinates = (points - points.mean(axis=0)) / points.std(axis=0)
    values = noisy(points)
    data = ProcessData(coordinates, (values - values.mean()) / values.std(), np.ones((25, 1)), 2.5)
    process = ConditionedProcess.of_runs(data, Parameters(fit.lengths, fit.nugget))
    assert process is not None
    seen = process.weights / np.diag(process.inverse)
    assert 1 - fit.q2 > np.mean(seen**2)


def test_a_restored_fit_predicts_the_same_without_the_study():
    surrogate, points = fitted(
        lambda x: np.exp(wave(x)), 40, [UNIT, Lognormal(1.0, 0.3)], transform={"y": "log"}
    )
    restored = restore_surrogate(surrogate.to_tree(), "gp")
    assert isinstance(restored, SeparateFits)
    assert restored.to_tree().attrs["kind"] == "gaussian-process"
    found, again = predicted(surrogate, points), predicted(restored, points)
    assert np.array_equal(found.mean, again.mean)
    assert found.std is not None
    assert again.std is not None
    assert np.array_equal(found.std, again.std)
    assert restored.logarithms == {"y"}
    values = restored.evaluate(dict(zip(restored.random_inputs, points.T, strict=True)))
    assert np.array_equal(values.outputs["y"], found.mean)


def test_a_lognormal_input_is_taken_by_its_logarithm():
    points = np.exp(np.random.default_rng(1).normal(size=(50, 2)))
    inputs = StandardisedInputs.of_runs([Lognormal(1.0, 1.0), UNIT], points)
    assert list(inputs.is_logarithm) == [1, 0]
    coordinates = inputs.coordinates(points)
    assert coordinates.mean(axis=0) == pytest.approx([0, 0], abs=1e-12)
    assert coordinates.std(axis=0) == pytest.approx([1, 1])
    raw = np.column_stack([np.log(points[:, 0]), points[:, 1]])
    assert coordinates == pytest.approx((raw - raw.mean(axis=0)) / raw.std(axis=0))


@pytest.mark.parametrize("trend", ["constant", "linear"])
def test_all_labels_are_equally_far_from_each_other(trend):
    rng = np.random.default_rng(3)
    x, code = rng.random(60), np.arange(60) % 4
    values = (1 + x**2) * np.array([1.0, 3.0, -1.0, 2.0])[code]
    predictions = []
    for order in ([0, 1, 2, 3], [2, 0, 3, 1]):
        points = np.column_stack([np.array(order)[code], x])
        inputs = StandardisedInputs.of_runs([UNIT] * 2, points, [4, 0])
        coordinates = inputs.coordinates(points)[:, 1:]
        distances = cdist(coordinates, coordinates)
        np.testing.assert_allclose(distances, code[:, None] != code, atol=1e-12)
        surrogate = GaussianProcess(design="lhs", trend=trend)
        fit = surrogate.fit_values(inputs, points, values, np.random.default_rng(1))
        again = GaussianProcessFit.from_dataset(fit.to_dataset())
        at = np.column_stack([order, np.full(4, 0.5)])
        predictions.append(again.predict(at))
    np.testing.assert_allclose(predictions[0].mean, [1.25, 3.75, -1.25, 2.5], rtol=0.01)
    np.testing.assert_allclose(predictions[0].mean, predictions[1].mean, rtol=1e-4)
    np.testing.assert_allclose(predictions[0].std, predictions[1].std, rtol=1e-2)


@pytest.mark.parametrize(
    ("runs", "inputs", "settings"),
    [
        (60, 1, {}),
        (10, 3, {}),
        (40, 25, {}),
        (150, 1, {"nugget": 0.0}),
        (40, 2, {"kernel": "matern-3/2", "trend": "linear"}),
    ],
)
def test_it_predicts_better_than_the_mean(runs, inputs, settings):
    surrogate, _ = fitted(wave, runs, [UNIT] * inputs, **settings)
    points = np.random.default_rng(4).random((500, inputs))
    errors = wave(points) - predicted(surrogate, points).mean
    assert np.mean(errors**2) < 0.5 * np.var(wave(points))


def test_runs_may_repeat_and_inputs_may_be_constant():
    rng = np.random.default_rng(8)
    points = np.column_stack(
        [np.repeat(rng.random(20), 2), np.full(40, 0.5), np.repeat(rng.random(20), 2)]
    )
    values = noisy(points)
    inputs = StandardisedInputs.of_runs([UNIT] * 3, points)
    surrogate = GaussianProcess(design="lhs")
    fit = surrogate.fit_values(inputs, points, values, rng)
    assert not isinstance(fit, str)
    assert np.isfinite(fit.predict(points).mean).all()
    exact = GaussianProcess(design="lhs", nugget=0.0).fit_values(inputs, points, values, rng)
    assert exact == "some runs have the same inputs, and nugget = 0 leaves no room between them"


@pytest.mark.parametrize(
    ("runs", "settings", "reason"),
    [
        (2001, {}, "2001 completed runs are more than the 2000 that it takes"),
        (3, {}, "3 completed runs are too few: a constant trend needs 4 of them"),
        (5, {"trend": "linear"}, "5 completed runs are too few: a linear trend needs 6 of them"),
        (9, {"transform": {"y": "log"}}, "it has no logarithm where it is not positive"),
    ],
)
def test_what_cannot_be_fitted_has_a_reason(runs, settings, reason):
    surrogate, _ = fitted(lambda x: wave(x) - 0.5, runs, [UNIT, UNIT], **settings)
    assert surrogate.reasons["y"].startswith(reason)


def test_the_factor_is_that_with_which_intervals_hold_95_of_100_runs():
    errors = np.random.default_rng(6).standard_t(4, 999)
    found = LeftOutErrors(errors, np.full(999, 0.5))
    held = np.abs(errors) <= 1.959964 * found.std_factor * 0.5
    assert held.sum() == 950


def test_a_field_has_the_deviations_of_its_scores():
    angles = Campbell.outputs[0].dims[0].values
    joint = JointDistribution(
        tuple(RandomInput(each, Uniform(-1.0, 5.0), "1") for each in Campbell.inputs),
        Campbell.inputs,
    )
    points = next(LatinHypercube(60, 1).rounds(joint, Stream(1, "designs", "lhs")))
    made = evaluate(Evaluator(Campbell()), points, {})
    surrogate = GaussianProcess(design="lhs", components=3)
    found = fit_surrogate(surrogate, "gp", made, Campbell(), joint, Stream(1, "surrogates", "gp"))
    inputs = {each: made[each].values for each in found.random_inputs}
    (prediction,) = found.predict(inputs).values()
    assert prediction.std is not None
    assert prediction.std.shape == prediction.mean.shape == (60, len(angles))
    again = restore_surrogate(found.to_tree(), "gp").predict(inputs)
    assert np.array_equal(next(iter(again.values())).std, prediction.std)
