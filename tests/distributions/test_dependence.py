"""Copulas: uniform margins, the stated dependence, and exact conditional laws."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special, stats
from scipy.stats import qmc

from uqpen.core.errors import SettingsError
from uqpen.core.labels import DEPENDENCE
from uqpen.core.model import Input
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.distributions import COPULAS
from uqpen.distributions.copula_fit import fit_copula, kendall_matrix, pseudo_observations
from uqpen.distributions.copulas import (
    ClaytonCopula,
    FrankCopula,
    GaussianCopula,
    GumbelCopula,
    JoeCopula,
    StudentCopula,
    score_correlation,
)
from uqpen.distributions.joint_distribution import FixedInput, JointDistribution, RandomInput
from uqpen.distributions.univariate import Lognormal, Normal, Uniform
from uqpen.execution import Evaluator, evaluate, join_rounds
from uqpen.models.known_functions import Ishigami

TWO, THREE = ("a", "b"), ("a", "b", "c")
MATRIX = ((1.0, 0.6, -0.2), (0.6, 1.0, 0.3), (-0.2, 0.3, 1.0))

CASES = {
    "gaussian": GaussianCopula(TWO, ((1.0, 0.6), (0.6, 1.0))),
    "gaussian of three": GaussianCopula(THREE, MATRIX),
    "student": StudentCopula(TWO, ((1.0, 0.6), (0.6, 1.0)), 2.0),
    "student of three": StudentCopula(THREE, MATRIX, 4.0),
    "clayton": ClaytonCopula(TWO, 2.0),
    "clayton of three": ClaytonCopula(THREE, 2.0),
    "clayton, strong": ClaytonCopula(TWO, 12.0),
    "gumbel": GumbelCopula(TWO, 2.0),
    "gumbel, weak": GumbelCopula(TWO, 1.0001),
    "gumbel, strong": GumbelCopula(TWO, 12.0),
    "frank": FrankCopula(TWO, 5.0),
    "frank, negative": FrankCopula(TWO, -5.0),
    "frank, weak": FrankCopula(TWO, 1e-6),
    "frank, strong": FrankCopula(TWO, 60.0),
    "joe": JoeCopula(TWO, 3.0),
    "joe, weak": JoeCopula(TWO, 1.0001),
    "joe, strong": JoeCopula(TWO, 12.0),
}

# Debye's function of the first order at 5, its integrand expanded in powers of exp(-5).
DEBYE = (math.pi**2 / 6 - sum(math.exp(-5 * k) * (5 / k + 1 / k**2) for k in range(1, 20))) / 5

PAIRS = ((0, 1), (0, 2), (1, 2))
ELLIPTICAL = {(i, j): 2 / math.pi * math.asin(MATRIX[i][j]) for i, j in PAIRS}

# Kendall's rank correlation of each pair, from textbooks and, of Joe's, the series of its integral.
KENDALL = {
    "gaussian of three": ELLIPTICAL,
    "student of three": ELLIPTICAL,
    "clayton of three": dict.fromkeys(PAIRS, 2.0 / 4.0),
    "clayton, strong": {(0, 1): 12 / 14},
    "gumbel": {(0, 1): 1 - 1 / 2.0},
    "gumbel, strong": {(0, 1): 1 - 1 / 12.0},
    "frank": {(0, 1): 1 - 4 / 5 * (1 - DEBYE)},
    "frank, negative": {(0, 1): -(1 - 4 / 5 * (1 - DEBYE))},
    "joe": {(0, 1): 1 - 4 * sum(1 / (k * (3 * k + 2) * (3 * (k - 1) + 2)) for k in range(1, 2000))},
}

GRID = np.concatenate(
    [[2.0**-54, 1e-9, 1e-4], np.linspace(0.02, 0.98, 25), [1 - 1e-4, 1 - 1e-9, 1 - 2.0**-53]]
)


def spread(dependence, exponent=12):
    """Points of the copula that are spread evenly, so that averages hardly scatter."""
    engine = qmc.Sobol(len(dependence.inputs), seed=1)
    return dependence.inverse_rosenblatt(engine.random_base2(exponent))


def test_every_copula_that_a_study_can_name_is_tested():
    assert {name.partition(" ")[0].strip(",") for name in CASES} == set(COPULAS)


@pytest.mark.parametrize("name", CASES)
def test_each_margin_stays_uniform(name):
    # Of 4096 scrambled Sobol' points the distance is below 0.007 in three dimensions. Where the
    # conditional law is wrong it is large: 0.02 for a t copula that forgets to widen, 0.17 and 0.25
    # for what chaospy 4.3.21 calls Gumbel's and Joe's.
    for column in spread(CASES[name]).T:
        assert stats.kstest(column, "uniform").statistic < 0.008


@pytest.mark.parametrize("name", KENDALL)
def test_kendalls_rank_correlation_is_the_exact_one(name):
    points = spread(CASES[name])
    for (one, other), exact in KENDALL[name].items():
        # Of independent draws, the standard error would be 0.01; of these it is below a fifth.
        found = stats.kendalltau(points[:, one], points[:, other]).statistic
        assert found == pytest.approx(exact, abs=0.004)


@pytest.mark.parametrize("name", ["clayton, strong", "gumbel", "frank", "frank, negative", "joe"])
def test_a_copula_tells_its_own_rank_correlation(name):
    (exact,) = KENDALL[name].values()
    assert CASES[name].kendall == pytest.approx(exact, abs=1e-6)  # type: ignore[attr-defined]
    assert f"Kendall's rank correlation {exact:.4g}" in str(CASES[name])


@pytest.mark.parametrize(("theta", "exact"), [(2.0, 2 - math.pi**2 / 6), (2.0 + 1e-5, None)])
def test_joes_rank_correlation_has_no_hole_at_two(theta, exact):
    exact = exact or JoeCopula(TWO, 2.0).kendall
    assert JoeCopula(TWO, theta).kendall == pytest.approx(exact, abs=1e-5)


@pytest.mark.parametrize("correlation", [-0.8, -0.3, 0.1, 0.6, 0.95])
def test_rank_correlations_become_those_of_the_scores(correlation):
    ranks = GaussianCopula(TWO, _pair(score_correlation(correlation, "ranks")))
    kendall = GaussianCopula(TWO, _pair(score_correlation(correlation, "kendall")))
    points = spread(ranks, 13)
    assert stats.spearmanr(*points.T).statistic == pytest.approx(correlation, abs=0.002)
    assert stats.kendalltau(*spread(kendall, 12).T).statistic == pytest.approx(
        correlation, abs=0.004
    )
    assert score_correlation(correlation, "normal-scores") == correlation


def _pair(correlation):
    return ((1.0, correlation), (correlation, 1.0))


def _clayton(u, v, t):
    return u ** (-t - 1) * (u**-t + v**-t - 1) ** (-1 / t - 1)


def _gumbel(u, v, t):
    x, y = -np.log(u), -np.log(v)
    both = (x**t + y**t) ** (1 / t)
    return np.exp(-both) * (both / x) ** (1 - t) / u


def _frank(u, v, t):
    a, b = np.expm1(-t * u), np.expm1(-t * v)
    return np.exp(-t * u) * b / (np.expm1(-t) + a * b)


def _joe(u, v, t):
    a, b = (1 - u) ** t, (1 - v) ** t
    return (a + b - a * b) ** (1 / t - 1) * (1 - u) ** (t - 1) * (1 - b)


@pytest.mark.parametrize(
    ("copula", "distribution"),
    [(ClaytonCopula, _clayton), (GumbelCopula, _gumbel), (FrankCopula, _frank), (JoeCopula, _joe)],
)
@pytest.mark.parametrize("theta", [1.1, 2.0, 5.0, 15.0])
def test_a_draw_is_the_quantile_of_the_textbooks_conditional_law(copula, distribution, theta):
    u, p = (axis.ravel() for axis in np.meshgrid(np.linspace(0.02, 0.98, 25), GRID[2:-2]))
    v = copula(TWO, theta).inverse_rosenblatt(np.column_stack([u, p]))[:, 1]
    # A rounding of v is one of p times the density; the density's is below 1e3 here, but where v
    # is so near to 1 that 1 - v has few digits left.
    inside = v < 1 - 1e-6
    assert inside.mean() > 0.9
    np.testing.assert_allclose(distribution(u, v, theta)[inside], p[inside], atol=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_the_corners_of_the_cube_stay_inside_it_and_in_order(name):
    dependence = CASES[name]
    axes = [GRID] * len(dependence.inputs)
    unit = np.array(list(itertools.product(*axes)))
    points = dependence.inverse_rosenblatt(unit)
    assert np.isfinite(points).all()
    assert ((points > 0) & (points < 1)).all()
    assert points[:, 0] == pytest.approx(np.clip(unit[:, 0], 2.0**-54, 1), abs=0)
    last = points[:, -1].reshape(-1, len(GRID))
    # Rounding may put two draws out of order that lie within a few units in the last place.
    assert (np.diff(last, axis=1) >= -1e-12).all()


@pytest.mark.processor
@pytest.mark.parametrize("name", CASES)
def test_a_point_does_not_depend_on_its_batch(name):
    dependence = CASES[name]
    unit = np.random.default_rng(3).random((257, len(dependence.inputs)))
    whole = dependence.inverse_rosenblatt(unit)
    for size in (1, 7, 64):
        ends = range(size, 257, size)
        parts = [dependence.inverse_rosenblatt(part) for part in np.split(unit, ends)]
        np.testing.assert_array_equal(np.concatenate(parts), whole)
    np.testing.assert_array_equal(dependence.inverse_rosenblatt(np.asfortranarray(unit)), whole)


@given(correlation=st.floats(-0.99, 0.99), z=st.floats(-4, 4), w=st.floats(-4, 4))
def test_two_normal_scores_follow_the_conditional_normal_law(correlation, z, w):
    gaussian = GaussianCopula(TWO, _pair(correlation))
    for known, free in ((0, 1), (1, 0)):
        unit = np.full((1, 2), 0.123)
        unit[0, free] = special.ndtr(w)
        found = gaussian.inverse_rosenblatt(unit, {known: special.ndtr(np.array([z]))})
        score = correlation * z + math.sqrt(1 - correlation**2) * w
        assert found[0, free] == pytest.approx(special.ndtr(score), rel=1e-9, abs=1e-15)


def test_many_normal_scores_given_others_have_the_textbooks_mean_and_covariance():
    rng = np.random.default_rng(5)
    factor = rng.normal(size=(5, 9))
    covariance = factor @ factor.T
    scale = np.sqrt(np.diag(covariance))
    matrix = covariance / np.outer(scale, scale)
    np.fill_diagonal(matrix, 1.0)
    gaussian = GaussianCopula(tuple("abcde"), tuple(map(tuple, (matrix + matrix.T) / 2)))
    known, free = [1, 3], [0, 2, 4]
    z = np.array([0.7, -1.2])
    # The map of scores is affine: its value at 0 and at the unit vectors is all of it.
    unit = special.ndtr(np.vstack([np.zeros(5), np.eye(5)[free]]))
    given_values = {
        key: np.full(4, special.ndtr(value)) for key, value in zip(known, z, strict=True)
    }
    scores = special.ndtri(gaussian.inverse_rosenblatt(unit, given_values))
    weights = matrix[np.ix_(free, known)] @ np.linalg.inv(matrix[np.ix_(known, known)])
    np.testing.assert_allclose(scores[0, free], weights @ z, atol=1e-9)
    root = (scores[1:, free] - scores[0, free]).T
    expected = matrix[np.ix_(free, free)] - weights @ matrix[np.ix_(known, free)]
    np.testing.assert_allclose(root @ root.T, expected, atol=1e-8)


def test_t_scores_given_another_follow_a_wider_t_law():
    student = StudentCopula(TWO, _pair(0.6), 3.0)
    p, x = np.array([0.01, 0.3, 0.9]), -1.7
    unit = np.column_stack([p, np.full(3, 0.5)])
    found = student.inverse_rosenblatt(unit, {1: np.full(3, stats.t(3).cdf(x))})[:, 0]
    scale = math.sqrt((3 + x * x) / 4 * (1 - 0.36))
    np.testing.assert_allclose(stats.t(3).ppf(found), stats.t(4, 0.6 * x, scale).ppf(p), rtol=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_draws_given_draws_of_the_copula_are_draws_of_the_copula(name):
    dependence = CASES[name]
    size = len(dependence.inputs)
    points = qmc.Sobol(2 * size, seed=2).random_base2(11)
    joint = dependence.inverse_rosenblatt(points[:, :size])
    last = size - 1
    again = dependence.inverse_rosenblatt(points[:, size:], {last: joint[:, last]})
    np.testing.assert_array_equal(again[:, last], joint[:, last])
    for column in again.T:
        assert stats.kstest(column, "uniform").statistic < 0.015
    found, expected = (
        stats.kendalltau(each[:, 0], each[:, last]).statistic for each in (again, joint)
    )
    assert found == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize(
    ("make", "key", "reported"),
    [
        (lambda: GaussianCopula(("a",), ((1.0,),)), "inputs", "at least two"),
        (lambda: GaussianCopula(("a", "a"), _pair(0.5)), "inputs[1]", "each input once"),
        (lambda: GaussianCopula(THREE, _pair(0.5)), "matrix", "3 rows of 3"),
        (lambda: GaussianCopula(TWO, _pair(1.0)), "matrix[0][1]", "between -1 and 1"),
        (lambda: GaussianCopula(TWO, _pair(math.nan)), "matrix[0][1]", "between -1 and 1"),
        (lambda: GaussianCopula(TWO, ((1.0, 0.5), (0.4, 1.0))), "matrix[1][0]", "symmetric"),
        (
            lambda: GaussianCopula(TWO, ((1.0, 0.5), (0.5, 2.0))),
            "matrix[1][1]",
            "1 on the diagonal",
        ),
        (lambda: StudentCopula(TWO, _pair(0.5), 0.5), "degrees", "above 1"),
        (lambda: ClaytonCopula(TWO, 0.0), "theta", "above 0"),
        (lambda: GumbelCopula(TWO, 1.0), "theta", "above 1"),
        (lambda: GumbelCopula(THREE, 2.0), "inputs", "two inputs"),
        (lambda: JoeCopula(TWO, 17.0), "theta", "below 16"),
        (lambda: FrankCopula(TWO, 0.0), "theta", "which is independence"),
        (lambda: FrankCopula(THREE, 1.0), "inputs", "two inputs"),
    ],
)
def test_parameters_that_make_no_copula_are_refused(make, key, reported):
    with pytest.raises(SettingsError) as caught:
        make()
    problem = caught.value.problems[0]
    assert problem.key == key
    assert reported in problem.expected


def test_correlations_that_cannot_hold_together_tell_the_smallest_eigenvalue():
    matrix = ((1.0, 0.9, 0.9), (0.9, 1.0, -0.9), (0.9, -0.9, 1.0))
    with pytest.raises(SettingsError) as caught:
        GaussianCopula(THREE, matrix)
    (problem,) = caught.value.problems
    assert "smallest eigenvalue -0.8" in problem.found
    assert "positive definite" in problem.expected


@given(st.lists(st.floats(-0.99, 0.99), min_size=3, max_size=3))
def test_any_matrix_is_refused_or_drawn_from(entries):
    one, two, three = entries
    try:
        gaussian = GaussianCopula(THREE, ((1.0, one, two), (one, 1.0, three), (two, three, 1.0)))
    except SettingsError:
        return
    points = gaussian.inverse_rosenblatt(np.random.default_rng(1).random((9, 3)))
    assert ((points > 0) & (points < 1)).all()


X, Y, Z, W = (Input(name, "1") for name in ("x1", "x2", "x3", "w"))
LAW = JointDistribution(
    (
        RandomInput(X, Uniform(-3.0, 3.0), "1"),
        RandomInput(Y, Lognormal(1.0, 0.5), "1", fit={"fit_family": "lognormal"}),
        RandomInput(Z, Normal(0.0, 1.0), "1"),
        FixedInput(W, 2.0, "1"),
    ),
    (X, Y, Z, W),
    GaussianCopula(("x1", "x3"), _pair(score_correlation(0.7, "ranks"))),
)


class TestLaw:
    def test_inputs_are_independent_unless_it_says_otherwise(self):
        assert JointDistribution(LAW.inputs, LAW.variables).is_independent
        assert not LAW.is_independent

    def test_only_the_inputs_that_are_joined_depend_on_each_other(self):
        points = LAW.points(qmc.Sobol(3, seed=1).random_base2(12), {})
        values = np.column_stack([points[name].values for name in ("x1", "x2", "x3")])
        ranks = stats.spearmanr(values).statistic
        assert ranks[0, 2] == pytest.approx(0.7, abs=0.003)
        assert ranks[0, 1] == pytest.approx(0.0, abs=0.01)
        assert ranks[1, 2] == pytest.approx(0.0, abs=0.01)
        for entry, column in zip(LAW.random, values.T, strict=True):
            share = stats.kstest(entry.distribution.cdf(column), "uniform").statistic
            assert share < 0.005

    def test_points_say_that_their_inputs_depend_through_evaluation_and_joining(self):
        unit = np.random.default_rng(1).random((8, 3))
        points = LAW.points(unit, {})
        before = points.copy(deep=True)
        runs = [evaluate(Evaluator(Ishigami()), points, {}) for _ in range(2)]
        joined = join_rounds(runs)
        for dataset in (points, *runs, joined):
            assert dataset.attrs[DEPENDENCE].startswith("gaussian copula of x1, x3: ")
            assert dataset["x2"].attrs["fit_family"] == "lognormal"
        assert joined["x2"].attrs["units"] == "1"
        assert points.identical(before)
        independent = JointDistribution(LAW.inputs, LAW.variables).points(unit, {})
        assert DEPENDENCE not in independent.attrs

    def test_given_columns_stand_and_independent_ones_too(self):
        unit = np.random.default_rng(1).random((5, 3))
        held = np.full(5, 0.9)
        found = LAW.conditional_probabilities(unit, {2: held})
        np.testing.assert_array_equal(found[:, 2], held)
        np.testing.assert_array_equal(found[:, 1], unit[:, 1])
        correlation = score_correlation(0.7, "ranks")
        score = correlation * special.ndtri(0.9) + math.sqrt(1 - correlation**2) * special.ndtri(
            unit[:, 0]
        )
        np.testing.assert_allclose(found[:, 0], special.ndtr(score), rtol=1e-12)
        free = JointDistribution(LAW.inputs, LAW.variables).conditional_probabilities(
            unit, {2: held}
        )
        np.testing.assert_array_equal(free[:, :2], unit[:, :2])
        np.testing.assert_array_equal(free[:, 2], held)

    def test_a_latin_hypercube_stays_one_before_it_is_joined(self):
        design = LatinHypercube(runs=64, replicates=4)
        points = points_in_memory(next(design.rounds(LAW, Stream(1, "designs", "lhs"))))
        # The first input of a copula and those outside keep a draw in each stratum; of the others
        # so does the draw that they are made from.
        for name in ("x1", "x2"):
            entry = next(entry for entry in LAW.random if entry.variable.name == name)
            strata = np.floor(entry.distribution.cdf(points[name].values) * 16).reshape(4, 16)
            assert (np.sort(strata, axis=1) == np.arange(16)).all()
        scores = special.ndtri(LAW.random[2].distribution.cdf(points["x3"].values))
        first = special.ndtri(LAW.random[0].distribution.cdf(points["x1"].values))
        correlation = score_correlation(0.7, "ranks")
        made_from = special.ndtr((scores - correlation * first) / math.sqrt(1 - correlation**2))
        strata = np.floor(made_from * 16).reshape(4, 16)
        assert (np.sort(strata, axis=1) == np.arange(16)).all()


class TestDensity:
    @pytest.mark.parametrize("copula", CASES.values(), ids=CASES)
    def test_it_is_the_derivative_of_the_conditional_law(self, copula):
        # With all inputs but the last given, the density of the last one's probability p is
        # c(u, v) / c(u), and dp/dv of the conditional quantile v(p) is that.
        size = len(copula.inputs)
        rng = np.random.default_rng(5)
        points = copula.inverse_rosenblatt(rng.uniform(0.1, 0.9, (20, size)))
        given = {position: points[:, position] for position in range(size - 1)}
        p, step = rng.uniform(0.2, 0.8, 20), 1e-4

        def last(probability):
            unit = np.column_stack([points[:, :-1], probability])
            return copula.inverse_rosenblatt(unit, given)

        ends = [last(p + step * k)[:, -1] for k in (-2, -1, 1, 2)]
        slope = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * step)
        density = copula.log_density(last(p))
        if size > 2:
            first = type(copula)(
                copula.inputs[:-1],
                *(
                    (copula.theta,)
                    if isinstance(copula, ClaytonCopula)
                    else (tuple(row[:-1] for row in copula.matrix[:-1]),)
                ),
                **({"degrees": copula.degrees} if isinstance(copula, StudentCopula) else {}),
            )
            density -= first.log_density(last(p)[:, :-1])
        # The error of the derivative is its step to the fourth power, near the corners of strong
        # copulas times a large derivative.
        assert np.exp(density) * slope == pytest.approx(np.ones(20), rel=2e-5)


class TestFit:
    TRUTHS = (
        GaussianCopula(THREE, MATRIX),
        ClaytonCopula(TWO, 3.0),
        GumbelCopula(TWO, 2.5),
        FrankCopula(TWO, -8.0),
        JoeCopula(TWO, 3.0),
    )

    @pytest.mark.parametrize("truth", TRUTHS, ids=lambda each: type(each).__name__)
    def test_the_family_and_its_parameter_are_found(self, truth):
        rng = np.random.default_rng(1)
        size = len(truth.inputs)
        rows = stats.norm.ppf(truth.inverse_rosenblatt(rng.random((1500, size))))
        fit = fit_copula(truth.inputs, rows, rng, samples=0)
        assert type(fit.copula) is type(truth)
        kendall = kendall_matrix(rows)
        # The fit has the rows' own rank correlations, and these are those of the truth but for
        # 2 standard errors of at most 0.017.
        exact = kendall_matrix(truth.inverse_rosenblatt(rng.random((20_000, size))))
        assert kendall == pytest.approx(exact, abs=0.035)
        if size == 2:
            assert fit.copula.kendall == pytest.approx(kendall[0, 1], abs=1e-9)
        else:
            assert np.array(fit.copula.matrix) == pytest.approx(np.sin(np.pi / 2 * kendall))

    def test_degrees_of_freedom_are_found_by_likelihood(self):
        truth, rng = StudentCopula(TWO, ((1.0, 0.5), (0.5, 1.0)), 3.0), np.random.default_rng(2)
        fit = fit_copula(TWO, truth.inverse_rosenblatt(rng.random((2000, 2))), rng, samples=0)
        assert fit.family == "student"
        assert 2.3 < fit.copula.degrees < 4.0  # over 50 seeds: 2.5 to 3.7

    def test_a_right_family_is_rejected_as_the_level_says(self):
        truth, rng = ClaytonCopula(TWO, 1.5), np.random.default_rng(3)
        p_values = np.array(
            [
                fit_copula(
                    TWO, truth.inverse_rosenblatt(rng.random((30, 2))), rng, ["clayton"], samples=9
                ).p_value
                for _ in range(40)
            ]
        )
        # With 9 samples p is k/10, each as likely: of 40, 4 are expected at 1/10, and 20 up to
        # one half; the bounds leave out 1 in 1 000.
        assert np.count_nonzero(p_values <= 0.1) <= 10
        assert 10 <= np.count_nonzero(p_values <= 0.5) <= 30

    def test_a_wrong_family_is_rejected(self):
        truth, rng = ClaytonCopula(TWO, 3.0), np.random.default_rng(4)
        rows = truth.inverse_rosenblatt(rng.random((200, 2)))
        fit = fit_copula(TWO, rows, rng, ["joe"], samples=39)
        assert fit.is_rejected
        assert fit.runner_up is None

    def test_only_ranks_matter_and_ties_share_theirs(self):
        rng = np.random.default_rng(5)
        rows = np.round(rng.multivariate_normal([0, 0], [[1, 0.6], [0.6, 1]], 80), 1)
        plain = fit_copula(TWO, rows, np.random.default_rng(6), samples=9)
        moved = fit_copula(TWO, np.exp(rows), np.random.default_rng(6), samples=9)
        assert plain == moved
        assert plain.has_ties
        assert kendall_matrix(rows)[0, 1] == stats.kendalltau(*rows.T, variant="b").statistic
        assert (
            pytest.approx(np.array([[0.2, 0.5, 0.5, 0.8]]))
            == pseudo_observations(np.array([[1.0], [2.0], [2.0], [3.0]])).T
        )

    @pytest.mark.parametrize(
        ("rows", "families", "found"),
        [
            (np.tile(np.arange(9.0), (2, 1)).T, COPULAS, "9 rows"),
            (np.column_stack([np.arange(12.0), np.ones(12)]), COPULAS, "b that does not vary"),
            (
                np.column_stack([np.arange(12.0), -(np.arange(12.0) ** 2) + 3 * np.arange(12.0)]),
                ["gumbel"],
                "Kendall's rank correlations of a and b -",
            ),
        ],
    )
    def test_rows_that_no_copula_fits_are_refused(self, rows, families, found):
        with pytest.raises(SettingsError, match=found):
            fit_copula(TWO, rows, np.random.default_rng(1), families)
