"""Distributions of single values."""

import numpy as np
import pytest
from scipy import stats

import uqpen
from uqpen.core.errors import SettingsError
from uqpen.distributions.frozen import FrozenDistribution
from uqpen.distributions.orthogonal_polynomials import recurrence
from uqpen.distributions.univariate import Discrete
from uqpen.testing import check_distribution

DICE = Discrete((1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
COUNTS = FrozenDistribution(stats.poisson(3))


@pytest.mark.parametrize(
    "distribution",
    [
        DICE,
        Discrete([3, -1, 2.5], [1, 2, 0.5]),
        Discrete([0, 1], [1e-12, 1]),
        COUNTS,
        FrozenDistribution(stats.binom(10, 0.3, loc=-2)),
    ],
    ids=["dice", "unsorted", "rare", "poisson", "binomial"],
)
def test_a_discrete_distribution_keeps_the_contract(distribution):
    check_distribution(distribution)


def test_quantiles_are_the_values():
    p = np.array([1e-9, 1 / 6, 0.17, 0.5, 0.51, 1 - 1e-9])
    assert DICE.ppf(p).tolist() == DICE.isf(1 - p).tolist() == [1.0, 1.0, 2.0, 3.0, 4.0, 6.0]
    assert DICE.cdf(np.array([0.0, 1.0, 3.5, 6.0])) == pytest.approx([0.0, 1 / 6, 0.5, 1.0])
    assert DICE.sf(np.array([0.0, 1.0, 3.5, 6.0])) == pytest.approx([1.0, 5 / 6, 0.5, 0.0])


def test_a_small_probability_in_the_upper_tail_keeps_its_digits():
    rare = Discrete([0, 1], [1, 1e-18])
    assert float(rare.sf(np.array(0.5))) == pytest.approx(1e-18, rel=1e-12)
    assert float(rare.isf(np.array(5e-19))) == 1.0


def test_polynomials_are_those_of_the_values():
    found = recurrence(DICE, 5)
    assert found.mean == pytest.approx(3.5)
    assert found.std**2 == pytest.approx(35 / 12)
    values, weights = found.gauss(6)
    assert values == pytest.approx([1, 2, 3, 4, 5, 6])
    assert weights == pytest.approx(6 * [1 / 6])
    assert not recurrence(DICE, 6).is_finite


def test_polynomials_of_counts_are_charliers():
    found = recurrence(COUNTS, 5)
    k = np.arange(6.0)
    assert found.location + found.scale * found.alpha == pytest.approx(3 + k, rel=1e-9)
    assert found.scale**2 * found.beta[1:] == pytest.approx(3 * k[1:], rel=1e-9)


def test_a_study_draws_the_values(study_of):
    law = "{ discrete = { values = [1, 2, 4], weights = [1, 2, 1] } }"
    made = study_of("a * b", '[designs.some]\nkind = "quadrature"\norder = 2', a=law, b=(0.0, 2.0))
    runs = uqpen.run(made)
    assert sorted(set(runs["runs/some"]["a"].values.round(12))) == [1.0, 2.0, 4.0]
    assert runs["statistics/some/y"]["mean"].values[0] == pytest.approx(2.25)
    drawn = study_of("a * b", a=law, b=(0.0, 2.0))
    assert set(uqpen.run(drawn)["runs/some"]["a"].values) <= {1.0, 2.0, 4.0}


def test_python_and_toml_meet():
    law = uqpen.Discrete(["8 mm", "10 mm"], [1, 3])
    made = uqpen.Study(
        model=lambda d: {"y": d},
        inputs={"d": law},
        outputs={"y": "mm"},
        designs={"mc": uqpen.MonteCarlo(runs=10)},
        seed=1,
    )
    assert 'values = [\n    "8 mm",\n    "10 mm",\n]' in made.to_toml()
    assert set(uqpen.run(made)["runs/mc"]["d"].values) <= {0.008, 0.01}


@pytest.mark.parametrize(
    ("law", "found"),
    [
        ("{ discrete = { values = [1] } }", "two or more, each once"),
        ("{ discrete = { values = [1, 1] } }", "two or more, each once"),
        ("{ discrete = { values = [1, 2], weights = [1] } }", "one for each of the 2 values"),
        ("{ discrete = { values = [1, 2], weights = [1, -1] } }", "a list of numbers, 0 or more"),
        ("{ discrete = { values = [1, 2], weights = [0, 1] } }", "at least two above 0"),
        ('{ discrete = { values = [1, "2 m"] } }', "2 m"),
        ("{ discrete = { values = 3 } }", "a list in square brackets"),
        ("{ discrete = { values = [1, 2] }, lower = 1 }", "its values within them alone"),
    ],
)
def test_mistakes_are_met(law, found, study_of):
    with pytest.raises(uqpen.StudyError) as caught:
        study_of("a", a=law)
    assert found in str(caught.value)
    assert "study.toml:10" in str(caught.value)


def test_steps_of_single_values_are_refused(study_of):
    with pytest.raises(uqpen.StudyError, match="which has single values"):
        study_of(
            "a", '[designs.some]\nkind = "one-at-a-time"', a="{ discrete = { values = [1, 2] } }"
        )


@pytest.mark.parametrize("values", [{1: 0.3, 2: 0.7}, {1, 2}])
def test_values_without_an_order_are_refused(values):
    with pytest.raises(SettingsError, match="expected a list of quantities"):
        uqpen.Discrete(values)
    with pytest.raises(SettingsError, match="expected a list of numbers"):
        uqpen.Discrete([1, 2], weights=values)
