"""Unknowns of distributions: draws of fitted parameters, their predictive distribution, boxes."""

from functools import cache

import numpy as np
import pytest
import scipy

from uqpen.core.errors import SettingsError
from uqpen.core.lookup import resolve
from uqpen.distributions import DISTRIBUTIONS
from uqpen.distributions.measurements import fitted_families
from uqpen.distributions.univariate import (
    Gamma,
    Gumbel,
    Lognormal,
    LogUniform,
    Normal,
    Student,
    Truncated,
    Uniform,
    Weibull,
)
from uqpen.distributions.unknowns import DRAWS, Mixed, ParameterBox, fitted_parameters

TRUTH = {
    "normal": Normal(10.0, 1.0),
    "lognormal": Lognormal(10.0, 2.0),
    "gumbel": Gumbel(10.0, 1.0),
    "weibull": Weibull(10.0, 10.0),
    "uniform": Uniform(9.0, 11.0),
    "log-uniform": LogUniform(9.0, 11.0),
    "gamma": Gamma(10.0, 2.0),
}
AT = np.array([1e-6, 0.001, 0.05, 0.5, 0.95, 0.999])


@cache
def fitted(family, seed=0, specimens=8):
    rng = np.random.default_rng(seed)
    values = TRUTH[family].ppf(rng.random(specimens))
    return fitted_parameters(family, values, rng), values


def test_every_family_that_is_fitted_has_uncertain_parameters():
    known = {resolve(DISTRIBUTIONS[name]) for name in fitted_families()}
    assert known == {type(each) for each in TRUTH.values()}


@pytest.mark.parametrize("family", TRUTH)
def test_the_predictive_distribution_is_the_mixture_of_the_draws(family):
    unknown, _ = fitted(family)
    predictive = unknown.predictive
    assert len(unknown.draws) == DRAWS
    below = np.mean([each.cdf(predictive.ppf(AT)) for each in unknown.draws], axis=0)
    above = np.mean([each.sf(predictive.isf(AT)) for each in unknown.draws], axis=0)
    # Of 1000 draws the normal one is a sample, where the predictive distribution is exact.
    error = 0.15 if family == "normal" else 2e-3
    inner = slice(2, 5) if family == "normal" else slice(None)
    assert below[inner] == pytest.approx(AT[inner], rel=error)
    assert above[inner] == pytest.approx(AT[inner], rel=error)
    # Both tails and the density are those of one function.
    x = predictive.ppf(np.linspace(0.003, 0.997, 41))
    assert predictive.cdf(x) + predictive.sf(x) == pytest.approx(1.0)
    step = 1e-6 * np.abs(x)
    slope = (predictive.cdf(x + step) - predictive.cdf(x - step)) / (2 * step)
    found = np.abs(np.log(slope) - predictive.log_density(x))
    assert np.median(found) < 1e-8  # but for the knots of its table
    assert predictive.is_finite


@pytest.mark.parametrize("family", TRUTH)
def test_the_draws_lie_around_the_fit(family):
    unknown, _ = fitted(family, specimens=30)
    for p in (0.05, 0.5, 0.95):
        draws = np.array([float(each.ppf(np.array(p))) for each in unknown.draws])
        # Ends of a uniform distribution are beyond those of its fit.
        assert 0.01 < np.mean(draws < unknown.fitted.ppf(np.array(p))) < 0.99


def test_the_next_normal_specimen_follows_students_distribution():
    unknown, values = fitted("normal")
    width = values.std(ddof=1) * np.sqrt(9 / 8)
    exact = Student(float(values.mean()), float(width), 7.0)
    assert unknown.predictive.ppf(AT) == pytest.approx(exact.ppf(AT))
    # Draws of the mean and of the spread are Student's and chi-squared, by themselves.
    means = np.array([each.mean for each in unknown.draws])
    spreads = np.array([each.std for each in unknown.draws])
    t = (means - values.mean()) / (values.std(ddof=1) / np.sqrt(8))
    assert scipy.stats.kstest(t, scipy.stats.t(7).cdf).pvalue > 0.01
    ratio = 7 * values.var(ddof=1) / spreads**2
    assert scipy.stats.kstest(ratio, scipy.stats.chi2(7).cdf).pvalue > 0.01


