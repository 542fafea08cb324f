"""Nested rules: as exact as Gauss's of the same order, and each among the next."""

import math
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import chaospy
import numpy as np
import pytest
from designed_runs import law_of, points
from hypothesis import given, settings
from hypothesis import strategies as st
from study_text import study_text

from uqpen.core.errors import SettingsError, StudyError
from uqpen.designs.quadrature import (
    NESTED_RULES,
    Quadrature,
    _search_leja_nodes,
    node_counts,
    univariate_rules,
)
from uqpen.distributions.univariate import (
    Beta,
    Gamma,
    Lognormal,
    Normal,
    Triangular,
    Truncated,
    Uniform,
)
from uqpen.study.load import parse_study

# Sums of some hundred rounded products.
ROUNDING = 1e-12

UNIFORM, NORMAL = Uniform(2.0, 5.0), Normal(3.0, 0.5)
GAMMA, BETA = Gamma(2.0, 0.5), Beta(2.0, 3.5, -1.0, 3.0)
BOUNDED = [
    UNIFORM,
    BETA,
    Beta(2.0, 2.0, -1.0, 3.0),
    Triangular(-1.0, 0.5, 3.0),
    Truncated(Normal(0.0, 1.0), -0.5, 2.0),
]
ACCEPTED = {
    "clenshaw-curtis": BOUNDED,
    "fejer-1": BOUNDED,
    "fejer-2": BOUNDED,
    "leja": [UNIFORM, NORMAL, GAMMA, BETA],
    "gauss-patterson": [UNIFORM],
    **{f"genz-keister-{variant}": [NORMAL] for variant in (16, 18, 22, 24)},
}
PAIRS = [(rule, distribution) for rule, accepted in ACCEPTED.items() for distribution in accepted]


def moment(distribution, degree):
    """Return the exact moment of (x - 3) / 0.5 of the normal, (x - 3.5) / 1.5 of the uniform."""
    if degree % 2:
        return 0.0
    if isinstance(distribution, Uniform):
        return 1 / (degree + 1)
    return float(math.prod(range(1, degree, 2)))


def standardised(distribution, values):
    return (values - 3.5) / 1.5 if isinstance(distribution, Uniform) else (values - 3) / 0.5


def test_every_nested_rule_is_tested():
    assert set(ACCEPTED) == set(NESTED_RULES)


@pytest.mark.parametrize(
    ("rule", "distribution"), [pair for pair in PAIRS if pair[1] in (UNIFORM, NORMAL)], ids=str
)
@pytest.mark.parametrize("order", [0, 1, 3, 8])
def test_moments_are_exact_to_the_degree_of_the_order(rule, distribution, order):
    ((values, weights),) = univariate_rules(rule, distribution, [order])
    assert [len(values)] == node_counts(rule, distribution, [order])
    assert weights.sum() == pytest.approx(1.0, abs=ROUNDING)
    assert (np.diff(values) > 0).all()
    for degree in range(2 * order + 2):
        powers = standardised(distribution, values) ** degree
        # Odd moments are sums that cancel.
        size = max(1.0, float(np.abs(powers) @ np.abs(weights)))
        assert abs(powers @ weights - moment(distribution, degree)) < ROUNDING * size


@pytest.mark.parametrize("order", [1, 4, 15, 27, 31, 33])
@pytest.mark.parametrize("variant", [16, 18, 22, 24])
def test_genz_and_keisters_weights_are_chaospys(variant, order):
    import chaospy

    rule = f"genz-keister-{variant}"
    if order > NESTED_RULES[rule].highest_order:
        with pytest.raises(SettingsError, match=f'with the rule "{rule}"'):
            Quadrature(order, rule=rule)
        return
    ((values, weights),) = univariate_rules(rule, NORMAL, [order])
    theirs = getattr(chaospy.quadrature, f"genz_keister_{variant}")
    place = list(NESTED_RULES[rule].sizes).index(len(values))
    nodes, expected = theirs(place)
    np.testing.assert_allclose(values, 3 + 0.5 * nodes.ravel(), rtol=1e-15)
    np.testing.assert_allclose(weights, expected, rtol=0, atol=1e-10)


@settings(max_examples=25)
@given(st.sampled_from(PAIRS), st.integers(0, 4), st.integers(0, 4))
def test_the_points_of_a_lower_order_are_among_those_of_a_higher(pair, one, other):
    rule, distribution = pair
    lower, higher = sorted([one, other])
    (few, _), (many, _) = univariate_rules(rule, distribution, [lower, higher])
    distances = np.abs(few[:, np.newaxis] - many).min(axis=1)
    assert (distances < ROUNDING * max(np.ptp(many), 1.0)).all()


@pytest.mark.parametrize("grid", ["tensor", "sparse"])
@pytest.mark.parametrize(("rule", "distribution"), PAIRS, ids=str)
def test_polynomials_of_all_inputs_are_exact(rule, distribution, grid):
    joint = law_of(distribution, distribution)
    design = Quadrature(2, grid, rule)
    drawn, gauss = points(design, joint), points(Quadrature(2), joint)
    assert design.run_count(joint) == drawn.sizes["run"]
    assert drawn["quadrature_weight"].values.sum() == pytest.approx(1.0, abs=ROUNDING)
    ours, exact = (
        (each["quadrature_weight"].values * (each["x1"].values - 2) ** degrees[:, None])
        @ ((each["x2"].values - 2) ** degrees[:, None]).T
        for each in (drawn, gauss)
        for degrees in [np.arange(6)]
    )
    low = np.add.outer(np.arange(6), np.arange(6)) <= 5
    np.testing.assert_allclose(ours[low], exact[low], rtol=1e-11, atol=1e-11)


