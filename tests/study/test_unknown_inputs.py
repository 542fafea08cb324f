"""Inputs with unknowns in a study file: what is read, and what each method says to them."""

import pytest

from uqpen.core.errors import StudyError

MEASURED = '{ measured = { file = "x.csv", family = "normal", uncertain = true } }'
BOX = "{ normal = { mean = [9, 11], std = 1 } }"
EVENT = "[outputs.y]\nexceeds = [20]\n[designs.d]\nkind = "


@pytest.fixture(autouse=True)
def _specimens(tmp_path):
    (tmp_path / "x.csv").write_text("x\n9.1\n10.4\n8.7\n10.9\n9.8\n11.3\n10.1\n9.5\n")


def refusal(study_of, design, **inputs):
    with pytest.raises(StudyError) as caught:
        study_of("a + b", EVENT + design, **inputs)
    return str(caught.value)


@pytest.mark.parametrize(
    "design",
    [
        '"monte-carlo"\nat_most = 4000\nuntil = { y = { mean = "2 %" } }',
        '"sobol-sequence"\nruns = 64',
        '"saltelli"\nbase = 64',
        '"morris"\ntrajectories = 10',
        '"form"\nevent = "y > 20"',
        '"subset-simulation"\nevent = "y > 20"',
    ],
)
def test_fitted_inputs_are_drawn_from_their_predictive_distribution(study_of, design):
    study = study_of("a + b", EVENT + design, a=MEASURED, b="10 ± 1")
    (entry,) = study.joint.random[:1]
    assert entry.distribution == entry.unknown.predictive
    assert "its parameters uncertain, so drawn as the next specimen is" in entry.description
    assert entry.fit["fit_measurements"] == 8


@pytest.mark.parametrize(
    ("design", "reason"),
    [
        (
            '"monte-carlo"\nat_most = 4000\nuntil = { y = { mean = "2 %" } }',
            "give the number of runs",
        ),
        ('"latin-hypercube"\nruns = 100', "spoil its strata"),
        ('"saltelli"\nbase = 64', "needs one distribution"),
        ('"quadrature"\norder = 3', "needs one distribution"),
        ('"form"\nevent = "y > 20"', "a study of its own"),
        ('"subset-simulation"\nevent = "y > 20"', "a study of its own"),
    ],
)
def test_methods_of_one_distribution_refuse_a_box(study_of, design, reason):
    said = refusal(study_of, design, a=BOX, b="10 ± 1")
    assert "over a, whose parameters are intervals" in said
    assert reason in said
    assert 'kind = "monte-carlo" gives bounds' in said


TWO = "{ normal = { mean = [9, 11], std = [1, 2] } }"
COPULA = (
    '"monte-carlo"\nruns = 9\n[dependence]\ncopula = "gaussian"\nof = "spearman"\n'
    'inputs = ["a", "b"]\nmatrix = [[1, 0.5], [0.5, 1]]'
)
SURROGATE = '"monte-carlo"\nruns = 100\n[surrogates.s]\nkind = "polynomial-chaos"\ndesign = "d"'


@pytest.mark.parametrize(
    ("design", "inputs", "reasons"),
    [
        ('"quadrature"\norder = 3', {"a": MEASURED},
         ["quadrature over a, whose parameters are uncertain", "tails of Student's"]),
        ('"monte-carlo"\nruns = 100', dict.fromkeys("abcd", TWO),
         ["8 parameters that are intervals",
          "at most 6: bounds are looked for on a grid over all of them"]),
        (SURROGATE, {"a": BOX}, ["a surrogate over a, whose parameters are intervals"]),
        (COPULA, {"a": BOX}, ["a, whose parameters are uncertain or intervals"]),
        (COPULA, {"a": MEASURED}, ["a, whose parameters are uncertain or intervals"]),
    ],
)  # fmt: skip
def test_what_takes_no_unknowns_says_why(study_of, design, inputs, reasons):
    said = refusal(study_of, design, **({"b": "10 ± 1"} | inputs))
    for reason in reasons:
        assert reason in said


@pytest.mark.parametrize(
    ("a", "expected"),
    [
        ("{ normal = { mean = [11, 9], std = 1 } }", "the lower end first"),
        ("{ normal = { mean = [9, 10, 11], std = 1 } }", "two ends"),
        ("{ normal = { mean = [9, 'x'], std = 1 } }", "inputs.a.normal.mean"),
        ("{ normal = { mean = [9, 11], std = [-1, 1] } }", "inputs.a.normal.std"),
        ("{ normal = { mean = [9, 11], spread = 1 } }", "spread"),
        ("{ uniform = { lower = [0, 2], upper = [1, 3] } }", "at a corner of the intervals"),
        ("{ poisson = { mean = [3, 4] } }", "one value: bounds are of continuous"),
        ("{ lognormal = { median = [3, 4], std = 1 } }", "inputs.a.lognormal.median"),
        ("{ normal = { mean = [3, 4], quantile = [0.9, 5] } }", "inputs.a.normal.quantile"),
        ("{ mixture = [{ weight = 1, normal = { mean = [3, 4], std = 1 } }, "
         "{ weight = 1, normal = { mean = 0, std = 1 } }] }",
         "intervals as parameters in a mixture"),
        ('{ measured = { file = "x.csv", uncertain = true } }', "a family beside it"),
        ('{ measured = { file = "x.csv", family = "normal", uncertain = "yes" } }',
         "inputs.a.measured.uncertain"),
        ('{ measured = { file = "x.csv", family = "triangular", uncertain = true } }',
         "which is not fitted"),
    ],
)  # fmt: skip
def test_mistakes_are_met_with_their_place(study_of, a, expected):
    said = refusal(study_of, '"monte-carlo"\nruns = 9', a=a, b="10 ± 1")
    assert expected in said
    assert "inputs.a" in said or "[inputs]" in said


def test_limits_truncate_all_distributions_of_an_unknown(study_of):
    box = BOX.removesuffix("}") + ", lower = 8, upper = 12 }"
    study = study_of("a", EVENT + '"monte-carlo"\nruns = 9', a=box)
    (entry,) = study.joint.random
    assert {(each.lower, each.upper) for each in entry.unknown.corners()} == {(8.0, 12.0)}
    measured = MEASURED.removesuffix("}") + ", lower = 8 }"
    study = study_of("a", EVENT + '"monte-carlo"\nruns = 9', a=measured)
    (entry,) = study.joint.random[:1]
    assert entry.distribution.ppf(0.0) == pytest.approx(8.0)
    assert {each.lower for each in entry.unknown.draws} == {8.0}


def test_the_draws_are_those_of_the_seed_alone(study_of):
    first, second = (
        study_of(body, EVENT + '"monte-carlo"\nruns = 9', a=MEASURED, b="10 ± 1").joint.random[0]
        for body in ("a + b", "a - b")
    )
    assert first.unknown.draws == second.unknown.draws
