"""Every law against SciPy's, and the properties that any law has."""

import math
from dataclasses import replace

import chaospy
import numpy as np
import pytest
from example_distributions import EXAMPLES
from hypothesis import given
from hypothesis import strategies as st
from library_tables import PAGE, with_table
from scipy import stats

from uqpen.core.errors import SettingsError
from uqpen.core.lookup import resolve
from uqpen.designs.rare_events.subset_simulation import SubsetSimulation
from uqpen.distributions import DISTRIBUTIONS
from uqpen.distributions.frozen import FrozenDistribution, frozen_families
from uqpen.distributions.orthogonal_polynomials import recurrence
from uqpen.distributions.univariate import (
    Arcsine,
    Beta,
    Binomial,
    Exponential,
    Gamma,
    GeneralisedExtremeValue,
    Gumbel,
    Integer,
    Logistic,
    Lognormal,
    LogUniform,
    Mixture,
    Normal,
    Pareto,
    Poisson,
    Rayleigh,
    Student,
    Triangular,
    Truncated,
    Uniform,
    Weibull,
)
from uqpen.testing import check_distribution, example_joint_distribution

pytestmark = pytest.mark.processor

LAWS = {
    "normal": (Normal(2.0, 0.5), stats.norm(2.0, 0.5)),
    "lognormal": (
        Lognormal(2.0, 0.5),
        stats.lognorm(math.sqrt(math.log(1 + 0.25**2)), scale=2.0 / math.sqrt(1 + 0.25**2)),
    ),
    "uniform": (Uniform(-1.0, 3.0), stats.uniform(-1.0, 4.0)),
    "log-uniform": (LogUniform(0.1, 30.0), stats.loguniform(0.1, 30.0)),
    "triangular": (Triangular(-1.0, 0.5, 3.0), stats.triang(0.375, -1.0, 4.0)),
    "beta": (Beta(2.0, 3.5, -1.0, 3.0), stats.beta(2.0, 3.5, -1.0, 4.0)),
    "gamma": (Gamma(2.0, 0.5), stats.gamma(16.0, scale=0.125)),
    "weibull": (Weibull(1.7, 2.0), stats.weibull_min(1.7, scale=2.0)),
    "gumbel": (
        Gumbel(2.0, 0.5),
        stats.gumbel_r(
            2.0 - np.euler_gamma * 0.5 * math.sqrt(6) / math.pi, 0.5 * math.sqrt(6) / math.pi
        ),
    ),
    "exponential": (Exponential(2.0), stats.expon(scale=2.0)),
    "rayleigh": (Rayleigh(2.0), stats.rayleigh(scale=2.0)),
    "arcsine": (Arcsine(-1.0, 3.0), stats.arcsine(-1.0, 4.0)),
    "pareto": (Pareto(2.5, 2.0), stats.pareto(2.5, scale=2.0)),
    "generalised-extreme-value": (
        GeneralisedExtremeValue(2.0, 0.5, 0.2),
        stats.genextreme(-0.2, 2.0, 0.5),
    ),
    "extreme values of a bounded law": (
        GeneralisedExtremeValue(2.0, 0.5, -0.3),
        stats.genextreme(0.3, 2.0, 0.5),
    ),
    "student": (Student(2.0, 0.5, 3.5), stats.t(3.5, 2.0, 0.5)),
    "logistic": (Logistic(2.0, 0.5), stats.logistic(2.0, 0.5 * math.sqrt(3) / math.pi)),
    "truncated normal": (
        Truncated(Normal(2.0, 0.5), 1.2, 2.9),
        stats.truncnorm((1.2 - 2.0) / 0.5, (2.9 - 2.0) / 0.5, 2.0, 0.5),
    ),
}

# Both compute the same special functions by other routes; a few dozen roundings lie between.
ROUNDING = 1e-12

PROBABILITIES = np.array([1e-9, 0.001, 0.1, 0.5, 0.77, 0.999, 1 - 1e-9])


