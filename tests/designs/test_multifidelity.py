"""The best split of a budget among a model and its stand-ins, against exact answers."""

from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uqpen.core.errors import SettingsError
from uqpen.designs.multifidelity import LinearEstimator, Multifidelity, best_allocation


def polynomials():
    """Exact covariances of x⁵, x⁴, x³, x², x for x uniform on [0, 1], and costs of 1 to 1e-4."""
    a, b = np.meshgrid((5, 4, 3, 2, 1), (5, 4, 3, 2, 1))
    return 1 / (a + b + 1) - 1 / ((a + 1) * (b + 1)), 10.0 ** -np.arange(5)


def ishigami_trio():
    """Covariances of three functions like Ishigami's, exact by Gauss's rule, and their costs."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    x1, x2, x3 = np.array(list(product(np.pi * nodes, repeat=3))).T
    joint = np.prod(list(product(weights / 2, repeat=3)), axis=1)
    values = np.array(
        [
            np.sin(x1) + a * np.sin(x2) ** 2 + b * x3**power * np.sin(x1)
            for a, b, power in ((5, 0.1, 4), (4.75, 0.1, 4), (3, 0.9, 2))
        ]
    )
    centred = values - (values @ joint)[:, None]
    return (joint * centred) @ centred.T, np.array([1, 0.05, 0.001])


def correlations(covariance):
    return covariance[0, 1:] / np.sqrt(covariance[0, 0] * np.diag(covariance)[1:])


def multifidelity_ratio(correlations, costs):
    """Return the variance of multifidelity Monte Carlo over that of Monte Carlo, at equal cost.

    It has the best numbers of nested points, and the best choice of the stand-ins (Peherstorfer,
    B., Willcox, K. & Gunzburger, M. (2016). SIAM J. Sci. Comput. 38, A3163-A3194).
    """
    order = np.argsort(-(correlations**2))
    squares, prices = correlations[order] ** 2, costs[order]
    smallest = 1.0
    for number in range(1, len(order) + 1):
        for chosen in map(list, combinations(range(len(order)), number)):
            steps = -np.diff(np.concatenate([[1.0], squares[chosen], [0.0]]))
            ratio = np.sqrt(steps * np.concatenate([[1.0], prices[chosen]])).sum() ** 2
            smallest = min(smallest, float(ratio))
    return smallest


@pytest.mark.parametrize(
    ("problem", "nested", "groups"),
    [(polynomials, 0.0461, 0.0043), (ishigami_trio, 0.0156, 0.0138)],
)
def test_ratios_to_monte_carlo_are_those_of_the_literature(problem, nested, groups):
    covariance, costs = problem()
    # The figures have three or two digits.
    assert multifidelity_ratio(correlations(covariance), costs[1:]) == pytest.approx(
        nested, abs=5e-5
    )
    allocation = best_allocation([covariance], costs, 1000)
    ratio = allocation.variance(covariance) / (covariance[0, 0] / 1000)
    assert ratio == pytest.approx(groups, abs=6e-5)


@settings(max_examples=25)  # each is minimised to the end
@given(
    st.lists(st.floats(-0.99, 0.99), min_size=1, max_size=3),
    st.lists(st.floats(1e-3, 0.9), min_size=3, max_size=3),
    st.integers(0, 60),
)
def test_an_allocation_spends_the_budget_and_loses_to_no_nested_one(loadings, prices, pilot):
    factors = np.array([1.0, *loadings])
    covariance = np.outer(factors, factors) + np.diag([0.0, *(1 - np.square(loadings))])
    costs = np.array([1.0, *prices[: len(loadings)]])
    allocation = best_allocation([covariance], costs, 400, pilot)
    spent = sum(
        runs * costs[group].sum()
        for group, runs in zip(allocation.groups, allocation.runs, strict=True)
    )
    assert spent == pytest.approx(400)
    assert allocation.runs[0] >= pilot * (1 - 1e-9)
    if not pilot:
        ratio = allocation.variance(covariance) * 400
        # Groups of less than a per mille of the budget are left out, as their error is unknown.
        assert ratio <= multifidelity_ratio(correlations(covariance), costs[1:]) * 1.02


@given(st.lists(st.floats(0.1, 1000), min_size=3, max_size=3), st.floats(0.1, 10))
def test_weights_are_unbiased_and_do_not_depend_on_units(runs, unit):
    covariance, _ = polynomials()
    groups = [np.arange(5) >= first for first in (0, 1, 4)]
    weights = LinearEstimator(covariance, groups).weights(np.array(runs))
    assert weights.sum(axis=0) == pytest.approx([1, 0, 0, 0, 0], abs=1e-6)
    scale = np.array([1, unit, 1, 1, 1])
    other = LinearEstimator(covariance * np.outer(scale, scale), groups).weights(np.array(runs))
    # The covariances are nearly singular: to more digits, the two sets of weights differ.
    assert other * scale == pytest.approx(weights, rel=1e-3, abs=1e-4)


def test_a_pilot_is_no_larger_than_the_budget():
    with pytest.raises(SettingsError, match="at most the budget, 60"):
        Multifidelity(budget=60, pilot=70)


def test_points_of_a_smaller_budget_are_among_those_of_a_larger_one():
    # Its points are those of the contract's test of extensions.
    larger, smaller = Multifidelity(budget=400), Multifidelity(budget=200)
    assert larger.extension(smaller, None).kept == 200  # type: ignore[arg-type]
