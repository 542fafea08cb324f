"""Moments and indices are sums of squared coefficients."""

import math

import numpy as np

from uqpen.surrogates.chaos.expansion import input_shares, mean, standard_deviation

# 2 + x1 + 2 x2 x3, orthonormal terms.
INDICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 1]])
COEFFICIENTS = np.array([2.0, 1.0, 2.0])


def test_moments():
    assert mean(INDICES, COEFFICIENTS) == 2.0
    assert standard_deviation(INDICES, COEFFICIENTS) == math.sqrt(5)


def test_first_and_total_order_indices():
    found = input_shares(INDICES, COEFFICIENTS)
    np.testing.assert_allclose(found.first, [0.2, 0.0, 0.0])
    np.testing.assert_allclose(found.total, [0.2, 0.8, 0.8])


def test_shapley_effects_share_interactions_equally():
    np.testing.assert_allclose(input_shares(INDICES, COEFFICIENTS).shapley, [0.2, 0.4, 0.4])


def test_what_does_not_vary_has_no_indices():
    found = input_shares(INDICES, np.array([2.0, 0.0, 0.0]))
    assert np.isnan(found.first).all()
    assert np.isnan(found.shapley).all()
    assert standard_deviation(INDICES[:1], COEFFICIENTS[:1]) == 0.0
    assert np.isnan(input_shares(INDICES[:1], COEFFICIENTS[:1]).total).all()
