"""Corrected estimates of surrogates: what real runs add to a surrogate's figures."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from corrected_surrogates import NORMAL, STREAM, corrected_by, made
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import stats

from uqpen.archive.estimates import interval_text
from uqpen.core.labels import (
    MISSING_BEYOND,
    MISSING_LOWEST,
    MISSING_PREDICTED,
    MISSING_SHARES,
    RUN,
    STATUS,
)
from uqpen.core.status import Status
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quadrature import Quadrature
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import bonett_price, clopper_pearson
from uqpen.statistics.surrogate.corrected_cdf import CorrectedCdf
from uqpen.statistics.surrogate.corrected_moments import CorrectedMoments, corrected_mean, spacing
from uqpen.statistics.surrogate.corrected_statistics import narrower
from uqpen.statistics.surrogate.correction_runs import CorrectionRuns, missing_run_predictions
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos


def runs_of(seed=0, runs=40, error=0.3, missing=0, slope=1.0):
    """Runs of a normal output with predictions that err, in two folds."""
    rng = np.random.default_rng(seed)
    truth, predicted = rng.normal(size=(2, runs))
    return CorrectionRuns(
        truth,
        slope * truth + error * predicted,
        np.arange(runs) % 2,
        np.hypot(slope, error) * rng.normal(size=(2, 64)),
        np.arange(64) % 4,
        rng.normal(size=missing),
        np.arange(missing) % 2,
    )


def in_one_fold(runs):
    """The same runs in a single fold: no other one decides that it does without its fit."""
    fold, missing = np.zeros_like(runs.fold), np.zeros_like(runs.missing_fold)
    return replace(runs, fold=fold, missing_fold=missing, draws=runs.draws[:1])


def corrected(study, training, check=None, order=2):
    """Return the corrected statistics of a polynomial chaos."""
    return corrected_by(study, PolynomialChaos(design="training", order=order), training, check)


def test_bonett_and_price_is_its_formula():
    centre, half = bonett_price(np.array(7), np.array(2), 48, 0.95)
    assert centre == pytest.approx(8 / 50 - 3 / 50)
    expected = stats.norm.ppf(0.975) * math.sqrt((11 / 50 - (5 / 50) ** 2) / 50)
    assert half == pytest.approx(expected)


def test_a_useless_surrogate_leaves_the_plain_mean():
    runs = replace(runs_of(), predictions=np.zeros(40), draws=np.zeros((2, 64)))
    found = corrected_mean(runs, runs.values, runs.predictions, runs.draws)
    assert found.weight == 0
    assert found.value == pytest.approx(runs.values.mean())
    assert found.error == pytest.approx(runs.values.std(ddof=1) / math.sqrt(40))


def test_an_exact_surrogate_has_the_error_of_its_draws_and_of_rare_values():
    rng = np.random.default_rng(2)
    values, draws = rng.normal(size=50), rng.normal(size=4096)
    exact = np.array([[0.0, 1.0]])
    at = np.repeat(np.arange(16), 256)
    fold = np.zeros(50, dtype=np.int64)
    runs = CorrectionRuns(
        values, values, fold, draws[None], at, values[:0], fold[:0], exact_moments=exact
    )
    mean, std = CorrectedMoments(runs).mean(), CorrectedMoments(runs).std()
    assert mean.value == pytest.approx(0, abs=1e-12)
    assert mean.lower < -1e-3
    assert mean.upper > 1e-3
    assert std.value == pytest.approx(1)
    assert std.lower < 0.999
    assert std.upper > 1.001


@pytest.mark.parametrize("shape", [-1.0, 0.0, 0.3])
def test_a_gap_is_that_up_to_the_largest_value_that_the_tail_lets_expect(shape):
    tail = stats.genpareto(shape)
    # Fifty values above the threshold 0 at their plotting positions: the largest is a typical one.
    above = tail.ppf((np.arange(50) + 0.5) / 50)
    values = np.concatenate([np.linspace(-1, 0, 450), above])
    expected = tail.ppf(0.84 ** (1 / 50))
    # Plotting positions have the L-moments of the distribution within a few per cent.
    assert 500 * spacing(values) == pytest.approx(expected, rel=0.05)


@given(st.integers(0, 10**6), st.integers(3, 400))
def test_a_gap_has_at_least_the_range_of_the_furthest_tenth(seed, size):
    values = np.random.default_rng(seed).standard_t(3, size)
    furthest = np.sort(values)[-1 - min(max(2, size // 10), size - 1) :]
    assert size * spacing(values) >= np.ptp(furthest) * (1 - 1e-12)


@given(st.integers(0, 10**6), st.sampled_from([-3.0, 0.5, 40.0]), st.sampled_from([-7.0, 0.0, 9.0]))
def test_moments_follow_the_unit(seed, factor, offset):
    runs = runs_of(seed, missing=2)
    other = replace(
        runs,
        values=factor * runs.values + offset,
        predictions=factor * runs.predictions + offset,
        draws=factor * runs.draws + offset,
        missing_predictions=factor * runs.missing_predictions + offset,
    )
    one, moved = CorrectedMoments(runs), CorrectedMoments(other)
    ends = sorted(factor * end + offset for end in one.mean().bounds)
    assert sorted(moved.mean().bounds) == pytest.approx(ends)
    ends = [abs(factor) * end for end in one.std().bounds]
    assert list(moved.std().bounds) == pytest.approx(ends, nan_ok=True)


@given(st.integers(0, 10**6), st.floats(-1, 1))
def test_the_interval_of_a_probability_has_every_outcome_of_the_missing_runs(seed, limit):
    runs = in_one_fold(runs_of(seed, missing=3))

    def of(runs):
        found = CorrectedCdf(runs).above(np.array([limit]))
        return float(found.value[0]), float(found.lower[0]), float(found.upper[0])

    _, lower, upper = of(runs)
    for outcome in itertools.product((limit - 1, limit + 1), repeat=3):
        whole = replace(
            runs,
            values=np.concatenate([runs.values, outcome]),
            predictions=np.concatenate([runs.predictions, runs.missing_predictions]),
            fold=np.concatenate([runs.fold, runs.missing_fold]),
            missing_predictions=runs.missing_predictions[:0],
            missing_fold=runs.missing_fold[:0],
        )
        _, least, most = of(runs)
        _, low, high = of(whole)
        assert least - 1e-12 <= low
        assert high <= most + 1e-12
    assert 0 <= lower <= upper <= 1


@given(st.integers(0, 10**6), st.sampled_from([0.1, 0.5, 0.8]))
def test_a_quantiles_interval_inverts_that_of_the_probability(seed, p):
    cdf = CorrectedCdf(in_one_fold(runs_of(seed, runs=60)))
    value, lower, upper = (float(each[0]) for each in cdf.quantile(np.array([p])))
    assert lower <= value <= upper
    every = np.sort(np.concatenate([cdf.runs.values, cdf.runs.predictions]))
    found = cdf.at(every)
    has = (found.lower <= p) & (p <= found.upper)
    inside = (lower <= every) & (every < upper)
    assert inside[has].all()


@given(
    st.integers(0, 10**6),
    st.integers(10, 80),
    st.integers(1, 5),
    st.sampled_from([0.0, 0.05, 0.3, 2.0]),
    st.sampled_from([-1.0, 0.0, 0.5, 1.0]),
    st.integers(0, 4),
    st.booleans(),
    st.booleans(),
)
@example(0, 38, 1, 0.0, -1.0, 0, False, True)  # weights whose sum is not quite 1
def test_quantiles_ascend_and_are_of_the_distribution_function(
    seed, size, folds, error, slope, missing, is_rounded, is_weighted
):
    rng = np.random.default_rng(seed)
    runs = runs_of(seed, max(size, 2 * folds), error, missing, slope)
    runs = replace(
        runs,
        fold=np.arange(runs.size) % folds,
        missing_fold=np.arange(missing) % folds,
        draws=np.hypot(slope, error) * rng.normal(size=(folds, 64)),
    )
    if is_rounded:  # many equal values
        runs = runs.of(lambda values: np.round(2 * values) / 2)
    if is_weighted:
        weights = rng.uniform(0.5, 1.5, runs.size + missing)
        runs = replace(runs, weights=weights[: runs.size], missing_weights=weights[runs.size :])
    cdf = CorrectedCdf(runs)
    p = np.unique(np.concatenate([np.linspace(0, 1, 41), rng.uniform(size=40)]))
    value, lower, upper = cdf.quantile(p)
    # No lower bound is minus infinity, no upper one infinity.
    lower, upper = (
        np.where(np.isnan(lower), -np.inf, lower),
        np.where(np.isnan(upper), np.inf, upper),
    )
    assert (lower <= value).all()
    assert (value <= upper).all()
    for ends in (value, lower, upper):
        assert (ends[1:] >= ends[:-1]).all()
    limits = np.unique(np.concatenate([runs.values, runs.predictions, 3 * rng.normal(size=40)]))
    found, above, below = cdf.at(limits), cdf.above(limits), cdf.below(limits)
    for each in (found, below):
        assert (each.lower >= 0).all()
        assert (each.lower <= each.value).all()
        assert (each.value <= each.upper).all()
        assert (each.upper <= 1).all()
        for ends in (each.value, each.lower, each.upper):
            assert (ends[1:] >= ends[:-1]).all()
    assert (above.value == 1 - found.value).all()
    assert (above.lower == 1 - found.upper).all()
    assert (below.value <= found.value).all()
    # A quantile is at most a value where the distribution function there is at least p.
    at = cdf.at(value).value
    assert (at >= p - 1e-12).all()
    is_reached = found.value[:, None] >= p
    known = np.isin(limits, np.concatenate([runs.values, runs.predictions]))
    assert ((value <= limits[:, None]) == is_reached)[known].all()


def test_requests_do_not_change_each_other():
    cdf = CorrectedCdf(runs_of(3, slope=0.5, error=0.8))
    p, limits = np.linspace(0, 1, 21), np.linspace(-2, 2, 21)
    for number in (0, 7, 20):
        alone, one = np.ravel(cdf.quantile(p[[number]])), [each[number] for each in cdf.quantile(p)]
        np.testing.assert_array_equal(alone, one)
        alone_at = CorrectedCdf(cdf.runs).at(limits[[number]])
        together = cdf.at(limits)
        assert alone_at.value[0] == together.value[number]
        assert alone_at.upper[0] == together.upper[number]


def test_a_high_quantile_has_an_interval_as_wide_as_a_low_one():
    # Some folds do without their fit, and predict that a value is rare, whichever it is.
    widths = []
    for seed in range(40):
        runs = runs_of(seed, runs=60, slope=0.5, error=0.8)
        for each in (runs, runs.of(np.negative)):
            found = CorrectedCdf(each).at(np.array([-1.3, 1.3]))
            widths.append(found.upper - found.lower)
    low, high = np.mean(widths, axis=0)
    assert high == pytest.approx(low, rel=0.07)


def test_a_fit_that_errs_too_much_is_left_out_by_the_other_folds():
    # Predictions of pure noise: the interval is that of the runs alone.
    runs = runs_of(runs=200, slope=0.0, error=1.0)
    found = CorrectedCdf(runs).above(np.zeros(1))
    events = int((runs.values > 0).sum())
    assert float(found.value[0]) == pytest.approx(events / 200)
    lower, upper = clopper_pearson(events, 200, 0.95)
    assert found.lower == pytest.approx([lower])
    assert found.upper == pytest.approx([upper])
    _, lower, upper = CorrectedCdf(runs).quantile(np.array([0.5]))
    below = [(runs.values <= each[0]).mean() for each in (lower, upper)]
    assert below == pytest.approx([0.43, 0.57], abs=0.01)


@given(st.integers(0, 10**6), st.floats(-1, 1))
def test_a_run_does_not_decide_whether_its_own_fit_is_used(seed, value):
    runs = runs_of(seed, runs=60, slope=0.5, error=0.8)
    other = replace(runs, values=np.where(runs.fold == 0, value, runs.values))
    levels = np.array([0.1, 0.5, 0.8])
    one, changed = (_fit_of_first_fold(each, levels) for each in (runs, other))
    assert (one == changed).all()


def _fit_of_first_fold(runs, levels):
    """Return whether the first fold uses its fit for quantiles."""
    choices = CorrectedCdf(runs).choices
    return choices.choice.uses_fit[0, np.searchsorted(choices.ends, levels)]


def test_a_quantile_beyond_the_runs_has_no_bound():
    value, lower, upper = CorrectedCdf(runs_of()).quantile(np.array([0.999]))
    assert np.isfinite([value, lower]).all()
    assert np.isnan(upper).all()


def test_an_exactly_linear_model_has_intervals_of_everything(study_of):
    study = study_of("3 * a + 4 * b", "[outputs.y]\nexceeds = [5]", a=NORMAL, b=NORMAL)
    found = corrected(study, made(study, MonteCarlo(runs=100)), order=1)
    true = {"mean": 0.0, "std": 5.0, "exceedance": 1 - stats.norm.cdf(1)}
    for name, value in true.items():
        estimate, lower, upper = np.ravel(found[name].values)
        assert lower < value < upper, name
        assert estimate == pytest.approx(value, abs=0.01), name
    assert float(found["std"][0]) == pytest.approx(5, abs=1e-9)
    _, lower, upper = found["half_spread"].values
    assert lower < 5 * stats.norm.ppf(0.84) < upper
    for order in ("first_order", "total_order"):
        lower, upper = found[order].values[:, 1:].T
        assert (lower < [0.36, 0.64]).all()
        assert (upper > [0.36, 0.64]).all()
        assert (upper - lower < 0.1).all()
    assert float(found["mean"].coords["equivalent_runs"]) > 1000
    labels = {
        name: set(np.ravel(found[name]["interval_label"].values))
        for name in found
        if "interval_label" in found[name].coords
    }
    assert labels["mean"] == labels["half_spread"] == labels["first_order"] == {"conservative"}
    assert labels["exceedance"] == labels["cdf"] == {"discrete"}
    assert labels["shapley"] == labels["cdf_band"] == {"none"}


def test_a_bad_surrogate_costs_width_not_truth(study_of):
    study = study_of("np.sign(np.sin(31 * a))", a=(0, 1), b=(0, 1))
    found = corrected(study, made(study, MonteCarlo(runs=100)))
    equivalent = float(found["mean"].coords["equivalent_runs"])
    assert 100 / 1.12**2 < equivalent < 130
    assert abs(float(found["first_order"][1, 1])) < 1e-3
    assert float(found["first_order"][0, 2]) == 1.0


def test_a_bad_surrogate_has_no_wider_interval_than_the_runs_alone(study_of):
    study = study_of(
        "np.sign(np.sin(31 * a)) + a", "[outputs.y]\nexceeds = [1]", a=(0, 1), b=(0, 1)
    )
    found = corrected(study, made(study, MonteCarlo(runs=200)))
    reported = set()
    for name in ("mean", "std", "half_spread", "quantile", "exceedance"):
        equivalent = found[name].coords["equivalent_runs"].values.ravel()
        notes = found[name].coords["note"].values.ravel()
        contradicts = np.array(["does not hold this estimate" in str(note) for note in notes])
        assert (equivalent[np.isfinite(equivalent) & ~contradicts] >= 200 - 1e-6).all(), name
        reported |= {
            name for note in notes if "the interval is that of the runs alone" in str(note)
        }
    assert {"std", "half_spread"} <= reported
    assert (np.diff(found["quantile"].values[:, 0]) >= 0).all()


class TestNarrower:
    """Corrected estimates with the intervals of the runs alone."""

    FOUND = Estimate(1.0, 0.0, 2.0, "corrected", "conservative", "a tail")
    PLAIN = Estimate(1.2, 0.6, 1.8, "plain", "nominal", "a tail")

    def test_takes_the_narrower_interval_and_keeps_the_estimate(self):
        found = narrower(self.FOUND, self.PLAIN, runs_of(), is_index=False)
        assert found.bounds.tolist() == [1.0, 0.6, 1.8]
        assert (found.method, found.label) == ("plain", "nominal")
        assert found.note == (
            "a tail; the interval is that of the runs alone, as the surrogate does not make it "
            "narrower"
        )

    def test_keeps_an_interval_that_is_no_wider(self):
        same = replace(self.PLAIN, lower=0.0, upper=2.0)
        assert narrower(self.FOUND, same, runs_of(), is_index=False) is self.FOUND

    def test_takes_one_with_both_ends_for_one_without(self):
        open_end = replace(self.FOUND, upper=math.nan, note="no upper bound")
        found = narrower(open_end, self.PLAIN, runs_of(), is_index=False)
        assert found.bounds.tolist() == [1.0, 0.6, 1.8]
        assert "no upper bound" not in found.note

    def test_keeps_a_wider_one_where_the_other_does_not_hold_the_estimate(self):
        elsewhere = replace(self.PLAIN, lower=1.1)
        found = narrower(self.FOUND, elsewhere, runs_of(), is_index=False)
        assert found.bounds.tolist() == self.FOUND.bounds.tolist()
        assert "narrower interval, which does not hold this estimate" in found.note

    def test_takes_the_other_without_a_look_at_widths_for_a_useless_surrogate(self):
        wide = replace(self.PLAIN, lower=-5.0, upper=5.0)
        useless = runs_of(slope=-1.0)
        assert useless.q2 < 0
        found = narrower(self.FOUND, wide, useless, is_index=False)
        assert found.bounds.tolist() == [1.0, -5.0, 5.0]
        assert narrower(self.FOUND, wide, useless, is_index=True) is self.FOUND

    def test_keeps_an_index_if_the_surrogate_explains_less_than_half(self):
        poor = runs_of(error=0.6)
        assert 0 < poor.q2 < 0.5
        found = narrower(self.FOUND, self.PLAIN, poor, is_index=True)
        assert found.bounds.tolist() == self.FOUND.bounds.tolist()
        assert "supposes a smooth output; the surrogate explains" in found.note
        assert narrower(self.FOUND, self.PLAIN, runs_of(), is_index=True).method == "plain"

    @pytest.mark.parametrize(
        "plain", [replace(PLAIN, label="none"), replace(PLAIN, upper=math.nan)]
    )
    def test_needs_an_interval_of_the_runs_alone(self, plain):
        assert narrower(self.FOUND, plain, runs_of(), is_index=False) is self.FOUND

    def test_leaves_a_refusal_and_what_corrects_missing_runs(self):
        refused = Estimate.without_bounds(1.0, "a heavy tail")
        assert narrower(refused, self.PLAIN, runs_of(), is_index=False) is refused
        assert narrower(self.FOUND, self.PLAIN, runs_of(missing=1), is_index=False) is self.FOUND


@pytest.mark.parametrize("missing", [0, 3])
def test_errors_of_both_ends_of_the_half_spread_add_up(missing):
    """As those of independent ends do; what missing runs may do adds up as it is."""
    cdf = CorrectedCdf(runs_of(3, 200, missing=missing))
    (low, high), (low_least, high_least), (low_most, high_most) = cdf.quantile(
        np.array([0.16, 0.84])
    )
    combined = np.add if missing else np.hypot
    value, lower, upper = cdf.half_spread()
    assert value == pytest.approx((high - low) / 2)
    assert value - lower == pytest.approx(combined(low_most - low, high - high_least) / 2)
    assert upper - value == pytest.approx(combined(low - low_least, high_most - high) / 2)


def test_failed_runs_widen_and_are_reported(study_of):
    study = study_of("a + b", "[outputs.y]\nexceeds = [1.3]", a=(0, 1), b=(0, 1))
    runs = made(study, MonteCarlo(runs=200))
    is_missing = (runs["a"].values > 0.7) & (runs["b"].values > 0.7)
    status = np.where(is_missing, Status.FAILED, Status.OK).astype(np.int8)
    y = np.where(is_missing, np.nan, runs["y"].values)
    partial = runs.assign({STATUS: (RUN, status), "y": (RUN, y, runs["y"].attrs)})
    found = corrected(study, partial, order=1)
    true = {"mean": 1.0, "exceedance": 0.245}
    for name, value in true.items():
        _, lower, upper = np.ravel(found[name].values)
        assert lower < value < upper, name
        assert "of all admissible inputs" in str(np.ravel(found[name].coords["note"].values)[0])
    model = study.models[""].model
    fitted = PolynomialChaos(design="t", order=1).fit("pce", partial, model, study.joint, STREAM)
    predicted = missing_run_predictions(fitted, partial, study.model_quantities(model))["y"]
    assert predicted[MISSING_PREDICTED] == is_missing.sum()
    assert predicted[MISSING_LOWEST] == pytest.approx(runs["y"].values[is_missing].min())
    assert predicted[MISSING_BEYOND] == ["> 1.3"]
    assert predicted[MISSING_SHARES] == [1.0]


def test_only_check_runs_correct_a_fit_to_a_rule(study_of):
    study = study_of("a ** 2 + b", a=(0, 1), b=(0, 1))
    rule, check = made(study, Quadrature(order=4)), made(study, MonteCarlo(runs=80))
    alone = corrected(study, rule)
    assert set(_labels(alone)) == {"none"}
    assert interval_text(alone["mean"], "note") == (
        "the training runs are no sample of the input distribution"
    )
    _, lower, upper = corrected(study, rule, check)["mean"].values
    assert lower < 5 / 6 < upper


def test_check_runs_that_do_not_vary_leave_no_spread(study_of):
    limit = "[outputs.y]\nexceeds = [0.5]"
    study = study_of("np.where(a > 0.97, 1.0, 0.0)", limit, a=(0, 1), b=(0, 1))
    rule, check = made(study, Quadrature(order=20)), made(study, MonteCarlo(runs=12))
    assert np.ptp(check["y"].values) == 0
    found = corrected(study, rule, check)
    assert found["std"].coords["interval_label"] == "none"
    _, lower, upper = found["exceedance"].values[0]
    assert lower <= 0.03 <= upper


def _labels(statistics):
    arrays = [each for each in statistics.values() if "interval_label" in each.coords]
    return [str(label) for each in arrays for label in np.ravel(each["interval_label"].values)]


@given(st.integers(0, 10**6))
def test_equal_weights_are_none(seed):
    runs = runs_of(seed, missing=2)
    weighted = replace(runs, weights=np.ones(runs.size), missing_weights=np.ones(runs.missing))
    for one, other in zip(*(_moments(each) for each in (runs, weighted)), strict=True):
        assert other == pytest.approx(one, nan_ok=True)
    centre, half = bonett_price(3, 2, 40, 0.95)
    assert bonett_price(3, 2, 40, 0.95, squares=5) == (centre, pytest.approx(half))


def _moments(runs):
    return (*CorrectedMoments(runs).mean().bounds, *CorrectedMoments(runs).std().bounds)


def test_heavy_weights_widen_an_interval_and_scale_what_they_weigh():
    runs = runs_of(7)
    # Predictions below all runs: what lies above is of the runs alone.
    below = runs.values.min() - 1
    runs = replace(
        in_one_fold(runs),
        predictions=np.full_like(runs.values, below),
        draws=np.full_like(runs.draws[:1], below),
    )
    happens = runs.values > 0.5

    def probability(weights):
        weighted = replace(runs, weights=weights, missing_weights=weights[:0])
        return CorrectedCdf(weighted).above(np.array([0.5]))

    even, heavy = probability(np.ones(40)), probability(np.where(happens, 0.5, 1.5))
    assert float(even.value[0]) == pytest.approx(happens.mean())
    assert float(heavy.value[0]) == pytest.approx(happens.mean() / 2)
    assert probability(np.where(happens, 1.5, 0.5)).upper > even.upper
