"""Members of joint distributions: copulas, samples, chaospy's."""

from dataclasses import replace

import chaospy
import numpy as np
import pytest
from study_text import study_text

import uqpen
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.rounds import first_round
from uqpen.distributions.input_group import SampleDistribution
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.results.output_tables import output_tables
from uqpen.surrogates.archived_surrogate import restore_surrogate
from uqpen.testing import check_joint

FACTOR = chaospy.Uniform(1, 2)
JOINTS = {
    "dependent parameter": chaospy.J(FACTOR, chaospy.Normal(mu=FACTOR, sigma=0.1)),
    "multivariate normal": chaospy.MvNormal([1, 2], [[1, 0.5], [0.5, 2]]),
    "multivariate Student": chaospy.MvStudentT(5, [1, 2], [[1, 0.5], [0.5, 2]]),
    "Nataf": chaospy.Nataf(chaospy.J(chaospy.Normal(), chaospy.Uniform()), [[1, 0.5], [0.5, 1]]),
    "independent": chaospy.J(chaospy.Normal(2, 1), chaospy.Gamma(2)),
}


def posterior(rows=400):
    generator = np.random.default_rng(0)
    a = generator.normal(5.0, 1.0, rows)
    b = a + 0.3 * generator.normal(size=rows)
    return {"a [mm]": a, "b": b, "weight": generator.random(rows)}


def model(a, b, c):
    return {"y": a + b * c}


def study(inputs=None, designs=None, **others):
    return uqpen.Study(
        model=model,
        inputs={"c": uqpen.Uniform(1, 2)} if inputs is None else inputs,
        outputs={"y": "1"},
        designs=designs or {"mc": uqpen.MonteCarlo(runs=500)},
        seed=1,
        **others,
    )


@pytest.mark.parametrize("name", JOINTS)
def test_a_joint_distribution_of_chaospy_keeps_the_contract(name):
    made = study({("a", "b"): JOINTS[name], "c": 1.0})
    check_joint(made.joint)
    assert made.joint.is_independent == (name == "independent")


@pytest.mark.parametrize("weighted", [False, True])
def test_a_sample_keeps_the_contract(*, weighted):
    columns = posterior()
    if not weighted:
        del columns["weight"]
    made = study(joint={"posterior": {"sample": columns}})
    check_joint(made.joint)
    assert not made.joint.is_independent


def test_a_draw_is_a_row_of_the_sample():
    columns = posterior()
    runs = uqpen.run(study(joint={"posterior": {"sample": columns}}))["runs/mc"]
    rows = {(a / 1000, b) for a, b in zip(columns["a [mm]"], columns["b"], strict=True)}
    drawn = set(zip(runs["a"].values.tolist(), runs["b"].values.tolist(), strict=True))
    assert {(round(a, 12), b) for a, b in drawn} <= {(round(a, 12), b) for a, b in rows}
    assert runs.attrs["dependence"] == "400 weighted rows of a table of a, b"


def test_stratified_points_take_rows_evenly():
    columns = posterior(100)
    del columns["weight"]
    joint = study(joint={"p": {"sample": columns}}).joint
    for kind, runs in ((uqpen.LatinHypercube, 400), (uqpen.SobolSequence, 1_024)):
        design = kind(runs=runs, replicates=4)
        values = points_in_memory(next(design.rounds(joint, Stream(1))))["b"].values
        counts = np.array([(values == each).sum() for each in columns["b"]])
        share = len(values) / 100
        assert np.abs(counts - share).max() <= 2 * 4
        assert counts.std() < 0.5 * np.sqrt(share)  # that of independent draws is its root


def test_the_mean_over_a_sample_is_right():
    columns = posterior()
    made = study(
        joint={"p": {"sample": columns}}, designs={"sobol": uqpen.SobolSequence(runs=1_024)}
    )
    _, lower, upper = uqpen.run(made)["statistics/sobol/y"]["mean"].values
    truth = np.average(columns["a [mm]"] + 1.5 * columns["b"], weights=columns["weight"])
    assert lower < truth < upper


def write(folder, text="a [mm],b,note\n5000,1,x\n6000,2,y\n7000,4,z\n"):
    (folder / "posterior.csv").write_text(text)


TOML = study_text(
    {
        "python": "m.py:f",
        "vectorized": True,
        "inputs": {"a": "m", "b": "1", "c": "1"},
        "outputs": {"y": "1"},
    },
    inputs={"c": (1, 2)},
    joint={"posterior": {"sample": "posterior.csv"}},
    designs={"mc": {"kind": "monte-carlo", "runs": 50}},
)


def from_text(folder, text=TOML):
    (folder / "m.py").write_text("def f(a, b, c):\n    return {'y': a + b * c}\n")
    (folder / "s.toml").write_text(text)
    return uqpen.load_study(folder / "s.toml")


