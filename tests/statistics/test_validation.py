"""A model against measurements: exact answers, ranks among draws, verdicts and their reasons."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, optimize, stats
from validation_coverage import comparison

from uqpen.archive.estimates import pack, unpack
from uqpen.archive.structure import find_dataset_faults
from uqpen.core.catalogue import VALIDATION_STATISTICS
from uqpen.core.model import Output
from uqpen.core.statistic import AcceptanceVerdict, UnitRule
from uqpen.core.streams import Stream
from uqpen.statistics.validation import (
    Validation,
    area_metric,
    crps_by_draw,
    kolmogorov_distance,
    score_difference,
    validation_statistics,
)

DEPTH = Output("depth", "m")


def validation(measured, predicted, std=1.0, **changes):
    """Measurements with independent errors, drawn with a seed."""
    measured, predicted = np.asarray(measured, float), np.asarray(predicted, float)
    rows, rng = len(measured), np.random.default_rng(7)
    given = {
        "measured": measured,
        "censoring": np.zeros(rows, int),
        "predicted": predicted,
        "errors": std * rng.standard_normal(predicted.shape),
        "covariance": np.eye(rows) * std**2,
        "used_before": np.zeros(rows, bool),
        "level": 0.95,
        "stream": Stream(1, "validation"),
    }
    return Validation(**{**given, **changes})


def found(of):
    return dict(validation_statistics(of, DEPTH))


def note(array):
    return str(array.coords["note"].values)


# Exact answers


def test_the_standard_uncertainty_adds_inputs_numerics_and_measurement_in_squares():
    draws = 0.02 * np.sqrt(39 / 40) * np.tile([[1.0], [-1.0]], (20, 1)) + 1.2
    of = found(validation([1.0], draws, 0.04, numerical_std=0.05))
    assert of["comparison_error"].values[0, 0] == pytest.approx(0.2, abs=1e-15)
    assert of["validation_uncertainty"].item() == pytest.approx(0.0670820393, abs=1e-10)
    assert of["z_score"].item() == pytest.approx(0.2 / 0.0670820393, abs=1e-8)


ERROR = np.array([0.3, -0.1, 0.2])
COVARIANCE = np.array([[0.04, 0.01, 0], [0.01, 0.05, 0.01], [0, 0.01, 0.06]])


def test_the_joint_statistic_of_a_model_without_scatter_is_that_of_the_stated_covariance():
    # A Cholesky factor of the covariance gives errors that follow it.
    errors = np.random.default_rng(1).standard_normal((4000, 3)) @ np.linalg.cholesky(COVARIANCE).T
    of = found(validation(-ERROR, np.zeros((4000, 3)), covariance=COVARIANCE, errors=errors))
    assert of["joint_statistic"].item() == pytest.approx(3.8636363636, abs=1e-10)
    value, lower, upper = of["joint_p_value"].values
    # Half of an interval of a share over 4000 draws is 0.014.
    assert lower < 0.2765704182 < upper
    assert value == pytest.approx(0.2765704182, abs=0.014)


def test_values_that_inputs_were_fitted_to_have_the_test_of_their_residuals_alone():
    used = np.ones(3, bool)
    of = validation(-ERROR, np.zeros((50, 3)), covariance=COVARIANCE, used_before=used, accept=9.0)
    seen = found(of)
    assert seen["residual_chi_squared"].item() == pytest.approx(3.8636363636, abs=1e-10)
    assert seen["residual_p_value"].item() == pytest.approx(0.2765704182, abs=1e-10)
    seen = found(replace(of, fitted_inputs=1))
    assert seen["residual_p_value"].item() == pytest.approx(stats.chi2.sf(3.8636363636, 2))
    for name in ("joint_p_value", "share_inside", "area", "ks_p_value"):
        assert note(seen[name]) == "each value is a bound, or inputs were fitted to it"
    assert seen["row_verdict"].values.tolist() == ["not decided"] * 3
    assert seen["verdict"].item() == "not decided"
    assert "residual_p_value" not in found(replace(of, fitted_inputs=3))


@pytest.mark.parametrize(
    ("inside", "level", "bounds", "p"),
    [
        (18, 0.95, (0.683017, 0.987651), 0.2641),
        (14, 0.9, (stats.beta.ppf(0.05, 14, 7), stats.beta.ppf(0.95, 15, 6)), 0.011253),
    ],
)
def test_the_share_inside_has_the_exact_interval_and_says_how_not_to_judge_it(
    inside, level, bounds, p
):
    measured = np.where(np.arange(20) < inside, 0.0, 50.0)
    share = found(validation(measured, np.zeros((60, 20)), level=level))["share_inside"]
    assert share.values == pytest.approx([inside / 20, *bounds], abs=1e-6)
    assert note(share) == (
        f"as if the values had no error in common, binomial p = {p:.2g}: judge by share_p_value"
    )


def test_the_area_metric_is_the_area():
    assert area_metric(np.array([0.1, 0.4, 0.7])) == pytest.approx(0.1155555556, abs=1e-10)
    assert area_metric(np.array([0.5])) == 0.25
    pit = np.random.default_rng(2).random((3, 7)) ** 2
    for row, area, distance in zip(pit, area_metric(pit), kolmogorov_distance(pit), strict=True):
        function = lambda u, row=row: abs(np.mean(row <= u) - u)  # noqa: E731
        # The integral is over steps, which quadrature has to be given.
        assert area == pytest.approx(integrate.quad(function, 0, 1, points=np.sort(row))[0])
        assert distance == pytest.approx(stats.kstest(row, "uniform").statistic)


@pytest.mark.parametrize(("rows", "quantile"), [(5, 0.256), (10, 0.182), (20, 0.129)])
def test_the_null_of_the_area_metric_is_that_of_independent_values(rows, quantile):
    draws = np.random.default_rng(3).standard_normal((4000, rows))
    of = found(validation(np.zeros(rows), draws))
    # The mean is asymptotic; 4000 draws leave standard errors of 0.7 % and 1.5 % of them.
    assert of["area_null"].item() == pytest.approx(0.3133 / math.sqrt(rows), rel=0.03)
    assert of["area_null_quantile"].item() == pytest.approx(quantile, rel=0.05)


def test_the_score_is_the_continuous_ranked_probability_score_without_bias():
    rng = np.random.default_rng(4)
    simulated, measured = rng.standard_normal((9, 2)), np.array([0.3, -2.0])
    pairs = np.abs(simulated[:, None] - simulated).sum(axis=(0, 1)) / (9 * 8)
    expected = np.abs(simulated - measured).mean(axis=0) - pairs / 2
    assert crps_by_draw(measured, simulated).mean(axis=0) == pytest.approx(expected)
    # Of the standard normal distribution at 0.
    many = crps_by_draw(np.zeros(1), rng.standard_normal((100_000, 1)))
    assert many.mean() == pytest.approx((math.sqrt(2) - 1) / math.sqrt(math.pi), abs=0.003)


# Ranks among draws


@pytest.mark.parametrize(("draws", "rows"), [(60, 4), (25, 40)])
def test_each_draw_of_the_joint_test_is_compared_with_the_others(draws, rows):
    rng = np.random.default_rng(5)
    of = validation(rng.standard_normal(rows), rng.standard_normal((draws, rows)), 0.5)
    distances = []
    for place, simulated in enumerate(of.predicted + of.errors):
        others = np.delete(of.predicted, place, axis=0)
        error = simulated - others.mean(axis=0)
        covariance = np.cov(others.T) + of.covariance
        distances.append(error @ np.linalg.solve(covariance, error))
    seen = found(of)
    larger = int(np.sum(np.array(distances) > seen["joint_statistic"].item()))
    value, lower, upper = seen["joint_p_value"].values * (draws + 1)
    assert larger <= value <= larger + 1
    assert lower < value < upper


def test_p_values_of_a_right_model_are_uniform_also_where_values_have_errors_in_common():
    names = ("joint_p_value", "ks_p_value", "area_p_value")
    p = [
        [seen[name].values[0] for name in names]
        for seen in (found(comparison(seed, 30, 8, 0.9)) for seed in range(40))
    ]
    for name, values in zip(names, np.transpose(p), strict=True):
        assert stats.kstest(values, "uniform").pvalue > 0.001, name


def test_ranks_lie_between_those_of_their_neighbours():
    of = validation([0.0], np.zeros((4, 1)))
    ranks = {
        value: of.rank(np.array([1.0, 2.0, 2.0, 4.0, value])).value * 5
        for value in (0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 9.0)
    }
    assert ranks == pytest.approx(
        {0.0: 4.5, 1.0: 4.0, 1.5: 3.25, 2.0: 2.5, 3.0: 1.75, 4.0: 1.0, 9.0: 0.5}
    )


def test_equal_draws_have_ranks_by_the_stream():
    # Without errors all draws are equal to the measured value, so that its rank may be any.
    drawn = found(validation(np.ones(300), np.ones((30, 300)), 0.0))["pit"].values
    assert stats.kstest(drawn, "uniform").pvalue > 0.001


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_the_detectable_error_is_that_of_the_noncentral_distribution(correlation):
    of = found(comparison(1, 2000, 10, correlation))
    critical = stats.chi2.ppf(0.95, 10)
    size = optimize.brentq(lambda at: stats.ncx2.sf(critical, 10, at) - 0.8, 1, 50)
    inverse = np.linalg.inv((1 - correlation) * np.eye(10) + correlation)
    # 2000 draws leave 4 % of the quantile at 80 %.
    assert of["detectable_error"].values[:, 0] == pytest.approx(
        np.full(10, math.sqrt(size / inverse[0, 0])), rel=0.05
    )
    value, lower, upper = of["detectable_common_error"].values
    assert value == pytest.approx(math.sqrt(size / inverse.sum()), rel=0.05)
    assert lower < value < upper


def test_a_numerical_error_that_values_have_in_common_is_no_false_alarm():
    rng = np.random.default_rng(6)
    predicted = rng.standard_normal((400, 10))
    without = validation(np.full(10, 3.0), predicted)
    assert found(without)["joint_p_value"].values[0] < 0.01
    assert found(replace(without, numerical_std=3.0))["joint_p_value"].values[0] > 0.3


# What is left out


def test_draws_with_a_failed_run_are_left_out_whole_and_counted():
    rng = np.random.default_rng(8)
    whole = validation(rng.standard_normal(4), rng.standard_normal((60, 4)))
    predicted = whole.predicted.copy()
    predicted[[5, 9], [0, 3]] = np.nan
    kept = np.isfinite(predicted).all(axis=1)
    failed = found(replace(whole, predicted=predicted))
    fewer = found(replace(whole, predicted=predicted[kept], errors=whole.errors[kept]))
    assert (failed["draws"].item(), failed["failed_draws"].item()) == (58, 2)
    assert failed["joint_p_value"].values.tolist() == fewer["joint_p_value"].values.tolist()
    assert failed["pit"].values.tolist() == fewer["pit"].values.tolist()
    assert failed["comparison_error"].coords["note"].values[0] == (
        "without a numerical error, as none is stated; without 2 of 60 draws, in which a run failed"
    )


def test_too_few_draws_give_a_reason():
    rng = np.random.default_rng(9)
    of = validation(np.zeros(3), rng.standard_normal((19, 3)))
    for name in ("joint_p_value", "share_inside", "area", "detectable_common_error"):
        assert note(found(of)[name]) == "19 draws are too few: 20 at least"
    strict = replace(of, level=0.99)
    assert note(found(strict)["joint_p_value"]) == "19 draws are too few: 99 at least"
    none = replace(of, predicted=np.full((19, 3), np.nan))
    assert {name: array.item() for name, array in found(none).items()} == {
        "draws": 0,
        "failed_draws": 19,
    }


def test_values_without_scatter_of_their_own_give_a_reason():
    draws = np.repeat(np.random.default_rng(10).standard_normal((40, 1)), 2, axis=1)
    of = validation([0.0, 0.0], draws, covariance=np.ones((2, 2)))
    reason = (
        "some combination of the values has no scatter, neither among draws nor by errors of "
        "measurement"
    )
    assert note(found(of)["joint_p_value"]) == reason
    assert note(
        found(replace(of, covariance=np.zeros((2, 2)), predicted=0 * draws))["joint_p_value"]
    )


def test_bounds_are_inside_or_not_and_are_not_in_the_joint_test():
    rng = np.random.default_rng(11)
    draws = rng.standard_normal((500, 4))
    whole = validation([0.5, 1.0, 9.0, 9.0], draws, accept=4.0)
    of = found(replace(whole, censoring=np.array([0, 1, 1, -1])))
    alone = replace(
        whole,
        **{name: getattr(whole, name)[:1] for name in ("measured", "censoring", "used_before")},
        **{name: getattr(whole, name)[:, :1] for name in ("predicted", "errors")},
        covariance=np.eye(1),
    )
    p_value = found(alone)["joint_p_value"].values
    assert of["joint_p_value"].values == pytest.approx(p_value, rel=1e-12)
    assert of["inside"].values.tolist() == [1, 1, 0, 1]
    # The draws have a standard deviation of 1.4: a quarter of them are beyond 1.
    assert of["pit"].values[1] > 0.7
    assert np.isnan(of["comparison_error"].values[1:]).all()
    notes = of["comparison_error"].coords["note"].values
    assert notes[1].startswith("no value was measured, but a bound; ")
    assert np.isnan(of["detectable_error"].values[1:]).all()
    assert of["detectable_error"].coords["note"].values.tolist() == [
        "",
        *["not in the joint test: a bound, or used before"] * 3,
    ]
    assert of["row_verdict"].values.tolist() == ["met", *["not decided"] * 3]
    assert of["verdict"].item() == "met"


def test_censored_values_have_uniform_ranks():
    # Targets that are perforated: what is beyond 0.5 is seen as a bound.
    rng, pits = np.random.default_rng(12), []
    for seed in range(40):
        true, errors = rng.standard_normal((2, 5))
        measured = np.minimum(true + errors, 0.5)
        of = validation(
            measured,
            rng.standard_normal((60, 5)),
            errors=rng.standard_normal((60, 5)),
            censoring=(measured == 0.5).astype(int),
            stream=Stream(seed),
        )
        pits += found(of)["pit"].values.tolist()
    assert stats.kstest(pits, "uniform").pvalue > 0.001


# Verdicts


def test_a_verdict_is_met_where_the_whole_interval_is_accepted_and_not_where_none_is():
    draws = np.random.default_rng(13).standard_normal((400, 4)) * [1, 1, 1, 1] / 100
    of = validation([0.0, 3.0, 9.0, 0.0], draws, accept=4.0)
    of = replace(of, used_before=np.array([False, False, False, True]))
    seen = found(of)
    assert seen["row_verdict"].values.tolist() == ["met", "not decided", "not met", "not decided"]
    assert seen["verdict"].item() == "not met"
    assert of.verdicts(0.95)[0] is AcceptanceVerdict.MET
    assert "verdict" not in found(replace(of, accept=None))
    # By two values together the third, 4.9 of 4 with an interval of 1.96, is not yet not met.
    assert (
        found(replace(of, measured=np.array([0.0, 0, 6.1, 0])))["verdict"].item() == "not decided"
    )


def test_intervals_of_the_model_error_are_wider_the_fewer_draws_estimate_them():
    few = np.tile([[1.0], [-1.0]], (3, 1))
    of = found(validation([0.0], few, 1e-9))["comparison_error"]
    std = np.std(few, ddof=1)
    half = stats.t.ppf(0.975, 5) * std * math.sqrt(1 + 1 / 6)
    assert of.values[0] == pytest.approx([0.0, -half, half], rel=1e-6)


# Several models


def test_models_are_compared_by_the_scores_of_common_draws():
    rng = np.random.default_rng(14)
    draws, measured = rng.standard_normal((300, 6)), rng.standard_normal(6)
    right = validation(measured, draws)
    wrong = replace(right, predicted=draws + 2.0)
    worse = score_difference(wrong, right)
    assert worse.lower > 0
    better = score_difference(right, wrong)
    assert (better.value, better.lower) == pytest.approx((-worse.value, -worse.upper))
    same = score_difference(right, replace(right))
    assert (same.value, same.lower, same.upper) == (0.0, 0.0, 0.0)
    each = [found(of)["mean_crps"].values for of in (wrong, right)]
    assert worse.value == pytest.approx(each[0][0] - each[1][0])
    # Draws in common leave the difference a narrower interval than each score alone.
    assert worse.upper - worse.lower < np.ptp(each[0][1:]) + np.ptp(each[1][1:])
    failed = wrong.predicted.copy()
    failed[:100, 0] = np.nan
    kept = {name: getattr(right, name)[100:] for name in ("predicted", "errors")}
    fewer = score_difference(
        replace(wrong, predicted=wrong.predicted[100:], errors=right.errors[100:]),
        replace(right, **kept),
    )
    assert score_difference(replace(wrong, predicted=failed), right) == fewer


# The archive


def test_every_statistic_is_in_the_catalogue_and_is_packed_without_a_loss():
    rng = np.random.default_rng(15)
    of = validation(
        rng.standard_normal(6),
        rng.standard_normal((50, 6)),
        accept=1.0,
        censoring=np.array([0, 0, 0, 0, 0, 1]),
        used_before=np.array([True, True, False, False, False, False]),
    )
    seen = found(of)
    # What is known of the rows, and another model, is not of one validation.
    others = {"experiment_number", "file_row", "row_hash", "bound_side", "condition"}
    others.add("score_difference")
    assert seen.keys() == VALIDATION_STATISTICS.keys() - others
    dataset = pack(seen)
    assert list(find_dataset_faults(dataset, VALIDATION_STATISTICS)) == []
    for name, array in seen.items():
        record = VALIDATION_STATISTICS[name]
        assert array.dims == (*record.dims, *(("bound",) if record.has_bounds else ())), name
        assert array.attrs["units"] == ("1" if record.unit is UnitRule.NONE else "m"), name
        assert array.attrs["long_name"] == record.title
        unpacked = unpack(dataset, name)
        assert unpacked is not None
        np.testing.assert_array_equal(unpacked.values, array.values)
