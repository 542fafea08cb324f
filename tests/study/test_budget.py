"""A budget of runs in place of designs: what is planned, said, kept and refused."""

import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import uqpen
from uqpen.core.errors import StudyError
from uqpen.core.lookup import resolve
from uqpen.designs import DESIGNS
from uqpen.designs.replicated import ReplicatedDesign
from uqpen.study.budget_section import plan_runs
from uqpen.study.load import parse_study
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos

ISHIGAMI = """\
seed = 1
budget = 200  # of runs

[model]
use = "ishigami"

[inputs]
x1 = { uniform = { lower = -3, upper = 3 } }
x2 = { uniform = { lower = -3, upper = 3 } }
x3 = { uniform = { lower = -3, upper = 3 } }
"""
TWO = ISHIGAMI.replace("[model]", "[models.a]").replace(
    "[inputs]", "[models.b]\nuse = 'ishigami'\n[inputs]"
)

BUDGETS = st.integers(10, 3000) | st.integers(10, 10**6)
INPUTS = st.integers(1, 50)


def _settings(plan, section):
    return {each.name: dict(each.settings) for each in plan if each.section == section}


def _runs(plan):
    return sum(each["runs"] for each in _settings(plan, "designs").values())


@settings(max_examples=100)
@given(
    budget=BUDGETS,
    inputs=INPUTS,
    no_surrogate=st.sampled_from(["", "no surrogate of several models"]),
)
def test_any_plan_is_valid_and_uses_nearly_all_of_its_budget(budget, inputs, no_surrogate):
    plan = plan_runs(budget, inputs, no_surrogate)
    # A line of the terminal.
    assert all(len(f"planned: {each.text}") <= 80 for each in plan)
    assert 0.9 * budget <= _runs(plan) <= budget
    assert _runs(plan) <= _runs(plan_runs(budget + 1, inputs, no_surrogate))
    designs = _settings(plan, "designs")
    for each in designs.values():
        made = resolve(DESIGNS[each.pop("kind")])(**each)
        assert not list(made.check_settings())
        # Intervals of replicates were not measured below these.
        assert not isinstance(made, ReplicatedDesign) or (
            made.replicates >= 10 and made.runs >= 100
        )
    for each in _settings(plan, "surrogates").values():
        assert not no_surrogate
        assert each.pop("kind") == "polynomial-chaos"
        fitted = PolynomialChaos(**each)
        assert designs[fitted.design]["runs"] >= 10 * inputs
        assert fitted.check is not None
        assert designs[fitted.check]["runs"] >= 60


@pytest.mark.parametrize(
    ("budget", "inputs", "planned"),
    [
        (10, 3, {"monte_carlo": 10}),
        (99, 3, {"monte_carlo": 99}),
        (159, 3, {"latin_hypercube": 150}),
        (160, 3, {"latin_hypercube": 100, "monte_carlo": 60}),
        (500, 3, {"latin_hypercube": 410, "monte_carlo": 90}),
        (500, 50, {"latin_hypercube": 500}),
        (1024, 3, {"latin_hypercube": 850, "monte_carlo": 174}),
        (1025, 3, {"sobol_sequence": 1024}),
        (10**6, 3, {"sobol_sequence": 983040}),
    ],
)
def test_the_plan_follows_its_table(budget, inputs, planned):
    plan = plan_runs(budget, inputs)
    assert {name: each["runs"] for name, each in _settings(plan, "designs").items()} == planned