def test_a_file_of_a_sample_is_kept_and_verified(tmp_path):
    write(tmp_path)
    uqpen.make_archive(from_text(tmp_path), tmp_path / "a.nc")
    tree = uqpen.open_archive(tmp_path / "a.nc")
    assert set(tree["runs/mc"]["a"].values) == {5.0, 6.0, 7.0}
    (tmp_path / "posterior.csv").unlink()
    checks = uqpen.verify(tmp_path / "a.nc", trust=True)
    assert {check.verdict.name for check in checks} == {"EQUAL"}


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ('"posterior.csv"', '"gone.csv"', "there is no file"),
        ('"posterior.csv"', "3", "found     3"),
        ('"posterior.csv"', '"posterior.csv"\ninputs = ["a", "d"]', '"d" is no input'),
        ('"posterior.csv"', '"posterior.csv"\ninputs = ["a", "c"]', 'column "c" is not there'),
        ('"posterior.csv"', '"posterior.csv"\ninputs = ["b"]', "two or more depend on each other"),
        ('"posterior.csv"', '"posterior.csv"\nwieghts = 1', "an unknown key"),
        ('a = "m"', 'a = "kg"', 'column "a" is in "mm"'),
        ("c = {", "a = 1\nc = {", "a, which [inputs] has"),
        ('sample = "posterior.csv"', 'inputs = ["a", "b"]', "no distribution"),
        ('"posterior.csv"', '"posterior.csv"\ninputs = [["a"], "b"]', '["a"] is no input'),
        ('"posterior.csv"', '"posterior.csv"\ninputs = ["a", "a"]', '"a" stands twice in inputs'),
        ('"posterior.csv"', '"posterior.csv"\nunits = ["mm", "1"]', "known: sample, inputs"),
        ("[designs.mc]", "[joint.other]\nsample = 'posterior.csv'\n[designs.mc]", "[joint.post"),
        (
            "[designs.mc]",
            "[dependence]\ncopula = 'gaussian'\nof = 'scores'\n"
            "pairs = [{ inputs = ['a', 'c'], correlation = 0.5 }]\n[designs.mc]",
            "a, whose joint distribution is [joint.posterior]",
        ),
        ('kind = "monte-carlo"\nruns = 50', 'kind = "saltelli"\nbase = 64', "([joint])"),
        ('kind = "monte-carlo"\nruns = 50', 'kind = "one-at-a-time"', "which has single values"),
        (
            'kind = "monte-carlo"\nruns = 50',
            'kind = "full-factorial"\nlevels = 3',
            "levels of a, b, which are rows of a sample",
        ),
    ],
)
def test_a_mistake_is_met_with_its_line(old, new, found, tmp_path):
    write(tmp_path)
    assert old in TOML
    with pytest.raises(uqpen.StudyError) as caught:
        from_text(tmp_path, TOML.replace(old, new))
    assert found in str(caught.value)
    assert "s.toml:" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("a [mm],b\n1,2\n1,3\n", 'column "a" does not vary'),
        ("a [mm],b\n1,2\n3,x\n", 'line 3, column "b": found "x", expected a number'),
        ("a [mm],a\n1,2\n", 'column "a" stands twice'),
        ("a [mm],b,weight\n1,2,1\n3,4,0\n", "above 0 in fewer than two rows"),
        ("a [mm],b,weight\n1,2,1\n3,4,-1\n", 'column "weight" is below 0: -1'),
        ("a [mm],b,weight,weight\n1,2,1,1\n3,4,1,2\n", 'column "weight" stands twice'),
        ("a [mm],b\n", "number of rows: 0, expected two or more"),
        ("a [mm],b\n1,2\n", "number of rows: 1, expected two or more"),
    ],
)
def test_a_mistake_in_a_sample_is_met(text, found, tmp_path):
    write(tmp_path, text)
    with pytest.raises(uqpen.StudyError) as caught:
        from_text(tmp_path)
    assert found in str(caught.value)


def test_a_study_may_have_grouped_inputs_alone(tmp_path):
    write(tmp_path, "a [mm],b,c\n5000,1,1\n6000,2,1.5\n")
    text = TOML.replace("[inputs]\nc = { uniform = { lower = 1, upper = 2 } }\n", "")
    made = from_text(tmp_path, text)
    check_joint(made.joint)


