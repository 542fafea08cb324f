"""Active learning of a rare event: its surrogate, its weights, where it learns."""

import numpy as np
import pytest
from rare_event_studies import INPUTS, half_space, probability
from rare_event_studies import study as study_by
from scipy import special

import uqpen
from uqpen.core.labels import CORRECTION_WEIGHT, PREDICTED_EVENT


def study(function=half_space, event=f"depth > {4 * 2**0.5!r} m", *, learning=40, correction=150):
    design = uqpen.ActiveLearning(event=event, learning=learning, correction=correction, batch=10)
    return study_by(design, function)


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(study())


HALF_SPACE = special.ndtr(-4.0)


def beside(tree, name):
    """A number that stands beside the probability."""
    return float(tree["joint_probabilities/rare"][f"joint_probability_{name}"].item())


def test_the_surrogate_alone_stands_beside_it(tree):
    found = probability(tree)
    # The runs of so simple an event contradict it in hardly any point.
    assert beside(tree, "surrogate_estimate") == pytest.approx(HALF_SPACE, rel=0.2)
    assert beside(tree, "equivalent_runs") > 100 * tree["runs/rare"].sizes["run"]
    assert "the surrogate alone says" in found.attrs["note"]
    assert "which has no interval" in found.attrs["note"]
    assert "runs of the model alone" in found.attrs["note"]
    assert "parts of the event that no run has met" in found.attrs["note"]


def test_weights_are_of_the_runs_that_correct(tree):
    runs = tree["runs/rare"]
    weights, predicted = runs[CORRECTION_WEIGHT].values, runs[PREDICTED_EVENT].values
    assert ((weights > 0) == (predicted >= 0)).all()
    assert (weights > 0).sum() == 150
    # They add up to the probability of all inputs, and to that of the event, with the error of 50
    # draws of each kind.
    assert weights.sum() == pytest.approx(1, rel=0.5)
    assert weights[predicted == 1].sum() == pytest.approx(HALF_SPACE, rel=0.5)


def test_it_is_right_whatever_the_surrogate_says():
    # 20 runs tell little of a function that waves; so the runs that correct it have to.
    def waves(a, b):
        return {"depth": a + np.sin(9 * b), "speed": b}

    # By the integral over a of the share of b where the sine exceeds 2 - a.
    b = special.ndtri((np.arange(100_000) + 0.5) / 100_000)
    exact = special.ndtr(np.sin(9 * b) - 2).mean()
    found = probability(uqpen.run(study(waves, "depth > 2 m", learning=20, correction=900)))
    _, lower, upper = found.values
    assert lower <= exact <= upper


def test_a_failing_region_gives_bounds_and_does_not_stop_the_learning():
    def fails(a, b):
        return {"depth": np.where(a > 2, np.nan, b), "speed": a}

    tree = uqpen.run(study(fails, "depth > 3.5 m"))
    _, lower, upper = probability(tree).values
    assert upper > special.ndtr(-2.0), "all failed runs may have it"
    assert lower <= special.ndtr(-3.5) * special.ndtr(2.0)
    runs = tree["runs/rare"]
    is_lost = np.isnan(runs["depth"].values[runs[CORRECTION_WEIGHT].values == 0])
    assert is_lost.mean() < 0.5, "it does not go on where runs fail"


def test_a_constant_output_has_no_surrogate_and_no_number():
    def constant(a, b):
        return {"depth": 0 * a, "speed": b}

    tree = uqpen.run(study(constant, "depth > 2 m"))
    assert np.isnan(probability(tree).values).all()
    assert np.isnan(beside(tree, "surrogate_estimate"))


@pytest.mark.parametrize("criterion", ["u-function", "expected-feasibility"])
def test_either_criterion_learns_where_the_limit_is(criterion):
    def curved(a, b):
        return {"depth": a + 0.1 * b**2, "speed": b}

    model = uqpen.PythonModel(
        curved, {"a": "1", "b": "1"}, {"depth": "m", "speed": "m/s"}, vectorized=True
    )
    design = uqpen.ActiveLearning("depth > 3 m", learning=40, batch=3, criterion=criterion)
    runs = uqpen.run(uqpen.Study(model, INPUTS, designs={"rare": design}, seed=4))["runs/rare"]
    to_learn = runs[CORRECTION_WEIGHT].values == 0
    away = np.abs(runs["depth"].values[to_learn] - 3)
    # The first 14 are spread over the inputs.
    assert np.median(away[14:]) < np.median(away[:14]) / 3