MIXED = Mixture((Normal(0.0, 1.0), Normal(4.0, 0.5)), (0.7, 0.3))
WHOLE = {
    "integer": (Integer(-3, 5), stats.randint(-3, 6)),
    "poisson": (Poisson(3.0), stats.poisson(3.0)),
    "many": (Poisson(1e5), stats.poisson(1e5)),
    "few": (Poisson(1e-3), stats.poisson(1e-3)),
    "binomial": (Binomial(10, 0.3), stats.binom(10, 0.3)),
}
CONTRACTS = {
    **EXAMPLES,
    **{f"{name} of SciPy's parameters": law for name, (law, _) in (LAWS | WHOLE).items()},
    "mixture": MIXED,
    "mixture of scales": Mixture((Lognormal(2.0, 1.0), Weibull(0.5, 2e6))),
    "mixture with a gap": Mixture((Uniform(-2.0, -1.0), Uniform(1.0, 3.0)), (3, 1)),
    "truncated mixture": Truncated(MIXED, 1.0, 5.0),
    "rare": Binomial(1_000_000_000, 2e-9),
    "far truncated": Truncated(Normal(0.0, 1.0), 9.0),
    "heavy": Student(0.0, 1.0, 0.8),
}


@pytest.mark.parametrize("name", CONTRACTS)
def test_every_law_keeps_the_contract_and_its_density_is_a_derivative(name):
    law = CONTRACTS[name]
    check_distribution(law)
    assert law.log_density(law.ppf(PROBABILITIES)) is not None
    if not law.is_discrete:  # and none where it has no probability
        outside = np.array([-1e9, 1e9])
        outside = outside[(law.cdf(outside) == 0) | (law.sf(outside) == 0)]
        assert (np.exp(law.log_density(outside)) <= 1e-300).all()


@pytest.mark.parametrize(("name", "family"), DISTRIBUTIONS.items())
def test_every_continuous_family_can_be_truncated_with_its_density(name, family):
    law = EXAMPLES[name]
    if not resolve(family).is_discrete:
        check_distribution(Truncated(law, float(law.ppf(np.array(0.9))), math.inf))


