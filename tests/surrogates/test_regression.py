"""Fits: exact where they can be, with the leave-one-out error that leaving one out gives."""

import numpy as np
import pytest

from uqpen.surrogates.chaos.coefficients import (
    FOLDS,
    cross_validation,
    is_exact,
    least_squares,
    projection_coefficients,
    sparse_regression,
)

pytestmark = pytest.mark.processor


def problem(runs=40, terms=12):
    rng = np.random.default_rng(11)
    matrix = np.column_stack([np.ones(runs), rng.normal(size=(runs, terms - 1))])
    return matrix, matrix @ rng.normal(size=terms) + rng.normal(size=runs)


def brute_force(matrix, values):
    errors = []
    for left_out in range(len(values)):
        kept = np.arange(len(values)) != left_out
        found = np.linalg.lstsq(matrix[kept], values[kept], rcond=None)[0]
        errors.append(values[left_out] - matrix[left_out] @ found)
    return float(np.mean(np.square(errors)) / np.var(values, ddof=1))


def test_leave_one_out_is_what_leaving_one_out_gives():
    matrix, values = problem()
    fit = least_squares(matrix, values)
    assert fit is not None
    assert fit.leave_one_out == pytest.approx(brute_force(matrix, values), rel=1e-10)
    np.testing.assert_allclose(
        fit.coefficients, np.linalg.lstsq(matrix, values, rcond=None)[0], rtol=1e-10
    )


def test_the_correction_is_chapelles():
    matrix, values = problem()
    fit = least_squares(matrix, values)
    assert fit is not None
    trace = np.trace(np.linalg.inv(matrix.T @ matrix / 40)) / 40
    assert fit.corrected == pytest.approx(fit.leave_one_out * 40 / 28 * (1 + trace), rel=1e-10)


def test_a_sparse_fit_has_the_error_of_least_squares_on_its_terms():
    matrix, values = problem()
    fit = sparse_regression(matrix, values)
    assert fit is not None
    again = least_squares(matrix[:, fit.terms], values)
    assert again is not None
    assert fit.leave_one_out == pytest.approx(again.leave_one_out, rel=1e-9)
    assert fit.corrected == pytest.approx(again.corrected, rel=1e-9)


def test_a_sparse_fit_finds_the_terms_among_more_than_there_are_runs():
    rng = np.random.default_rng(2)
    matrix = np.column_stack([np.ones(60), rng.normal(size=(60, 400))])
    values = 3 + matrix[:, [17, 230, 399]] @ [1.0, -2.0, 0.5]
    fit = sparse_regression(matrix, values)
    assert fit is not None
    assert fit.terms.tolist() == [0, 17, 230, 399]
    np.testing.assert_allclose(fit.coefficients, [3.0, 1.0, -2.0, 0.5], atol=1e-13)


def test_columns_that_depend_on_each_other_have_no_least_squares():
    matrix, values = problem()
    assert least_squares(np.column_stack([matrix, matrix[:, 3]]), values) is None
    assert least_squares(matrix[:12], values[:12]) is None


def test_a_rule_is_exact_up_to_its_degree():
    nodes, weights = np.polynomial.legendre.leggauss(4)
    scale = np.sqrt(2 * np.arange(5) + 1)
    matrix = np.polynomial.legendre.legvander(nodes, 4) * scale
    assert is_exact(matrix[:, :4], weights / 2)
    assert not is_exact(matrix, weights / 2)
    found = projection_coefficients(matrix[:, :4], weights / 2, nodes**3)
    np.testing.assert_allclose(
        found * scale[:4], np.polynomial.legendre.poly2leg([0, 0, 0, 1]), atol=1e-14
    )


def test_cross_validation_is_not_taken_in_by_choosing():
    """Of values that follow no term at all, the chosen ones still seem to predict them."""
    rng = np.random.default_rng(8)
    matrix = np.column_stack([np.ones(100), rng.normal(size=(100, 600))])
    values = rng.normal(size=100)
    fit = sparse_regression(matrix, values)
    assert fit is not None
    assert fit.leave_one_out < 0.7
    assert cross_validation(matrix, values, np.arange(100) % FOLDS) > 0.95