def test_a_range_far_from_zero_costs_no_digits():
    ((_, near),) = univariate_rules("clenshaw-curtis", Uniform(-1.0, 1.0), [4])
    ((_, far),) = univariate_rules("clenshaw-curtis", Uniform(2.0**40 - 1, 2.0**40 + 1), [4])
    np.testing.assert_allclose(far, near, rtol=1e-12)


@pytest.mark.parametrize(
    ("rule", "distribution", "expected"),
    [
        ("clenshaw-curtis", NORMAL, "inputs of bounded range"),
        ("fejer-1", GAMMA, "inputs of bounded range"),
        ("fejer-2", Lognormal(2.0, 0.5), "inputs of bounded range"),
        ("leja", Lognormal(2.0, 0.5), "normal and uniform inputs"),
        ("leja", Beta(0.5, 2.0, 0.0, 1.0), "of bounded density"),
        ("leja", Gamma(1.0, 2.0), "of bounded density"),
        ("gauss-patterson", BETA, "uniform inputs"),
        ("genz-keister-24", UNIFORM, "normal inputs"),
    ],
)
def test_a_rule_that_an_input_does_not_have_is_refused(rule, distribution, expected):
    suited = {"genz-keister-24": NORMAL}.get(rule, UNIFORM)
    for grid in ("tensor", "sparse"):
        (problem,) = Quadrature(2, grid, rule).check_inputs(law_of(suited, distribution))
        assert problem.path == ("rule",)
        assert problem.found == f'"{rule}" for x2'
        assert expected in problem.expected
        assert problem.expected.endswith('or the rule "gauss"')
        with pytest.raises(SettingsError, match=f'"{rule}" for x2'):
            points(Quadrature(2, grid, rule), law_of(suited, distribution))


@pytest.mark.parametrize("rule", ["clenshaw-curtis", "fejer-1", "fejer-2"])
def test_an_order_that_rounding_spoils_is_refused(rule):
    narrow = Beta(200.0, 350.0, 0.0, 1.0)
    (problem,) = Quadrature(10, "sparse", rule).check_inputs(law_of(UNIFORM, narrow))
    assert problem.path == ("order",)
    assert problem.found == f'10, which "{rule}" loses to rounding for x2'
    assert 'the rule "gauss"' in problem.expected
    assert list(Quadrature(2, rule=rule).check_inputs(law_of(narrow))) == []
    for distribution in BOUNDED:
        assert list(Quadrature(100, rule=rule).check_inputs(law_of(distribution))) == []


TEXT = study_text(
    "ishigami",
    inputs={"x1": (-1, 1), "x2": (-1, 1), "x3": {"normal": {"mean": 0, "std": 1}}},
    designs={"mine": {"kind": "quadrature"}},
)


@pytest.mark.parametrize(
    ("keys", "complaint"),
    [
        ('order = 2\nrule = "fejer-1"', '"fejer-1" for x3'),
        ('order = 13\nrule = "leja"', 'at most 12 with the rule "leja"'),
        ('order = 2\nrule = "simpson"', 'one of "gauss", "clenshaw-curtis"'),
    ],
)
def test_a_study_is_refused_before_any_run(keys, complaint):
    with pytest.raises(StudyError) as caught:
        parse_study(TEXT + keys)
    assert complaint in str(caught.value)


LEJA = {
    "Normal": (0.0, 1.0),
    "Uniform": (-1.0, 1.0),
    "Gamma": (9.0,),
    "Beta": (2.0, 3.0, -1.0, 1.0),
}


@pytest.mark.filterwarnings("ignore:.newshape. keyword:DeprecationWarning")
@pytest.mark.parametrize("family", LEJA)
def test_leja_nodes_are_those_of_chaospy(family):
    theirs, _ = chaospy.quadrature.leja(6, getattr(chaospy, family)(*LEJA[family]))
    nodes = _search_leja_nodes.__wrapped__(7, family, *LEJA[family])
    np.testing.assert_allclose(nodes, np.ravel(theirs), rtol=1e-12)


def test_leja_nodes_take_any_version_of_numpy(monkeypatch):
    """From 2.4 on, NumPy refuses the keyword by which numpoly reshapes."""

    def refuse(*_, **__):
        raise TypeError("reshape() got an unexpected keyword argument 'newshape'")

    reshaping = sys.modules["numpoly.array_function.reshape"]
    monkeypatch.setattr(reshaping, "numpy", SimpleNamespace(reshape=refuse))
    assert _search_leja_nodes.__wrapped__(3, "Uniform", -1.0, 1.0)[1] == pytest.approx(0, abs=1e-6)


@pytest.mark.slow
def test_gausss_rule_and_a_check_load_no_chaospy():
    code = (
        "import sys, uqpen\n"
        "from uqpen.study.load import parse_study\n"
        f"parse_study({TEXT!r} + 'order = 2\\ngrid = \"sparse\"').runs\n"
        f"parse_study({TEXT!r} + 'order = 2\\nrule = \"leja\"').runs\n"
        "print('chaospy' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path.cwd()
    )
    assert done.stdout.strip() == "False"
