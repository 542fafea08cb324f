"""Weights of runs under another joint distribution: exact answers, supports and the rules."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reweighting_coverage import SETTINGS, compared, estimates

from uqpen.core.model import Input
from uqpen.distributions.copulas import ClaytonCopula, GaussianCopula
from uqpen.distributions.distribution import Distribution, UnloadedDistribution
from uqpen.distributions.input_group import SampleDistribution
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.distributions.univariate import (
    Beta,
    Choice,
    Gamma,
    Lognormal,
    Mixture,
    Normal,
    Poisson,
    Student,
    Truncated,
    Uniform,
    Weibull,
)
from uqpen.statistics.reweighting import (
    LEAST_SHARE,
    changed_inputs,
    effective_share,
    expected_weights,
    has_enough_on_both_sides,
    log_weights,
)
from uqpen.statistics.weights import (
    effective_sizes,
    weighted_probability_interval,
    weighted_share,
)

BOLTS = ("M8", "M10", "M12")


def joint(*distributions: Distribution, **further: object) -> JointDistribution:
    """Return the joint distribution of inputs x0, x1, …"""
    entries = tuple(
        RandomInput(Input(f"x{k}", "1"), each, "1") for k, each in enumerate(distributions)
    )
    return JointDistribution(entries, tuple(each.variable for each in entries), **further)


def draws(of: JointDistribution, runs: int, seed: int = 1) -> dict[str, np.ndarray]:
    """Return independent draws."""
    unit = np.random.default_rng(seed).random((runs, len(of.random)))
    return of.ppf(of.conditional_probabilities(unit, {}))


@pytest.mark.parametrize(
    ("shift", "scale"), [(0.0, 0.7), (0.5, 1.0), (1.0, 1.2), (2.0, 1.0), (0.3, 1.35)]
)
def test_effective_size_is_known_exactly_beforehand(shift, scale):
    """It is s √(2 - s²) exp(-d²/(2 - s²)) of the runs for normal and for lognormal inputs."""
    rest = 2 - scale**2
    exact = scale * math.sqrt(rest) * math.exp(-(shift**2) / rest)
    found = expected_weights(joint(Normal(0, 1)), joint(Normal(shift, scale)))
    assert found.share == pytest.approx(exact, rel=1e-12)
    assert found.is_exact


@pytest.mark.parametrize("scale", [0.6, 1.3, 1.6])
def test_effective_size_of_other_families_is_found_over_quantiles(scale):
    """For exponential inputs it is (2 - s) s, and there is none from twice the mean on."""
    found = expected_weights(joint(Weibull(1.0, 1.0)), joint(Weibull(1.0, scale)))
    assert found.share == pytest.approx((2 - scale) * scale, rel=1e-9)


def test_effective_size_of_runs_is_the_expected_one():
    of_draws = joint(Normal(0, 1), Gamma(3.0, 1.0), Uniform(0, 1), Poisson(3.0))
    asked = joint(Normal(0.5, 1), Gamma(3.2, 1.0), Beta(2, 2, 0, 1), Poisson(3.5))
    weights = np.exp(log_weights(draws(of_draws, 200_000), of_draws, asked))
    # Of uniform to 6x(1 - x), the mean square is 6/5; of Poisson exp((3.5 - 3)²/3).
    exact = math.exp(-0.25) / 1.2 / math.exp(0.25 / 3)
    expected = expected_weights(of_draws, asked)
    gamma = expected_weights(
        joint(of_draws.random[1].distribution), joint(asked.random[1].distribution)
    )
    assert expected.share == pytest.approx(exact * gamma.share, rel=1e-5)
    assert float(effective_share(weights)) == pytest.approx(expected.share, rel=0.02)
    # Weights have mean 1 where both densities are right.
    assert weights.mean() == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("drawn", "asked", "text"),
    [
        (Normal(0, 1), Normal(0, math.sqrt(2)), "no finite variance"),
        (Normal(0, 1), Normal(0.1, 1.5), "no finite variance"),
        (Lognormal(1, 0.3), Lognormal(1, 0.5), "no finite variance"),
        (Weibull(1.0, 1.0), Weibull(1.0, 2.0), "no finite variance"),
        (Normal(0, 1), Student(0, 1, 30.0), "no finite variance"),
        (Weibull(2.0, 1.0), Weibull(1.5, 1.0), "no finite variance"),
        (Uniform(0, 1), Uniform(0, 1.01), "no run has x0 near 1.0"),
        (Lognormal(1, 0.3), Normal(1, 0.3), "no run has x0 near -"),
        (
            Choice(("M8", "M10"), (), BOLTS),
            Choice(("M8", "M12"), (), BOLTS),
            "no run has x0 near 2",
        ),
        (Normal(3, 1), Poisson(3.0), "single values in one of the two"),
        (Normal(3, 1), UnloadedDistribution("own.py:Load"), "own.py:Load) has no density"),
    ],
)
def test_refused_before_any_run_is_looked_at(drawn, asked, text):
    found = expected_weights(joint(drawn), joint(asked))
    assert text in found.reason
    assert found.share == 0


def test_narrower_supports_and_reordered_labels_are_accepted():
    shares = [
        (Uniform(0, 1), Uniform(0.25, 0.75), 0.5),
        (Normal(0, 1), Truncated(Normal(0, 1), 0.0), 0.5),
        (Choice(BOLTS, (1, 1, 2), BOLTS), Choice(BOLTS[::-1], (2, 1, 1), BOLTS), 1.0),
        (Student(0, 1, 5.0), Normal(0, 1), None),
        (Mixture((Normal(0, 1), Normal(4, 1))), Normal(4, 1), None),
    ]
    for drawn, asked, share in shares:
        found = expected_weights(joint(drawn), joint(asked))
        assert not found.reason
        if share is not None:
            assert found.share == pytest.approx(share, rel=0.005)
    # Half of a mixture of two that are far apart.
    assert found.share == pytest.approx(0.5, rel=0.05)


def test_what_does_not_change_needs_no_density():
    rows = np.random.default_rng(2).random((50, 2))
    unloaded = UnloadedDistribution("own.py:Load")
    parts = [
        joint(
            Normal(at, 1),
            unloaded,
            Uniform(0, 1),
            Uniform(0, 1),
            groups=(SampleDistribution(("x2", "x3"), rows.copy(), np.ones(50)),),
        )
        for at in (0.0, 0.2)
    ]
    assert changed_inputs(*parts) == ("x0",)
    assert not expected_weights(*parts).reason
    other = joint(
        *(each.distribution for each in parts[1].random),
        groups=(SampleDistribution(("x2", "x3"), rows[::-1], np.ones(50)),),
    )
    assert "has no density (of x2, x3)" in expected_weights(parts[0], other).reason


def test_copulas_have_their_part_in_weights():
    """P(both above 1) of the new copula and marginals, from runs of the old ones."""
    names = ("x0", "x1")
    before = joint(
        Normal(0, 1), Normal(0, 1), dependence=GaussianCopula(names, ((1, 0.3), (0.3, 1)))
    )
    after = joint(
        Normal(0.2, 1), Normal(0, 1), dependence=GaussianCopula(names, ((1, 0.5), (0.5, 1)))
    )
    values = draws(before, 100_000)
    weights = np.exp(log_weights(values, before, after))
    share, error = weighted_share((values["x0"] > 1) & (values["x1"] > 1), weights)
    fresh = draws(after, 400_000, seed=2)
    exact = ((fresh["x0"] > 1) & (fresh["x1"] > 1)).mean()
    assert float(share) == pytest.approx(exact, abs=4 * float(error) + 0.001)
    assert not expected_weights(before, after).is_exact
    # 2 R⁻¹ - R₀⁻¹ is not positive definite: rare pairs would have the largest weights.
    strong = joint(
        Normal(0, 1), Normal(0, 1), dependence=GaussianCopula(names, ((1, 0.9), (0.9, 1)))
    )
    assert "copula" in expected_weights(strong, before).reason
    clayton = joint(Normal(0, 1), Normal(0, 1), dependence=ClaytonCopula(names, 0.8))
    assert np.exp(log_weights(values, before, clayton)).mean() == pytest.approx(1.0, abs=0.05)


def probability_is_known(weights, events):
    """The rule that lets an interval of a probability stand."""
    return has_enough_on_both_sides(weights, events) & (effective_share(weights) >= LEAST_SHARE)


def test_rule_for_probabilities():
    """The setting of the design: 10 000 runs of N(0, 1) asked under N(2, 1) have no answer."""
    of_draws = joint(Normal(0, 1))
    x = draws(of_draws, 10_000)
    far = np.exp(log_weights(x, of_draws, joint(Normal(2, 1))))
    assert float(effective_share(far)) < 0.3 < 100 / 30 < float(effective_sizes(far)) / 30
    assert not probability_is_known(far, x["x0"] > 2)  # an event of half the probability
    near = np.exp(log_weights(x, of_draws, joint(Normal(0.5, 1))))
    thresholds = np.array([0.5, 2.0, 3.4, -2.9])
    known = probability_is_known(near, x["x0"] > thresholds[:, np.newaxis])
    assert known.tolist() == [True, True, False, False]


def test_intervals_cover_where_the_rule_lets_them():
    """P(x > 1.645 + shift) of a shifted normal: accepted ones cover at their level."""
    rng = np.random.default_rng(3)
    of_draws, covered, accepted = joint(Normal(0, 1)), 0, 0
    for _ in range(200):
        shift, scale = rng.uniform(0, 0.8), rng.uniform(0.8, 1.15)
        x = {"x0": rng.standard_normal(1500)}
        weights = np.exp(log_weights(x, of_draws, joint(Normal(shift, scale))))
        event = x["x0"] > shift + 1.2815515655 * scale
        if not probability_is_known(weights, event):
            continue
        lower, upper = weighted_probability_interval(*weighted_share(event, weights), weights, 0.95)
        accepted += 1
        covered += bool(lower <= 0.1 <= upper)
    assert accepted > 125
    assert covered / accepted > 0.92


def test_reweighted_runs_agree_with_fresh_ones():
    """A sample of `benchmarks/reweighting_coverage.py`: intervals of differences contain 0."""
    agreed = found = covered = 0
    for name in ("normal, moved by 0.7", "two normals, narrower", "correlation 0.3 to 0.5"):
        setting = SETTINGS[name]
        fresh = np.sort(setting.function(*draws(setting.asked, 100_000, 5).values()))
        thresholds = np.quantile(fresh, [0.9, 0.95])
        truth = np.array([0.1, 0.05, fresh.mean(), thresholds[0]])
        for seed in range(12):
            rng = np.random.default_rng(seed)
            one, other = (
                estimates(setting, thresholds, rng, is_reweighted=each) for each in (True, False)
            )
            known = np.isfinite(one[:, 1])
            found += known.sum()
            agreed += (compared(one, other) & known).sum()
            covered += ((one[:, 1] <= truth) & (truth <= one[:, 2]) & known).sum()
    assert found > 100
    assert agreed >= 0.93 * found
    assert covered >= 0.92 * found
