"""Placement of runs where a surrogate expects to err, with weights."""

import numpy as np
import pytest

from uqpen.surrogates.refinement import PredictedError, place

POINTS, EACH = 4000, 16


def error_at(cube, *, is_of_event=False):
    """Errors in a corner of a tenth of the draws."""
    return PredictedError(np.where(cube > 0.9, 0.5, 1e-6), is_of_event)


@pytest.mark.parametrize("is_of_event", [False, True])
def test_weighted_points_estimate_without_bias(*, is_of_event):
    rng = np.random.default_rng(1)
    cube = rng.random(POINTS * EACH)
    placed = place([error_at(cube, is_of_event=is_of_event)], POINTS, EACH, 1.0, rng)
    assert 1 / placed.weights.max() >= placed.share
    chosen = cube[placed.candidates]
    assert (chosen > 0.9).mean() > 0.2
    for values, truth in ((np.ones(POINTS), 1), (chosen, 0.5), (chosen**2, 1 / 3)):
        terms = placed.weights * values
        assert abs(terms.mean() - truth) < 4 * terms.std() / np.sqrt(POINTS)


def test_each_point_is_of_candidates_of_its_own():
    rng = np.random.default_rng(2)
    placed = place([error_at(rng.random(POINTS * EACH))], POINTS, EACH, 1.0, rng)
    assert (placed.candidates // EACH == np.arange(POINTS)).all()


def test_points_are_plain_draws_where_a_placement_promises_nothing():
    rng = np.random.default_rng(3)
    even = PredictedError(np.full(POINTS * EACH, 0.3), is_of_event=False)
    # Few disagreements: the one that nobody has seen decides, and it has the largest weight.
    rare = PredictedError(np.where(rng.random(200 * EACH) > 0.99, 0.1, 0.0), is_of_event=True)
    for errors, points in (([], POINTS), ([even], POINTS), ([rare], 200)):
        placed = place(errors, points, EACH, 1.0, rng)
        assert placed.share == 1
        assert (placed.weights == 1).all()
