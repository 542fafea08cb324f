"""Polynomials: orthonormal under every law, as many as were asked for, the same in any batch."""

import itertools

import numpy as np
import pytest
from example_distributions import EXAMPLES

from uqpen.distributions.measurements import Empirical
from uqpen.distributions.univariate import (
    Beta,
    Gamma,
    Gumbel,
    Lognormal,
    LogUniform,
    Normal,
    Triangular,
    Truncated,
    Uniform,
    Weibull,
)
from uqpen.surrogates.chaos.basis import (
    MOST_TERMS,
    ProductBasis,
    multi_indices,
    nested_sums,
    univariate_basis,
)

DEGREE = 8

LAWS = [
    Normal(4e8, 4e7),
    Lognormal(7.0, 5.0),
    Uniform(-2.0, 5.0),
    LogUniform(0.1, 50.0),
    Triangular(0.0, 0.3, 2.0),
    Beta(2.0, 0.5, 1.0, 3.0),
    Gamma(100.0, 1.0),
    Weibull(1.5, 2.0),
    Gumbel(5.0, 1.0),
    Truncated(Normal(0.1, 0.025), 0.05, 0.13),
    Truncated(Normal(0.0, 1.0), 3.0, 9.0),
    Truncated(Lognormal(1.0, 0.5), 0.2, 3.0),
    Truncated(Triangular(0.0, 0.3, 2.0), 0.1),
    *(EXAMPLES[name] for name in ("exponential", "rayleigh", "arcsine", "logistic")),
]


def averaged(distribution, degree):
    """Means of all products of a law's polynomials, by panels of other sizes than the code's."""
    ends = 0.5 * 1.4 ** -np.arange(300.0)
    ends = np.union1d(ends, [distribution.cdf(np.array(0.3)), distribution.sf(np.array(0.3))])
    ends = ends[(ends > 0) & (ends <= 0.5)]
    nodes, weights = np.polynomial.legendre.leggauss(31)
    half = np.diff(ends)[:, None] / 2
    probability = (ends[:-1, None] + half + half * nodes).ravel()
    mass = (half * weights).ravel()
    found = univariate_basis("x", distribution, degree)
    products = np.zeros((degree + 1, degree + 1))
    for inverse in (distribution.ppf, distribution.isf):
        table = found.polynomials(inverse(probability), degree)
        products += (table * mass) @ table.T
    return products


@pytest.mark.parametrize("distribution", LAWS, ids=str)
def test_polynomials_are_orthonormal_under_their_law(distribution):
    # Sums of thousands of rounded terms, on both sides.
    np.testing.assert_allclose(averaged(distribution, DEGREE), np.eye(DEGREE + 1), atol=1e-11)


def test_measured_values_have_polynomials_too():
    distribution = Empirical(tuple(np.random.default_rng(3).normal(2.0, 0.3, 40)))
    table = univariate_basis("x", distribution, 4).polynomials(
        distribution.ppf((np.arange(400_000) + 0.5) / 400_000), 4
    )
    np.testing.assert_allclose(table @ table.T / 400_000, np.eye(5), atol=1e-4)


def test_the_logarithm_is_the_germ_where_its_law_is_simpler():
    for distribution in (
        Lognormal(7.0, 5.0),
        LogUniform(0.1, 50.0),
        Truncated(LogUniform(0.1, 50.0), 1.0),
    ):
        assert univariate_basis("x", distribution, 2).is_logarithm
        assert not univariate_basis("x", distribution, 2, logarithms=False).is_logarithm
    assert not univariate_basis("x", Gamma(2.0, 1.0), 2).is_logarithm


def test_polynomials_of_what_has_no_logarithm_are_no_numbers():
    assert np.isnan(
        univariate_basis("x", Lognormal(1.0, 1.0), 2).polynomials(np.array([-1.0]), 2)[1:]
    ).all()


@pytest.mark.parametrize("truncation", [0.4, 0.5, 0.75, 1.0])
@pytest.mark.parametrize(("dimension", "order"), [(1, 6), (2, 8), (3, 8), (4, 3)])
def test_multi_indices_are_all_that_the_norm_allows(truncation, dimension, order):
    allowed = {
        degrees
        for degrees in itertools.product(range(order + 1), repeat=dimension)
        if sum(k**truncation for k in degrees if k) ** (1 / truncation) <= order * (1 + 1e-9)
    }
    found = multi_indices(dimension, order, truncation)
    assert {tuple(degrees) for degrees in found.tolist()} == allowed
    assert len(found) == len(allowed)
    assert not found[0].any()
    assert (np.diff(found.sum(axis=1)) >= 0).all()


def test_too_many_terms_are_none():
    assert len(multi_indices(100, 4, 1.0)) == 0
    assert len(multi_indices(80, 2, 1.0)) < MOST_TERMS


def test_nothing_depends_on_the_batch():
    rng = np.random.default_rng(5)
    basis = ProductBasis(
        (
            univariate_basis("a", Lognormal(2.0, 1.0), 6),
            univariate_basis("b", Gumbel(0.0, 1.0), 6),
            univariate_basis("c", LAWS[0], 6),
        )
    )
    indices = multi_indices(3, 6, 1.0)
    expansion = nested_sums(indices, rng.normal(size=len(indices)))
    distributions = (Lognormal(2.0, 1.0), Gumbel(0.0, 1.0), LAWS[0])
    inputs = {
        name: distribution.ppf(rng.random(20_011))
        for name, distribution in zip("abc", distributions, strict=True)
    }
    whole = basis.evaluate(inputs, indices, [expansion])[0]
    for rows in (slice(3, None), slice(77, 78), slice(4000, 9001), slice(0, None, 7)):
        some = {name: column[rows] for name, column in inputs.items()}
        np.testing.assert_array_equal(basis.evaluate(some, indices, [expansion])[0], whole[rows])


def test_sums_are_those_of_the_matrix():
    rng = np.random.default_rng(6)
    basis = ProductBasis(
        (univariate_basis("a", Uniform(-1.0, 1.0), 5), univariate_basis("b", Normal(0.0, 1.0), 5))
    )
    indices = multi_indices(2, 5, 1.0)[rng.permutation(21)]
    coefficients = rng.normal(size=21)
    inputs = {"a": rng.uniform(-1, 1, 500), "b": rng.normal(size=500)}
    found = basis.evaluate(
        inputs,
        indices,
        [nested_sums(indices, coefficients), nested_sums(indices[:1], coefficients[:1])],
    )
    expected = basis.matrix(inputs, indices) @ coefficients
    np.testing.assert_allclose(found[0], expected, atol=1e-12)