def test_an_expansion_is_fitted_over_a_sample():
    columns = posterior()
    surrogate = uqpen.PolynomialChaos(design="mc", order=2, check="test")
    made = study(
        joint={"p": {"sample": columns}},
        designs={"mc": uqpen.MonteCarlo(runs=100), "test": uqpen.MonteCarlo(runs=50)},
        surrogates={"pce": surrogate},
    )
    tree = uqpen.run(made)
    mean = tree["statistics/pce/y"]["mean"]
    truth = np.average(columns["a [mm]"] + 1.5 * columns["b"], weights=columns["weight"])
    assert float(mean[0]) == pytest.approx(truth, rel=0.2)
    total = tree["statistics/pce/y"]["total_order"]
    assert np.isnan(total).all()
    assert total.attrs["note"].startswith("its draws are whole rows of a sample")
    # So the indices of the larger design stand beside.
    (shares,) = (
        each for each in output_tables(tree) if "explained by inputs that depend" in each.title
    )
    first = shares.columns.index("first order\nmc")
    assert all("±" in cells[first] or "…" in cells[first] for _, cells in shares.rows)


def test_data_of_chaospy_stand_in_the_text():
    made = study({("a", "b"): JOINTS["multivariate normal"], "c": 1.0})
    assert 'name = "MvNormal"' in made.to_toml()
    again = uqpen.parse_study(made.to_toml(), objects={})
    assert isinstance(again.joint, JointDistribution)
    unit = np.random.default_rng(3).random((20, 2))
    assert made.joint.points(unit, {}).identical(again.joint.points(unit, {}))


def test_an_object_of_chaospy_is_named(tmp_path):
    made = study({("a", "b"): JOINTS["dependent parameter"], "c": 1.0})
    assert 'object = "J(Uniform(lower=1, upper=2), ' in made.to_toml()
    runs = uqpen.run(made)["runs/mc"]
    difference = runs["b"] - runs["a"]
    assert float(difference.std()) == pytest.approx(0.1, rel=0.15)
    uqpen.make_archive(made, tmp_path / "a.nc")
    verdicts = {each.name: each.verdict.name for each in uqpen.verify(tmp_path / "a.nc")}
    assert verdicts["statistics"] == "EQUAL"
    assert "DIFFERENT" not in verdicts.values()
    known = {("a", "b"): JOINTS["dependent parameter"]}
    checks = uqpen.verify(tmp_path / "a.nc", model=model, inputs=known, runs=20)
    assert {check.verdict.name for check in checks} == {"EQUAL"}


def test_units_of_chaospys_values():
    joint = {"ab": {"inputs": ["a", "b"], "units": ["mm", "1"], "chaospy": JOINTS["Nataf"]}}
    made = study(joint=joint)
    plain = study({("a", "b"): JOINTS["Nataf"], "c": 1.0}).joint
    unit = np.random.default_rng(3).random((20, 3))
    scaled = made.joint.points(unit, {})["a"].values
    names = [entry.variable.name for entry in made.joint.random]
    columns = [names.index(name) for name in ("a", "b")]
    expected = plain.points(unit[:, columns], {})["a"].values
    np.testing.assert_allclose(1000 * scaled, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("joint", "found"),
    [
        ({"inputs": ["a", "b"], "chaospy": {"name": "MvNormal", "mu": [1, 2, 3]}}, "parameters of"),
        ({"inputs": ["a", "b"], "chaospy": {"name": "Nothing"}}, "a distribution of chaospy"),
        (
            {"inputs": ["a", "b"], "chaospy": chaospy.MvNormal(3 * [0], np.eye(3).tolist())},
            "3 dimensions, for 2 inputs",
        ),
        ({"inputs": ["a", "x"], "chaospy": JOINTS["Nataf"]}, "cannot take the inputs"),
        ({"inputs": ["a"], "chaospy": JOINTS["Nataf"]}, "two or more, in their order"),
        (
            {"inputs": ["a", "b"], "units": ["1"], "chaospy": JOINTS["Nataf"]},
            "1 units for 2 inputs",
        ),
    ],
)
def test_mistakes_of_chaospys_are_met(joint, found):
    with pytest.raises(uqpen.StudyError) as caught:
        study(joint={"ab": joint})
    assert found in str(caught.value)
    assert "uqpen.Study(" in str(caught.value)


def test_an_expansion_needs_a_joint_distribution_that_a_study_states():
    with pytest.raises(uqpen.StudyError, match="polynomials of a, b"):
        study(
            {("a", "b"): JOINTS["dependent parameter"], "c": 1.0},
            surrogates={"pce": uqpen.PolynomialChaos(design="mc", order=2)},
        )