def test_the_next_uniform_specimen_lies_beyond_the_extremes_as_often_as_theory_says():
    unknown, values = fitted("uniform")
    # Each of nine is as likely the largest; beyond it, the spacings are exponential.
    span = np.ptp(values)
    for distance in (0.0, 0.1, 0.5):
        found = float(unknown.predictive.sf(values.max() + distance * span))
        exact = (1 + distance) ** -7 / 9
        assert found == pytest.approx(exact, abs=4 * np.sqrt(exact / DRAWS))


def test_a_gamma_posterior_is_that_of_its_density_by_quadrature():
    unknown, values = fitted("gamma")
    shapes = np.array([(each.mean / each.std) ** 2 for each in unknown.draws])
    k = np.exp(np.linspace(np.log(0.05), np.log(4000), 4001))
    excess = np.log(values.mean()) - np.log(values).mean()
    log = scipy.special.gammaln(8 * k) - 8 * scipy.special.gammaln(k)
    log -= 8 * k * (np.log(8) + excess)
    prior = np.sqrt(k * scipy.special.polygamma(1, k) - 1) / np.sqrt(k)
    density = prior * np.exp(log - log.max())
    below = scipy.integrate.cumulative_trapezoid(density, k, initial=0)
    assert scipy.stats.kstest(shapes, lambda x: np.interp(x, k, below / below[-1])).pvalue > 0.01


def test_intervals_over_the_draws_hold_a_probability_as_often_as_they_say():
    # A sample of benchmarks/unknowns_coverage.py: 20 data sets, three standard errors below 95 %.
    truth, held, below = TRUTH["normal"], np.zeros(2), []
    at = truth.ppf(np.array([0.05, 0.001]))
    for seed in range(20):
        unknown, _ = fitted("normal", seed)
        drawn = np.array([(each.mean, each.std) for each in unknown.draws])
        found = scipy.special.ndtr((at - drawn[:, :1]) / drawn[:, 1:])
        low, high = np.quantile(found, [0.025, 0.975], axis=0)
        held += (low <= [0.05, 0.001]) & (high >= [0.05, 0.001])
        below.append(truth.cdf(unknown.predictive.ppf(np.array(0.05))))
    assert (held >= 16).all()
    assert np.mean(below) == pytest.approx(0.05, abs=0.035)


def test_truncated_draws_are_mixed():
    unknown, _ = fitted("normal")
    cut = unknown.truncated(8.0, 11.0)
    assert cut.fitted == Truncated(unknown.fitted, 8.0, 11.0)
    assert cut.drawn().ppf(np.array([0.0, 1.0])) == pytest.approx([8.0, 11.0], abs=1e-6)
    mixture = np.mean([each.cdf(np.array([9.0, 10.0])) for each in cut.draws], axis=0)
    assert cut.predictive.cdf(np.array([9.0, 10.0])) == pytest.approx(mixture, abs=1e-4)


def test_specimens_without_uncertainty_in_double_precision_are_refused():
    values = np.array([1e-300, 1.0, 1e300, 1e-200, 1e200])
    with pytest.raises(SettingsError):
        fitted_parameters("lognormal", values, np.random.default_rng(0))


def test_a_box_is_drawn_from_a_mixture_with_the_mass_of_all_its_distributions():
    box = ParameterBox(Normal, {}, {"mean": (0.0, 1.0), "std": (1.0, 1.5)})
    parts = box.drawn().parts
    assert set(parts[:4]) == {Normal(m, s) for m in (0.0, 1.0) for s in (1.0, 1.5)}
    assert parts[4] == Normal(0.5, 1.5)
    looked_at = [*box.looked_at((15, 9))]
    assert len(looked_at) == 15 * 9
    assert set(box.corners()) <= set(looked_at)
    assert all(type(each) is Truncated for each in box.truncated(-1.0, 3.0).looked_at((2, 2)))


def test_a_corner_without_meaning_is_refused():
    with pytest.raises(SettingsError):
        ParameterBox(Uniform, {}, {"lower": (0.0, 2.0), "upper": (1.0, 3.0)})


def test_mixed_distributions_of_positive_values_stay_positive():
    mixed = Mixed.of([Lognormal(1.0, 5.0), Lognormal(2.0, 9.0)])
    assert (mixed.ppf(np.array([2.0**-54, 1e-9])) > 0).all()
    assert mixed.log_density(np.array([0.0]))[0] == -np.inf
