"""Moments and indices are sums of squared coefficients."""

import math

import numpy as np

from uqpen.surrogates.chaos.expansion import (
    mean,
    shapley_effects,
    sobol_indices,
    standard_deviation,
)

# 2 + x1 + 2 x2 x3, orthonormal terms.
INDICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 1]])
COEFFICIENTS = np.array([2.0, 1.0, 2.0])


def test_moments():
    assert mean(INDICES, COEFFICIENTS) == 2.0
    assert standard_deviation(INDICES, COEFFICIENTS) == math.sqrt(5)


def test_indices_of_every_order():
    found = sobol_indices(INDICES, COEFFICIENTS)
    np.testing.assert_allclose(found.first, [0.2, 0.0, 0.0])
    np.testing.assert_allclose(found.total, [0.2, 0.8, 0.8])
    np.testing.assert_allclose(
        found.second, [[np.nan, 0.0, 0.0], [0.0, np.nan, 0.8], [0.0, 0.8, np.nan]]
    )


def test_shapley_effects_share_interactions_equally():
    np.testing.assert_allclose(shapley_effects(INDICES, COEFFICIENTS), [0.2, 0.4, 0.4])


def test_what_does_not_vary_has_no_indices():
    found = sobol_indices(INDICES, np.array([2.0, 0.0, 0.0]))
    assert np.isnan(found.first).all()
    assert np.isnan(shapley_effects(INDICES, np.array([2.0, 0.0, 0.0]))).all()
    assert standard_deviation(INDICES[:1], COEFFICIENTS[:1]) == 0.0
    assert np.isnan(sobol_indices(INDICES[:1], COEFFICIENTS[:1]).total).all()