@pytest.mark.parametrize("name", WHOLE)
def test_whole_numbers_are_scipys_in_both_tails(name):
    law, scipys = WHOLE[name]
    k, shares = law.atoms()
    some = (shares > 1e-280) & (np.arange(len(k)) % (1 + len(k) // 2000) == 0)
    for ours, theirs in ((law.cdf(k), scipys.cdf(k)), (law.sf(k), scipys.sf(k))):
        np.testing.assert_allclose(ours[some], theirs[some], rtol=1e-10, atol=1e-300)
    p = np.array([1e-200, 1e-20, 1e-9, 0.2, 0.5, 0.9])
    # SciPy's quantile of a far upper tail is one off.
    assert (law.sf(law.isf(p)) <= p).all()
    assert ((law.sf(law.isf(p) - 1) > p) | (law.isf(p) <= k[0])).all()
    assert law.ppf(p[3:]).tolist() == scipys.ppf(p[3:]).tolist()


def test_counts_and_mixtures_have_their_exact_probabilities():
    assert float(Poisson(3.0).sf(np.array(5.0))) == pytest.approx(0.0839179420, abs=5e-11)
    assert float(Binomial(10, 0.3).sf(np.array(5.0))) == pytest.approx(0.0473489874, abs=5e-11)
    assert float(MIXED.sf(np.array(4.0))) == pytest.approx(0.1500221699, abs=5e-11)
    # Poisson's limit, nearer than 1 / trials. SciPy is wrong by 2e-8.
    rare, k = Binomial(1_000_000_000, 2e-9), np.arange(12.0)
    np.testing.assert_allclose(rare.cdf(k), Poisson(2.0).cdf(k), rtol=1e-8)
    assert recurrence(MIXED, 1).std ** 2 == pytest.approx(4.135, rel=1e-12)


def test_moments_that_are_infinite_have_no_polynomials():
    assert not recurrence(Student(0.0, 1.0, 2.5), 1).is_finite  # the third is infinite
    assert np.isnan(recurrence(Student(0.0, 1.0, 1.5), 1).beta[1])
    assert np.isfinite(recurrence(Student(0.0, 1.0, 2.5), 1).beta[1])
    assert recurrence(Truncated(Student(0.0, 1.0, 1.5), -9.0, 9.0), 5).is_finite
    assert np.isnan(recurrence(Mixture((Normal(0.0, 1.0), Pareto(2.0, 1.0))), 1).beta[1])


@pytest.mark.parametrize("name", ["pareto", "student", "logistic", "exponential", "mixture"])
def test_tails_keep_their_digits_as_far_as_doubles_go(name):
    law = CONTRACTS[name]
    p = 10.0 ** -np.array([300, 250, 120, 60, 29, 31, 16, 8])
    np.testing.assert_allclose(law.sf(law.isf(p)), p, rtol=1e-12)


def test_every_family_that_a_study_can_name_is_tested():
    assert set(DISTRIBUTIONS) <= {*LAWS, *WHOLE, "rectangular", "bernoulli", "discrete", "choice"}


@pytest.mark.parametrize("name", LAWS)
def test_quantiles_are_scipys(name):
    distribution, scipys = LAWS[name]
    for quantiles in ("ppf", "isf"):
        found, known = (getattr(each, quantiles)(PROBABILITIES) for each in (distribution, scipys))
        np.testing.assert_allclose(found, known, rtol=1e-9, atol=ROUNDING)


def test_a_law_truncated_far_out_keeps_its_accuracy():
    distribution, parent = Truncated(Normal(0.0, 1.0), 9.0, math.inf), stats.norm()
    p = np.array([1e-12, 1e-3, 0.5, 0.999])
    np.testing.assert_allclose(distribution.isf(p), parent.isf(p * parent.sf(9.0)), rtol=ROUNDING)
    np.testing.assert_allclose(distribution.sf(distribution.isf(p)), p, rtol=1e-9)


@pytest.mark.parametrize("name", LAWS)
def test_probabilities_are_scipys_in_both_tails(name):
    distribution, scipys = LAWS[name]
    low, high = scipys.ppf(0.001), scipys.ppf(0.999)
    values = np.linspace(low, high, 23)
    for share in ("cdf", "sf"):
        found, known = (getattr(each, share)(values) for each in (distribution, scipys))
        np.testing.assert_allclose(found, known, rtol=1e-9, atol=ROUNDING)


@pytest.mark.parametrize("name", LAWS)
def test_no_draw_leaves_the_support_and_the_median_is_scipys(name):
    distribution, scipys = LAWS[name]
    extremes = distribution.ppf(np.array([2**-54, 1 - 2**-53]))
    low, high = scipys.support()
    assert low <= extremes[0] <= extremes[1] <= high
    assert distribution.median == pytest.approx(scipys.median(), rel=1e-12)


@given(
    lower=st.floats(-30, 30), width=st.floats(0.01, 10), p=st.floats(0, 1), std=st.floats(0.1, 10)
)
def test_a_truncated_law_stays_inside_and_keeps_its_order(lower, width, p, std):
    try:
        distribution = Truncated(Normal(0.0, std), lower, lower + width)
    except SettingsError:
        return  # so far out that nothing of the law is left
    values = distribution.ppf(np.array([0.0, p, 1.0]))
    assert lower <= values[0] <= values[1] <= values[2] <= lower + width


@pytest.mark.parametrize(
    ("make", "key", "expected"),
    [
        (lambda: Normal(1.0, 0.0), "std", "above 0"),
        (lambda: Normal(1.0, -1.0), "std", "above 0"),
        (lambda: Normal(math.nan, 1.0), "mean", "a quantity"),
        (lambda: Lognormal(-1.0, 1.0), "mean", "above 0"),
        (lambda: Uniform(2.0, 1.0), "upper", "above lower"),
        (lambda: LogUniform(0.0, 1.0), "lower", "above 0"),
        (lambda: Triangular(0.0, 2.0, 1.0), "mode", "from lower to upper"),
        (lambda: Beta(0.0, 1.0, 0.0, 1.0), "alpha", "above 0"),
        (lambda: Weibull(-1.0, 1.0), "shape", "above 0"),
        (lambda: Poisson(2e6), "mean", "at most 1e+06"),
        (lambda: Binomial(10**9, 0.5), "", "at most 1_000_000; a normal distribution"),
        (lambda: Integer(3, 2), "upper", "above lower"),
        (lambda: Integer(0, 10**6), "", "or a uniform distribution"),
        (lambda: Mixture((Normal(0.0, 1.0),)), "", "at least two"),
        (lambda: Mixture((Normal(0.0, 1.0), Poisson(3.0))), "", "continuous ones"),
        (lambda: Mixture((MIXED, MIXED), (1, 0)), "weights", "weights above 0"),
        (lambda: Truncated(Normal(0.0, 1.0), 2.0, 1.0), "upper", "above lower"),
        (lambda: Truncated(Normal(0.0, 1.0), 50.0, 51.0), "", "leave some of the distribution"),
    ],
)
def test_parameters_that_make_no_law_are_refused(make, key, expected):
    with pytest.raises(SettingsError) as caught:
        make()
    (problem,) = caught.value.problems
    assert problem.key == key
    assert expected in problem.expected


@pytest.mark.parametrize("mode", [0.0, 1.0])
def test_a_triangle_may_be_upright_on_one_side(mode):
    distribution = Triangular(0.0, mode, 1.0)
    scipys = stats.triang(mode)
    np.testing.assert_allclose(
        distribution.ppf(PROBABILITIES), scipys.ppf(PROBABILITIES), atol=1e-12
    )
    values = np.linspace(-0.5, 1.5, 9)
    np.testing.assert_allclose(distribution.cdf(values), scipys.cdf(values), atol=1e-12)
    np.testing.assert_allclose(distribution.sf(values), scipys.sf(values), atol=1e-12)


class TestUpperTailsOfChaospy:
    """It has an upper tail as 1 - F alone."""

    def test_a_truncation_within_the_tail_is_refused_with_the_reason(self):
        parent = FrozenDistribution(chaospy.Normal(0, 1))
        Truncated(parent, 5.0)  # a probability of 3e-7 above
        with pytest.raises(SettingsError, match="computes an upper tail as 1 - F"):
            Truncated(parent, 6.0)  # 1e-9
        Truncated(parent, -math.inf, -7.0)  # the lower tail has its digits

    def test_scipy_has_both_tails(self):
        far = Truncated(FrozenDistribution(stats.norm(0, 1)), 8.0)
        assert far.median == pytest.approx(8.084911, abs=1e-6)

    def test_a_design_for_a_rare_event_is_refused(self):
        joint = example_joint_distribution()
        first = replace(joint.random[0], distribution=FrozenDistribution(chaospy.Normal(0, 1)))
        joint = replace(joint, inputs=(first, *joint.random[1:]))
        design = SubsetSimulation(event="y > 5", samples=100)
        (problem,) = design.check_inputs(joint)
        assert "upper tail is known down to 1e-08 only" in problem.found
        assert not list(design.check_inputs(example_joint_distribution()))


def test_names_of_chaospy_are_those_of_single_continuous_distributions():
    names = frozen_families("chaospy")
    assert len(names) > 55
    assert {"Alpha", "Kumaraswamy", "PERT", "TukeyLambda"} <= names.keys()
    assert {"MvNormal", "J", "Trunc", "Binomial", "GaussianKDE", "Clayton"}.isdisjoint(names)


def test_the_page_has_each_name_with_its_parameters():
    page = PAGE.read_text(encoding="utf-8")
    assert with_table(page) == page, "python tests/library_tables.py writes it anew"
