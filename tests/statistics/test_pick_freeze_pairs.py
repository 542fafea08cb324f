"""Pairs of draws that share inputs: known indices, with and without dependence."""

import math

import pytest

from uqpen.core.streams import Stream
from uqpen.execution import Evaluator
from uqpen.statistics.surrogate.surrogate_draws import draw_pick_freeze_pairs

# 16 384 pairs of scrambled Sobol' points leave less than this of a smooth function's indices.
TOLERANCE = 0.005


def drawn(study):
    evaluator = Evaluator(study.model, study.constraints)
    return draw_pick_freeze_pairs(evaluator, study.joint, {}, Stream(4, "test"))


def correlated(r):
    pair = f'{{ inputs = ["a", "b"], correlation = {r} }}'
    return f'[dependence]\ncopula = "gaussian"\nof = "normal-scores"\npairs = [{pair}]'


def shares(study):
    found = drawn(study).variance_shares("y", lambda values: values)
    assert found is not None
    return found


def test_the_indices_of_ishigamis_function(study_of):
    whole = (-math.pi, math.pi)
    body = "np.sin(a) + 7 * np.sin(b)**2 + 0.1 * c**4 * np.sin(a)"
    found = shares(study_of(body, a=whole, b=whole, c=whole))
    assert found.first_order == pytest.approx(
        [0.31390519114781146, 0.4424111447900409, 0], abs=TOLERANCE
    )
    assert found.total_order == pytest.approx(
        [0.5575888552099592, 0.4424111447900409, 0.24368366406214773], abs=TOLERANCE
    )
    assert found.shapley == pytest.approx(
        [0.4357470231788853, 0.4424111447900409, 0.12184183203107386], abs=TOLERANCE
    )


def test_of_correlated_normal_inputs_the_effects_are_known(study_of):
    # y = a + b with correlation r: each explains (1 + r)² / (2 + 2 r) alone; Shapley's parts are
    # equal by symmetry.
    r = 0.6
    found = shares(study_of("a + b", correlated(r), a="0 ± 1", b="0 ± 1"))
    alone = (1 + r) ** 2 / (2 + 2 * r)
    assert found.first_order == pytest.approx([alone, alone], abs=TOLERANCE)
    assert found.shapley == pytest.approx([0.5, 0.5], abs=TOLERANCE)


def test_an_input_without_effect_has_a_share_by_correlation(study_of):
    # y = a, b follows a by r: Shapley's part of b is half of what b tells of a, r² / 2.
    r = 0.8
    found = shares(study_of("a + 0 * b", correlated(r), a="0 ± 1", b="0 ± 1"))
    assert found.shapley == pytest.approx([1 - r**2 / 2, r**2 / 2], abs=TOLERANCE)


@pytest.mark.slow
def test_under_a_constraint_the_indices_are_of_the_law_given_it(study_of):
    # Over the triangle a > b of the unit square, Var a = Var b = 1/18 and Cov(a, b) = 1/36, so
    # Var(a + b) = 1/6. E[a + b | a] = 3 a / 2 and E[a + b | b] = (1 + 3 b) / 2: both explain
    # 9/4 · 1/18 of it.
    found = shares(study_of("a + b", '[constraints]\nkeep = ["a > b"]', a=(0, 1), b=(0, 1)))
    assert found.first_order == pytest.approx([3 / 4, 3 / 4], abs=2 * TOLERANCE)


def test_a_function_that_does_not_vary_has_no_shares(study_of):
    never = drawn(study_of("a", a=(0, 1))).variance_shares(
        "y", lambda values: (values > 2).astype(float)
    )
    assert never is None


def test_a_single_input_has_it_all(study_of):
    found = shares(study_of("a**2", a=(0, 1)))
    assert found.first_order == found.total_order == found.shapley == [1.0]


@pytest.mark.slow
def test_too_many_inputs_for_all_sets_still_have_sobol_indices(study_of):
    names = "abcdefghijkl"
    study = study_of(" + ".join(names), **dict.fromkeys(names, (0, 1)))
    found = shares(study)
    assert found.first_order == pytest.approx([1 / 12] * 12, abs=0.02)
    assert found.shapley is None
