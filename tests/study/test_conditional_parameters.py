"""Parameters that are formulas of other inputs: a chain of conditional distributions."""

import numpy as np
import pytest

import uqpen
from uqpen.testing import check_joint

B = '{ normal = { mean = "0.1 * a", std = "0.02 * a" } }'
MANY = '[designs.some]\nkind = "monte-carlo"\nruns = 20000'


def test_moments_are_exact(study_of):
    made = study_of("b", MANY, a="10 ± 1", b=B)
    check_joint(made.joint)
    runs = uqpen.run(made)
    a, b = (runs["runs/some"][name].values for name in "ab")
    # Five standard errors of 20 000 draws.
    assert b.var() == pytest.approx(0.0504, abs=0.0026)
    assert np.cov(a, b)[0, 1] == pytest.approx(0.1, abs=0.0085)
    assert a.var() == pytest.approx(1.0, abs=0.05)
    assert made.joint.nominal() == {"a": 10.0, "b": 1.0}
    assert "b normal: mean 0.1 * a, std 0.02 * a" in runs["runs/some"].attrs["dependence"]
    first = runs["statistics/some/y"]["first_order"].sel(bound="estimate")
    assert float(first.sel(input="a")) == pytest.approx(0.01 / 0.0504, abs=0.02)


def test_other_families_and_chains_have_the_quantiles_of_each_run(study_of):
    made = study_of(
        "a + b + c",
        a="10 ± 1",
        b='{ lognormal = { mean = "a / 5", std = 0.5 } }',
        c='{ uniform = { lower = "b", upper = "b + a * k" } }',
        k="0.5",
    )
    unit = np.random.default_rng(1).random((5, 3))
    points = made.joint.points(unit, {})
    a, b, c = (points[name].values for name in "abc")
    for run in range(5):
        assert b[run] == uqpen.Lognormal(a[run] / 5, 0.5).ppf(unit[run, 1])
        assert c[run] == pytest.approx(b[run] + 0.5 * a[run] * unit[run, 2])
    check_joint(made.joint)


def test_a_point_whose_parameters_make_no_distribution_is_inadmissible(study_of):
    made = study_of("b", a="1 ± 1", b='{ normal = { mean = 0, std = "a" } }')
    runs = uqpen.run(made)["runs/some"]
    assert ((runs["a"].values <= 0) == (runs["status"].values == 1)).all()


@pytest.mark.parametrize(
    ("b", "expected"),
    [
        ('{ normal = { mean = "0.1 * aa", std = "0.1 * a" } }', 'did you mean "a"?'),
        ('{ normal = { mean = "0.1 * a" } }', "inputs.b.normal.std"),
        ("{ normal = { mean = \"a + '1 s'\", std = 1 } }", "the same dimension"),
        ('{ normal = { mean = "0.1 * a", std = 1 }, lower = 0 }', "parameters alone"),
        ('{ normal = { mean = "0.1 * a", std = "-a" } }', "no distribution at the medians"),
        ('{ normal = { mean = "c", std = 1 } }', "a cycle of b and c"),
        ('{ normal = { mean = "d", std = 1 } }', "d, which follows from others"),
        ('{ discrete = { values = "a" } }', "a list"),
    ],
)
def test_mistakes_are_met(b, expected, study_of):
    c = '{ normal = { mean = "b", std = 1 } }' if '"c"' in b else "1"
    with pytest.raises(uqpen.StudyError) as caught:
        study_of("b", a="10 ± 1", b=b, c=c, d="2 * a")
    assert expected in str(caught.value)
    assert "study.toml:1" in str(caught.value)


def test_a_parameter_of_an_input_of_a_group_or_of_an_interval_is_refused(tmp_path):
    (tmp_path / "m.py").write_text("def f(a, b, e, g):\n    return {'y': a}\n")
    (tmp_path / "rows.csv").write_text("a,e\n1,2\n2,1\n3,3\n")
    units = 'inputs = { a = "1", b = "1", e = "1", g = "1" }\noutputs = { y = "1" }\n'
    text = f'seed = 1\n[model]\npython = "m.py:f"\n{units}[joint.s]\nsample = "rows.csv"\n'
    text += f"[inputs]\ng = {{ interval = [1, 2] }}\nb = {B.replace('02 * a', '02 * g')}\n"
    with pytest.raises(uqpen.StudyError) as caught:
        uqpen.parse_study(text + MANY, folder=tmp_path)
    said = str(caught.value)
    assert "a parameter of a, which is in [joint]" in said
    assert "a parameter of g, which is an interval" in said


def test_a_copula_of_such_an_input_is_refused(study_of):
    with pytest.raises(uqpen.StudyError, match="that of parameters in"):
        study_of(
            "a + b + c",
            '[dependence]\ncopula = "clayton"\ninputs = ["a", "c"]\ntheta = 2\n' + MANY,
            a="10 ± 1",
            b=B,
            c="10 ± 1",
        )
