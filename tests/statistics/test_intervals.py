"""Formulas of intervals against exact sums, known values and other ways to the same number."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from scipy.stats import qmc

from uqpen.statistics.intervals import (
    additive_residual_error,
    clopper_pearson,
    dkw_half_width,
    order_statistic_ranks,
    ratio_error,
    runs_needed,
    student_quantile,
    upper_rank,
)

# Sums of a few hundred terms and the incomplete beta function agree to some 1e-13; this leaves
# room, and no level below is that close to a step of the binomial law by chance.
ROUNDING = 1e-10

PROBABILITIES = st.floats(0.001, 0.999)
LEVELS = st.sampled_from([0.8, 0.9, 0.95, 0.99])


def binomial_sum(highest, runs, p):
    """P(Binomial(runs, p) <= highest), term by term."""
    return math.fsum(
        math.comb(runs, k) * p**k * (1 - p) ** (runs - k) for k in range(min(highest, runs) + 1)
    )


@pytest.mark.parametrize("freedom", [1, 2, 9, 15, 99, 9999])
@pytest.mark.parametrize("level", [0.5, 0.9, 0.95, 0.99])
def test_student_quantile_is_that_of_scipy(freedom, level):
    expected = stats.t.ppf(0.5 + level / 2, freedom)
    # Both invert the same function, by other routines.
    assert student_quantile(freedom, level) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("freedom", [0, 0.5])
def test_without_degrees_of_freedom_there_is_no_student_quantile(freedom):
    assert math.isnan(student_quantile(freedom, 0.95))


@pytest.mark.parametrize(("replicates", "each"), [(2, 2), (10, 10), (10, 100), (16, 512)])
def test_ratio_error_is_the_scatter_of_replicate_means_of_equal_size(replicates, each):
    values = np.random.default_rng(1).lognormal(size=(replicates, each))
    error, freedom = ratio_error(values.ravel(), np.repeat(np.arange(replicates), each), replicates)
    expected = values.mean(axis=1).std(ddof=1) / math.sqrt(replicates)
    assert freedom == replicates - 1
    assert error == pytest.approx(expected, rel=ROUNDING)


def test_ratio_error_of_unequal_replicates_tells_the_scatter_of_the_pooled_mean():
    rng = np.random.default_rng(3)
    replicate = np.repeat(np.arange(10), [60, 80, 90, *[100] * 7])
    # Replicates that move as a whole: the pooled mean scatters by their weights.
    weights = np.bincount(replicate) / len(replicate)
    moved = [rng.normal(size=10)[replicate] for _ in range(400)]
    squares = [ratio_error(values, replicate, 10)[0] ** 2 for values in moved]
    expected = float(weights @ weights)
    # A mean of 400 chi squares of 9 degrees of freedom scatters by √(2 / 9 / 400) = 2.4 %; four
    # times that, and no bias of order 1 / replicates.
    assert np.mean(squares) == pytest.approx(expected, rel=0.1)


def hypercube(runs, dimension, seed):
    return qmc.LatinHypercube(dimension, rng=seed).random(runs)


@pytest.mark.parametrize(("runs", "dimension"), [(100, 2), (101, 3), (1000, 4)])
def test_additive_fit_is_the_least_squares_fit_of_indicators(runs, dimension):
    inputs = hypercube(runs, dimension, 6)
    influence = np.exp(inputs.sum(axis=1)) + (inputs[:, 0] > inputs[:, 1])
    bins = min(math.isqrt(runs), runs // (2 * dimension))
    rank = stats.rankdata(inputs, axis=0).astype(int) - 1
    columns = [rank[:, [column]] * bins // runs == np.arange(bins) for column in range(dimension)]
    indicators = np.hstack(columns).astype(float)
    fit = indicators @ np.linalg.lstsq(indicators, influence, rcond=None)[0]
    expected_freedom = runs - 1 - dimension * (bins - 1)
    expected = math.sqrt(((influence - fit) ** 2).sum() / expected_freedom / runs)
    error, freedom = additive_residual_error(influence, inputs)
    assert freedom == expected_freedom
    # Backfitting stops after six sweeps, and what it leaves of the fit adds to the residuals: 4e-5
    # at 101 runs of three inputs, less with more runs.
    assert error == pytest.approx(expected, rel=2e-4)


def test_additive_residual_error_counts_only_the_order_of_inputs():
    inputs = hypercube(500, 2, 9)
    influence = np.random.default_rng(10).normal(size=500) + inputs[:, 0] * inputs[:, 1]
    stretched = np.column_stack([np.exp(9 * inputs[:, 0]), inputs[:, 1] ** 3])
    assert additive_residual_error(influence, stretched) == additive_residual_error(
        influence, inputs
    )


@pytest.mark.parametrize("shape", [(50, 0), (3, 2)])
def test_without_room_for_a_fit_the_additive_error_is_the_independent_one(shape):
    influence = np.random.default_rng(11).normal(size=shape[0])
    error, freedom = additive_residual_error(influence, np.ones(shape))
    assert freedom == shape[0] - 1
    assert error == pytest.approx(influence.std(ddof=1) / math.sqrt(shape[0]), rel=ROUNDING)


def test_a_single_run_has_no_additive_error():
    error, freedom = additive_residual_error(np.ones(1), np.ones((1, 2)))
    assert math.isnan(error)
    assert freedom == 0


@pytest.mark.parametrize(
    ("events", "runs", "lower", "upper"),
    [
        # Without an event the upper bound is 1 - 0.025^(1/n) in closed form.
        (0, 10, 0.0, 1 - 0.025**0.1),
        (10, 10, 0.025**0.1, 1.0),
        (0, 1, 0.0, 0.975),
        # As printed tables of exact binomial limits have them, to four digits.
        (5, 10, 0.1871, 0.8129),
        (1, 20, 0.0013, 0.2487),
        (10, 100, 0.0490, 0.1762),
    ],
)
def test_clopper_pearson_has_the_known_bounds(events, runs, lower, upper):
    # Half of the tables' last digit.
    assert np.ravel(clopper_pearson(events, runs, 0.95)) == pytest.approx([lower, upper], abs=6e-5)


@given(st.integers(1, 200), st.data(), LEVELS)
def test_clopper_pearson_bounds_leave_each_tail_its_share(runs, data, level):
    events = data.draw(st.integers(0, runs))
    lower, upper = map(float, clopper_pearson(events, runs, level))
    tail = (1 - level) / 2
    if events:
        reached = 1 - binomial_sum(events - 1, runs, lower)
        assert reached == pytest.approx(tail, abs=ROUNDING)
    else:
        assert lower == 0
    if events < runs:
        assert binomial_sum(events, runs, upper) == pytest.approx(tail, abs=ROUNDING)
    else:
        assert upper == 1


@given(st.integers(1, 300), PROBABILITIES, LEVELS)
@settings(deadline=None)
def test_ranks_enclose_a_quantile_at_least_as_often_as_they_say_and_no_closer_rank_would(
    runs, p, level
):
    lower, upper = map(float, order_statistic_ranks(runs, p, level))
    tail = (1 - level) / 2
    # The quantile is below the value of rank u if at most u - 1 runs lie below it, and above that
    # of rank l if at least l do.
    if math.isnan(upper):
        assert binomial_sum(runs - 1, runs, p) < 1 - tail + ROUNDING
    else:
        assert binomial_sum(int(upper) - 1, runs, p) >= 1 - tail - ROUNDING
        assert binomial_sum(int(upper) - 2, runs, p) < 1 - tail + ROUNDING
    if math.isnan(lower):
        assert 1 - binomial_sum(0, runs, p) < 1 - tail + ROUNDING
    else:
        assert 1 - binomial_sum(int(lower) - 1, runs, p) >= 1 - tail - ROUNDING
        assert 1 - binomial_sum(int(lower), runs, p) < 1 - tail + ROUNDING
    if not math.isnan(lower + upper):
        covers = binomial_sum(int(upper) - 1, runs, p) - binomial_sum(int(lower) - 1, runs, p)
        assert covers >= level - ROUNDING


@pytest.mark.parametrize("runs", [10_000, 1_000_000])
@pytest.mark.parametrize("p", [1e-4, 0.05, 0.5, 0.99, 0.9999])
def test_upper_rank_of_many_runs_is_one_more_than_the_binomial_quantile(runs, p):
    rank = stats.binom.ppf(0.95, runs, p) + 1
    expected = rank if rank <= runs else math.nan
    np.testing.assert_array_equal(upper_rank(runs, p, 0.95), expected)


@pytest.mark.parametrize(
    ("p", "needed"), [(0.95, 59), (0.99, 299), (0.999, 2995), (0.9999, 29_956)]
)
def test_the_largest_of_just_enough_runs_bounds_a_quantile_from_above(p, needed):
    # Wilks (1941): 1 - p^n >= 0.95.
    assert runs_needed(p, 0.95) == needed
    assert upper_rank(needed, p, 0.95) == needed
    assert np.isnan(upper_rank(needed - 1, p, 0.95))


@pytest.mark.parametrize("runs", [1, 100, 10_000])
def test_dkw_band_at_95_percent_is_the_root_of_ln_40_over_twice_the_runs(runs):
    expected = math.sqrt(math.log(40) / (2 * runs))
    assert dkw_half_width(runs, 0.95) == pytest.approx(expected, rel=ROUNDING)


def test_without_runs_there_is_no_band():
    assert math.isnan(dkw_half_width(0, 0.95))
