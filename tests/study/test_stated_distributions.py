"""Families by moments and quantiles in place of parameters, mixtures, whole numbers."""

import math

import numpy as np
import pytest
from example_distributions import EXAMPLES

import uqpen
from uqpen.distributions.orthogonal_polynomials import recurrence


def law_of(study_of, text):
    return study_of("x", x=text).joint.random[0].distribution


def family(name, *parameters):
    return f"{{ {name} = {{ {', '.join(parameters)} }} }}"


BY_MOMENTS = {
    "normal": [],
    "logistic": [],
    "gumbel": [],
    "lognormal": [],
    "weibull": [],
    "pareto": [],
    "log-uniform": [],
    "gamma": [],
    "uniform": [],
    "arcsine": [],
    "student": ["degrees = 4.5"],
    "generalised-extreme-value": ["shape = 0.1"],
    "beta": ["lower = 0", "upper = 5"],
}


@pytest.mark.parametrize("name", BY_MOMENTS)
@pytest.mark.parametrize("std", [0.02, 0.7])
def test_a_family_has_the_mean_and_std_that_are_stated(name, std, study_of):
    law = law_of(study_of, family(name, "mean = 2", f"std = {std}", *BY_MOMENTS[name]))
    found = recurrence(law, 1)
    # Of a long tail, the sums miss a little.
    long = name in ("pareto", "student", "generalised-extreme-value")
    assert found.mean == pytest.approx(2, rel=1e-6 if long else 1e-9)
    assert found.std == pytest.approx(std, rel=1e-2 if long else 1e-7)


BY_QUANTILES = {name: kept for name, kept in BY_MOMENTS.items() if name != "beta"}


@pytest.mark.parametrize("name", BY_QUANTILES)
def test_a_family_has_the_quantiles_that_are_stated(name, study_of):
    kept = BY_QUANTILES[name]
    law = law_of(study_of, family(name, "median = 2", "quantile = [0.95, 3]", *kept))
    assert law.ppf(np.array([0.5, 0.95])) == pytest.approx([2, 3], rel=1e-12)
    both = law_of(study_of, family(name, "quantile = [[0.9, 3], [0.2, 1.5]]", *kept))
    assert both.ppf(np.array([0.2, 0.9])) == pytest.approx([1.5, 3], rel=1e-12)


def test_the_forms_of_the_gum_are_families(study_of):
    half = ("mean = 12", "half_width = 0.5")
    assert law_of(study_of, family("rectangular", *half)) == uqpen.Uniform(11.5, 12.5)
    assert law_of(study_of, family("triangular", *half)) == uqpen.Triangular(11.5, 12, 12.5)
    assert law_of(study_of, family("arcsine", *half)) == uqpen.Arcsine(11.5, 12.5)
    law = law_of(study_of, family("normal", "mean = 10", "quantile = [0.975, 10.2]"))
    assert law.std == pytest.approx(0.2 / 1.959963984540054)
    assert law_of(study_of, family("exponential", "median = 2")).mean == pytest.approx(
        2 / math.log(2)
    )
    assert law_of(study_of, family("rayleigh", "std = 2")).scale == pytest.approx(
        2 / math.sqrt(2 - math.pi / 2)
    )


def test_the_parameters_that_follow_are_described(study_of):
    entry = study_of("x", x=family("lognormal", "median = 2", "quantile = [0.95, 3]")).joint.random[
        0
    ]
    assert entry.description == (
        "lognormal: median 2, quantile [0.95, 3]; so mean 2.062, std 0.516"
    )


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        (family("normal", "mean = 1", "median = 1"), "two that differ"),
        (family("normal", "median = 1"), "two of mean, std, median, quantiles"),
        (family("normal", "mean = 1", "std = 1", "median = 1"), "two of mean, std, median"),
        (family("normal", "mean = 1", "half_width = 1"), "two of mean, std, median, quantiles"),
        (family("normal", "quantile = [[0.1, 3], [0.9, 2]]"), "others, or another family"),
        (family("normal", "quantile = [95, 3]", "mean = 1"), "a probability and the value"),
        (family("normal", 'quantile = [0.9, "3 m"]', "mean = 1"), "3 m"),
        (family("student", "mean = 1", "std = 1"), "beside degrees"),
        (family("student", "mean = 1", "std = 1", "degrees = 2"), "median and quantiles"),
        (family("lognormal", "mean = 1", "median = 2"), "mean and std, or two of median"),
        (family("lognormal", "median = -1", "quantile = [0.9, 2]"), "others, or another family"),
        (family("gamma", "mean = 1", "median = 2"), "mean and std, or two of median"),
        (family("beta", "mean = 1", "std = 1"), "beside lower and upper"),
        (family("beta", "mean = 1", "std = 9", "lower = 0", "upper = 2"), "another family"),
        (family("discrete", "values = [1, 2]", "mean = 1"), "its parameters"),
        (family("pareto", "mean = 1", "std = 1", "degree = 1"), "known: "),
        ("{ mixture = 3 }", "a list in square brackets"),
        ("{ mixture = [{ weight = 1, normal = { mean = 1, std = 1 } }] }", "at least two"),
        ("{ mixture = [{ normal = { mean = 1, std = 1 } }] }", "{ weight = 0.7, normal = { … } }"),
        ('{ mixture = [{ weight = 1, measured = { file = "a.csv" } }] }', "by themselves"),
        ("{ mixture = [{ weight = 1, norm = { mean = 1 } }] }", 'did you mean "normal"?'),
        ("{ mixture = [{ weight = 1, bernoulli = { probability = 0.2 } },"
         " { weight = 1, normal = { mean = 1, std = 1 } }] }", "continuous ones"),
        ("{ poisson = { mean = 3 }, upper = 5 }", "its values within them alone"),
        ("{ gev = { location = 1 } }", 'did you mean "generalised-extreme-value"?'),
    ],
)  # fmt: skip
def test_mistakes_are_met(law, expected, study_of):
    with pytest.raises(uqpen.StudyError) as caught:
        study_of("x", x=law)
    assert expected in str(caught.value)
    assert "study.toml:10" in str(caught.value)


