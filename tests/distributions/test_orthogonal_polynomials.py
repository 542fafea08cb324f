"""Orthogonal polynomials of every law, and Gauss's rule from them."""

import math

import numpy as np
import pytest
from example_distributions import EXAMPLES
from scipy import stats

from uqpen.distributions import orthogonal_polynomials as module
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.orthogonal_polynomials import recurrence
from uqpen.distributions.univariate import (
    Beta,
    Gamma,
    Gumbel,
    Lognormal,
    LogUniform,
    Mixture,
    Normal,
    Triangular,
    Truncated,
    Uniform,
    Weibull,
)

LAWS = [
    Normal(2.0, 0.5),
    Lognormal(2.0, 0.5),
    Uniform(-1.0, 3.0),
    LogUniform(0.1, 30.0),
    Triangular(-1.0, 0.5, 3.0),
    Beta(2.0, 3.5, -1.0, 3.0),
    Beta(0.5, 0.5, 0.0, 1.0),
    Gamma(2.0, 0.5),
    Weibull(1.7, 2.0),
    Weibull(0.6, 2.0),
    Gumbel(2.0, 0.5),
    Truncated(Normal(2.0, 0.5), 1.2, 2.9),
    Truncated(Triangular(-1.0, 0.5, 3.0), 0.0, 2.0),
    Truncated(Normal(4e8, 4e7), 0.0, math.inf),
    Truncated(Normal(0.0, 1.0), 9.0, math.inf),
    Mixture((Normal(0.0, 1.0), Normal(4.0, 0.5)), (0.7, 0.3)),
    *(
        each
        for name, each in EXAMPLES.items()
        if name != "generalised-extreme-value" and not each.is_discrete  # of fewer moments
    ),
]

# Integrals and eigenvalues of a few thousand rounded terms.
ROUNDING = 1e-12


@pytest.mark.parametrize("distribution", LAWS, ids=str)
def test_a_rule_has_the_moments_of_its_law(distribution):
    nodes, weights = recurrence(distribution, 4).gauss(5)
    many, density = module._distribution_nodes(distribution)
    middle, spread = float(many @ density), float(np.sqrt((many - many @ density) ** 2 @ density))
    for power in range(1, 10):
        exact = ((many - middle) / spread) ** power @ density
        size = (np.abs(many - middle) / spread) ** power @ density
        assert ((nodes - middle) / spread) ** power @ weights == pytest.approx(
            exact, abs=ROUNDING * size
        )


@pytest.mark.parametrize("distribution", LAWS, ids=str)
def test_nodes_lie_inside_the_law_and_weights_add_up(distribution):
    nodes, weights = recurrence(distribution, 9).gauss(10)
    assert (distribution.cdf(nodes) > 0).all()
    assert (distribution.sf(nodes) > 0).all()
    assert (np.diff(nodes) > 0).all()
    assert (weights > 0).all()
    assert weights.sum() == pytest.approx(1.0, abs=ROUNDING)


@pytest.mark.parametrize(
    "distribution",
    [distribution for distribution in LAWS if type(distribution) in module._FORMULAS],
    ids=lambda law: str(law),
)
def test_formulas_agree_with_the_discretised_procedure(distribution, monkeypatch):
    nodes, weights = recurrence(distribution, 7).gauss(8)
    monkeypatch.setattr(module, "_FORMULAS", {})
    other = recurrence(distribution, 7)
    np.testing.assert_allclose(nodes, other.gauss(8)[0], rtol=1e-10)
    np.testing.assert_allclose(weights, other.gauss(8)[1], rtol=1e-7, atol=ROUNDING)


@pytest.mark.parametrize(
    ("distribution", "scipys"),
    [
        (Triangular(-1.0, 0.5, 3.0), stats.triang(0.375, -1.0, 4.0)),
        (Weibull(1.7, 2.0), stats.weibull_min(1.7, scale=2.0)),
        (Weibull(0.6, 2.0), stats.weibull_min(0.6, scale=2.0)),
        (
            Gumbel(2.0, 0.5),
            stats.gumbel_r(2.0 - np.euler_gamma * 0.5 * 6**0.5 / math.pi, 0.5 * 6**0.5 / math.pi),
        ),
        (LogUniform(0.1, 30.0), stats.loguniform(0.1, 30.0)),
        (Lognormal(2.0, 3.0), stats.lognorm(math.sqrt(math.log(3.25)), scale=2.0 / 3.25**0.5)),
        (Truncated(Normal(2.0, 0.5), 1.2, 2.9), stats.truncnorm(-1.6, 1.8, 2.0, 0.5)),
    ],
    ids=lambda each: str(each) if isinstance(each, Distribution) else "",
)
def test_mean_and_std_are_scipys(distribution, scipys):
    found = recurrence(distribution, 1)
    assert found.mean == pytest.approx(scipys.mean(), rel=1e-10)
    assert found.std == pytest.approx(scipys.std(), rel=1e-10)


class TwoValues(Distribution):
    """A law of two values: of few polynomials, and with a jump."""

    def ppf(self, probability):
        return np.where(probability < 0.3, -1.0, 2.0)

    def isf(self, probability):
        return np.where(probability > 0.7, -1.0, 2.0)

    def cdf(self, value):
        return np.select([value < -1, value < 2], [0.0, 0.3], 1.0)

    def sf(self, value):
        return 1 - self.cdf(value)


def test_a_law_of_two_values_has_two_nodes_and_no_more():
    found = recurrence(TwoValues(), 3)
    nodes, weights = found.gauss(2)
    np.testing.assert_allclose(nodes, [-1.0, 2.0], atol=1e-10)
    np.testing.assert_allclose(weights, [0.3, 0.7], atol=1e-10)
    assert recurrence(TwoValues(), 1).is_finite
    assert not found.is_finite


def test_a_law_whose_moments_overflow_says_so():
    assert recurrence(Lognormal(1.0, 10.0), 5).is_finite
    assert not recurrence(Lognormal(1.0, 10.0), 100).is_finite
