"""Statistics of a model whose stand-ins have run many more points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from uqpen.statistics.control_variates import GroupRuns, MatchedThresholds, linear_estimate

BOTH, ONLY_STAND_IN = np.array([True, True]), np.array([False, True])


def groups(common, further):
    """Runs of a model and its stand-in, and further ones of the stand-in."""
    alone = np.stack([np.zeros_like(further), further])
    return GroupRuns(BOTH, common), GroupRuns(ONLY_STAND_IN, alone)


def noisy(seed, noise, runs=60):
    """A standard normal model, and a stand-in that follows it with a noise."""
    rng = np.random.default_rng(seed)
    x, e = rng.standard_normal((2, runs))
    y, d = rng.standard_normal((2, 40 * runs))
    return groups(np.stack([x, 3 - x + noise * e]), 3 - y + noise * d)


def test_a_stand_in_that_tells_all_gives_the_mean_of_all_points():
    rng = np.random.default_rng(1)
    x, further = rng.random(50), rng.random(5000)
    found = linear_estimate(groups(np.stack([1 + 2 * x, x]), further))
    everywhere = np.concatenate([x, further])
    assert found.value == pytest.approx(1 + 2 * everywhere.mean(), rel=1e-6)
    assert found.error == pytest.approx(2 * everywhere.std() / np.sqrt(5050), rel=0.05)


def test_a_constant_stand_in_leaves_the_plain_mean():
    x = np.random.default_rng(3).standard_normal(100)
    found = linear_estimate(groups(np.stack([x, np.full(100, 7.0)]), np.full(1000, 7.0)))
    assert found.value == pytest.approx(x.mean())


def test_what_a_stand_in_does_beyond_the_common_runs_moves_that_end_out():
    x = np.linspace(-1, 1, 50)
    found = linear_estimate(groups(np.stack([5 - 2 * x, x]), np.full(950, 3.0))).allowance
    # 950 of 1000 lie 2 above the common ones, so 4 below those of the model; a quarter counts.
    assert found.below - found.above == pytest.approx(0.25 * 4 * 0.95)


@pytest.mark.parametrize("noise", [0.1, 3.0])
def test_intervals_of_mean_quantile_and_probability_cover(noise):
    covers = np.zeros(3)
    seeds = 200
    for seed in range(seeds):
        made = noisy(seed, noise)
        mean = linear_estimate(made)
        below, above = mean.margins(0.95)
        thresholds = MatchedThresholds.of(made, 0.95)
        _, *quantile = thresholds.quantile(0.8)
        _, *probability = thresholds.probability_below(1.0, is_strict=False).bounds
        for k, ((lower, upper), true) in enumerate(
            [
                ((mean.value - below, mean.value + above), 0.0),
                (quantile, stats.norm.ppf(0.8)),
                (probability, stats.norm.cdf(1.0)),
            ]
        ):
            covers[k] += lower <= true <= upper
    # Of 200 intervals that cover in 95 %, fewer than 180 do in one of a thousand.
    assert (covers >= 180).all(), covers


def test_a_close_stand_in_makes_quantiles_and_probabilities_narrower():
    widths = []
    for noise in (0.02, 5.0):
        thresholds = MatchedThresholds.of(noisy(4, noise, runs=200), 0.95)
        _, *quantile = thresholds.quantile(0.5)
        _, *probability = thresholds.probability_below(0.3, is_strict=False).bounds
        widths.append([np.ptp(quantile), np.ptp(probability)])
    assert widths[0][0] < 0.5 * widths[1][0]
    assert widths[0][1] < 0.5 * widths[1][1]


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=3, max_size=40))
def test_runs_that_disagree_are_counted_as_by_hand(pairs):
    """At each common value, that a run lies up to it, and the stand-in up to its own."""
    model, stand_in = np.array(sorted(pairs), dtype=float).T
    made = MatchedThresholds(model, stand_in, np.sort(stand_in), 0.95)
    thresholds, found = made._curve
    ends = np.flatnonzero(np.diff(model, append=np.inf))  # the last of equal values
    for k in ends[ends < len(model) - 1]:
        below, stand_in_below = model <= model[k], stand_in <= np.sort(stand_in)[k]
        share = stand_in_below.mean()
        expected = made._corrected(
            share, (below & ~stand_in_below).sum(), (~below & stand_in_below).sum()
        )
        assert thresholds[2 * k] == model[k]
        assert found.value[2 * k] == pytest.approx(float(expected.value))
        assert found.lower[2 * k] == pytest.approx(float(expected.lower))
        assert found.upper[2 * k] == pytest.approx(float(expected.upper))