def test_whole_numbers_have_no_unit(tmp_path):
    (tmp_path / "m.py").write_text("def f(x):\n    return {'y': x}\n")
    text = (
        'seed = 1\n[model]\npython = "m.py:f"\n[model.inputs]\nx = "m"\n[model.outputs]\ny = "m"\n'
        '[inputs]\nx = { poisson = { mean = 3 } }\n[designs.d]\nkind = "monte-carlo"\nruns = 9\n'
    )
    with pytest.raises(uqpen.StudyError, match="whole numbers, of an input in m"):
        uqpen.parse_study(text, folder=tmp_path)


def test_a_mixture_is_drawn_and_can_be_truncated(study_of):
    parts = "[{ weight = 0.7, normal = { mean = 0, std = 1 } }, { weight = 0.3, %s }]"
    mixture = parts % "normal = { mean = 4, std = 0.5 }, upper = 5"
    law = law_of(study_of, f"{{ mixture = {mixture}, lower = -3 }}")
    assert law.lower == -3
    assert law.parent.shares == (0.7, 0.3)
    assert law.parent.parts[1] == uqpen.Truncated(uqpen.Normal(4.0, 0.5), upper=5.0)
    made = study_of(
        "x", '[designs.q]\nkind = "quadrature"\norder = 2', x=f"{{ mixture = {mixture} }}"
    )
    assert made.joint.random[0].description == (
        "mixture: 0.7 normal: mean 0, std 1, 0.3 normal: mean 4, std 0.5; at most 5"
    )
    runs = uqpen.run(made)
    expected = recurrence(made.joint.random[0].distribution, 1)
    assert runs["statistics/q/y"]["mean"].values[0] == pytest.approx(expected.mean)


@pytest.mark.parametrize("name", [*EXAMPLES, "mixture"])
def test_python_and_toml_meet(name):
    mixture = uqpen.Mixture([uqpen.Normal(0.0, 1.0), uqpen.Gumbel(4.0, 0.5)], [3, 1])
    law = {**EXAMPLES, "mixture": mixture}[name]
    made = uqpen.Study(
        model=lambda x: {"y": x},
        inputs={"x": law},
        outputs={"y": "1"},
        designs={"mc": uqpen.MonteCarlo(runs=10)},
        seed=1,
    )
    (found,) = made.joint.random
    p = np.array([0.1, 0.5, 0.8])
    assert found.distribution.ppf(p).tolist() == law.ppf(p).tolist()


@pytest.mark.parametrize(
    ("law", "second"),
    [
        ("{ poisson = { mean = 3 } }", 12.0),
        ("{ binomial = { trials = 10, probability = 0.3 } }", 11.1),
        ("{ integer = { lower = 1, upper = 6 } }", 91 / 6),
        ("{ bernoulli = { probability = 0.3 } }", 0.3),
    ],
)
def test_rules_over_whole_numbers_are_exact(law, second, study_of):
    made = study_of("a**2", '[designs.some]\nkind = "quadrature"\norder = 1', a=law)
    if "bernoulli" not in law:
        made = study_of("a**2", '[designs.some]\nkind = "quadrature"\norder = 2', a=law)
    assert uqpen.run(made)["statistics/some/y"]["mean"].values[0] == pytest.approx(second)