def test_an_archive_has_the_plan_in_its_study_and_is_repeated_to_the_byte(command_line, tmp_path):
    fixed = ISHIGAMI.replace("x2 = { uniform = { lower = -3, upper = 3 } }", "x2 = 1")
    fixed = fixed.replace("x3 = { uniform = { lower = -3, upper = 3 } }", "x3 = 1")
    (tmp_path / "a.toml").write_text(fixed)
    said = "latin-hypercube, 140 runs: to fit a surrogate (10 or more per input)"
    assert f"planned: {said}" in command_line("check", "a.toml").out
    assert f"planned: {said}" in command_line("study", "a.toml", "-q").err
    first = Path("archives/a.nc").read_bytes()
    assert "nothing has changed" in command_line("study", "a.toml").err
    command_line("study", "a.toml", "--fresh", "-q")
    assert Path("archives/a.nc").read_bytes() == first
    assert command_line("verify", "archives/a.nc").code == 0
    text = str(uqpen.open_archive("archives/a.nc").attrs["study_text"])
    assert "\n# budget = 200  # of runs\n" in text
    assert f"\n# {said}\n[designs.latin_hypercube]\n" in text
    explicit = parse_study(text, folder=tmp_path)
    assert explicit.designs == parse_study(fixed, folder=tmp_path).designs
    assert (explicit.text, explicit.plan) == (text, ())


@pytest.mark.parametrize(
    "text",
    [ISHIGAMI.replace("\n", "\r\n"), ISHIGAMI.rstrip(), ISHIGAMI.replace("budget =", "'budget'=")],
)
def test_only_the_budget_becomes_a_comment(text):
    study = parse_study(text)
    before, after = tomllib.loads(text), tomllib.loads(study.text)
    assert after.pop("designs").keys() == study.designs.keys()
    assert after.pop("surrogates", {}).keys() == study.surrogates.keys()
    assert before.pop("budget")
    assert after == before


def test_a_study_in_python_takes_a_budget():
    study = uqpen.Study(
        model=lambda a, b: {"y": a * b}, inputs={"a": "(1 ± 0.1) m", "b": "2 m"},
        outputs={"y": "m2"}, budget=50, seed=1,
    )  # fmt: skip
    assert study.designs == {"monte_carlo": uqpen.MonteCarlo(50)}
    assert study.plan == ("monte-carlo, 50 runs: below 100 runs, its intervals assume least",)
    assert "designs" in tomllib.loads(study.to_toml())
    with pytest.raises(StudyError, match=r"uqpen.Study\(budget=…\)  budget\n    found     9\n"):
        uqpen.Study(model="ishigami", inputs={}, budget=9, seed=1)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (TWO, "no surrogate of several models"),
        (ISHIGAMI + '[constraints]\nkeep = ["x1 > x2"]\n', "no surrogate with constraints"),
        (
            ISHIGAMI + '[dependence]\ncopula = "frank"\ninputs = ["x1", "x2"]\ntheta = 2\n',
            "no surrogate of dependent inputs",
        ),
    ],
)
def test_no_surrogate_is_planned_where_none_fits(text, reason):
    study = parse_study(text)
    assert study.surrogates == {}
    assert study.runs == 200
    assert reason in study.plan[0]


FIXED = ISHIGAMI.partition("[inputs]")[0] + "[inputs]\nx1 = 1\nx2 = 1\nx3 = 1\n"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (ISHIGAMI.replace("200", "9"), "9"),
        (ISHIGAMI.replace("200", "2.5"), "2.5"),
        (TWO.replace("200", "19"), "19 runs of 2 models"),
        (FIXED, "a plan of runs over inputs that are all fixed"),
        (ISHIGAMI + "[designs.a]\nkind = 'monte-carlo'\nruns = 5\n", "200 beside [designs]"),
        (
            ISHIGAMI + "[surrogates.a]\nkind = 'polynomial-chaos'\ndesign = 'x'\n",
            "200 beside [surrogates]",
        ),
        ("seed = 1\nbudget = 20\n[model]\ndata = 'a.csv'\noutputs = ['y']\n", "20 runs to make"),
    ],
)
def test_a_budget_that_cannot_be_planned_is_reported_with_its_line(text, found, tmp_path):
    (tmp_path / "a.csv").write_text("x,y\n1,2\n2,3\n")
    with pytest.raises(StudyError) as reported:
        parse_study(text, folder=tmp_path)
    assert (
        f": 1 mistake; nothing was run\n\n  study.toml:2  budget\n    found     {found}\n"
        in str(reported.value)
    )
