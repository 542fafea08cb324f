"""Delta: exact answers, and what it does not depend on."""

import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_samples import sample_of_values
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from uqpen.core.model import Output
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sensitivity.delta import delta

QUESTION = QuantityOfInterest(Output("y", "m"), "m")
NAMES = ("x1", "x2", "x3")
WEIGHTS = np.array([1.0, 2.0, 0.5])


def sample(seed, runs):
    """A sum of normal inputs."""
    points = np.random.default_rng(seed).standard_normal((runs, 3))
    return sample_of_values(points @ WEIGHTS, points)


def of(drawn):
    return dict(delta(drawn, QUESTION))["delta"]


def exact(weight):
    """Mean distance of the output's normal law from that given the input, by quadrature."""
    variance = float(WEIGHTS @ WEIGHTS)
    y = np.linspace(-14, 14, 4001)
    nodes, shares = np.polynomial.hermite_e.hermegauss(60)
    density = stats.norm.pdf(y, 0, math.sqrt(variance))
    given_input = stats.norm.pdf(y, weight * nodes[:, None], math.sqrt(variance - weight**2))
    distances = np.trapezoid(np.abs(given_input - density), y, axis=1) / 2
    return float(shares @ distances / shares.sum())


@pytest.mark.parametrize(("runs", "tolerance"), [(1000, 0.06), (10_000, 0.03)])
def test_estimates_are_near_the_truth(runs, tolerance):
    # Classes of an input are wide, and kernels smooth: over twenty seeds the mean was off by up to
    # 0.04 and 0.02, and it scattered by 0.013 and 0.005.
    found = of(sample(0, runs)).values[:, 0]
    assert found == pytest.approx([exact(weight) for weight in WEIGHTS], abs=tolerance)


def test_no_influence_is_about_zero_and_all_of_it_about_one():
    drawn = sample(0, 10_000)
    # Knowing one of 22 classes is not quite knowing the input.
    found = of(replace(drawn, values=drawn.points[:, 0] ** 3)).values[:, 0]
    assert found[0] > 0.85
    assert found[1:].max() < 0.03


@pytest.mark.slow
@given(seed=st.integers(0, 1000))
@settings(max_examples=8)
def test_only_ranks_matter(seed):
    drawn = sample(seed, 100)
    other = replace(
        drawn,
        values=np.exp(drawn.values) + 7,
        columns=InputColumns.from_matrix(drawn.inputs, drawn.points**3),
    )
    assert np.array_equal(of(drawn).values, of(other).values, equal_nan=True)


def test_levels_of_an_input_are_classes():
    drawn = sample(0, 2000)
    levels = replace(
        drawn,
        columns=InputColumns.from_matrix(drawn.inputs, np.sign(drawn.points)),
        values=np.sign(drawn.points[:, 0]),
    )
    # Each of two equally likely values lies half of the probability away from both together.
    assert of(levels).values[0, 0] == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({}, "no reliable interval is known: the bias may exceed the scatter"),
        ({"values": np.ones(100)}, "the output does not vary"),
        (
            {"columns": InputColumns.from_matrix(NAMES, np.ones((100, 3)))},
            "the input does not vary",
        ),
        ({"used": np.arange(20), "values": np.arange(20.0)}, "20 runs are too few"),
    ],
)
def test_what_it_cannot_tell_it_says_why(change, reason):
    array = of(replace(sample(0, 100), **change))
    assert np.isnan(array.values[:, 1:]).all()
    assert list(array.coords["note"].values) == [reason] * 3