@pytest.mark.slow
def test_an_expansion_over_a_joint_distribution_is_one_in_rosenblatts_scores():
    archive = uqpen.run(
        uqpen.Study(
            model=lambda a, b: {"y": a * b},
            joint={"ab": {"inputs": ["a", "b"], "chaospy": CONDITIONAL}},
            outputs={"y": "1"},
            designs={"mc": uqpen.MonteCarlo(runs=300)},
            surrogates={"pce": uqpen.PolynomialChaos(design="mc", order=2)},
            seed=1,
        )
    )
    statistics = archive["statistics/pce/y"].dataset
    # y = ab, of degree 2 in the scores: E y = 0.1 E a², Var y = 0.01 Var a² + 0.04 E a².
    constant, *others = archive["surrogates/pce/y"]["coefficient"].values
    assert constant == pytest.approx(0.1 * 101, rel=1e-12)
    assert sum(np.square(others)) == pytest.approx(0.01 * 402 + 0.04 * 101, rel=1e-12)
    assert np.isnan(statistics["first_order"]).all(), "the scores' indices are not the inputs'"
    restored = restore_surrogate(archive["surrogates/pce"], "pce")
    points = {"a": np.array([9.0, 10.0, 14.0]), "b": np.array([1.2, 0.2, 1.0])}
    expected = pytest.approx(points["a"] * points["b"], rel=1e-9)
    assert restored.evaluate(points).outputs["y"] == expected


class Batched(SampleDistribution):
    """Values that depend on the other points of a design."""

    def values(self, unit):
        return super().values(unit) + len(unit)


class Inverted(SampleDistribution):
    """Draws that do not follow the weights of the rows."""

    def values(self, unit):
        return super().values(unit**3)


class Infinite(SampleDistribution):
    """Draws of which some are not finite."""

    def values(self, unit):
        return np.where(unit < 0.01, np.inf, super().values(unit))


@pytest.mark.parametrize(
    ("broken", "reason"),
    [
        (Batched, "depends on others"),
        (Inverted, "follow its own distribution"),
        (Infinite, "are finite"),
    ],
)
def test_the_contract_tells_a_broken_group(broken, reason, tmp_path):
    write(tmp_path)
    joint = from_text(tmp_path).joint
    (group,) = joint.groups
    assert isinstance(group, SampleDistribution)
    other = broken(group.inputs, group.rows, group.weights)
    with pytest.raises(AssertionError, match=reason):
        check_joint(replace(joint, groups=(other,)))


def test_an_input_in_two_entries_is_refused_in_python():
    with pytest.raises(uqpen.StudyError) as caught:
        study({("a", "b"): JOINTS["independent"], "b": 1.0, "c": 1.0})
    (problem,) = caught.value.problems
    assert problem.found == "b, which [inputs] has"
    assert problem.key == "joint.a_b"


CONDITIONAL = [
    {"name": "Normal", "mu": 10, "sigma": 1},
    {"name": "Normal", "mu": "0.1 * a", "sigma": 0.2},
]


def conditional(parts, **others):
    joint = {"ab": {"inputs": ["a", "b"], "chaospy": parts, **others}}
    return study({"c": 1.0}, {"mc": uqpen.MonteCarlo(runs=4000)}, joint=joint)


def test_a_parameter_may_be_a_formula_of_an_earlier_input():
    made = conditional(CONDITIONAL)
    check_joint(made.joint)
    points = first_round(uqpen.MonteCarlo(runs=4000), made.joint, Stream(1))
    values = points_in_memory(points)
    a, b = values["a"].values, values["b"].values
    # Var b = 0.04 + 0.01 Var a, and the covariance 0.1 Var a; six standard errors of 4 000 draws.
    assert np.var(b) == pytest.approx(0.05, abs=0.007)
    assert np.cov(a, b)[0, 1] == pytest.approx(0.1, abs=0.025)
    assert b.mean() == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize(
    ("parts", "found"),
    [
        ([CONDITIONAL[0], {**CONDITIONAL[1], "mu": "0.1 * c"}], "a name before it; known: a"),
        ([CONDITIONAL[0], {**CONDITIONAL[1], "mu": "0.1 * b"}], "a name before it; known: a"),
        ([CONDITIONAL[0], {**CONDITIONAL[1], "mu": "open('a')"}], "a name before it"),
        ([CONDITIONAL[0], {**CONDITIONAL[1], "mu": "a * '2 mm'"}], "plain numbers"),
        ([CONDITIONAL[0], {**CONDITIONAL[1], "mu": "a *"}], "a formula of a"),
        ([CONDITIONAL[0], {**CONDITIONAL[1], "mu": True}], "a number, or a formula"),
        ([CONDITIONAL[0], {**CONDITIONAL[1], "sgma": 1}], "parameters that it takes"),
        ([CONDITIONAL[0], {"name": "Norml"}], 'did you mean "Normal"?'),
        ([CONDITIONAL[0], {"name": "MvNormal"}], "a distribution of chaospy"),
        (CONDITIONAL[:1], "1 distributions for 2 inputs"),
        ([CONDITIONAL[0], 3], "a table such as"),
    ],
)
def test_mistakes_of_conditional_parameters_are_met(parts, found):
    with pytest.raises(uqpen.StudyError) as caught:
        conditional(parts)
    assert found in str(caught.value)
    assert len(caught.value.problems) == 1
