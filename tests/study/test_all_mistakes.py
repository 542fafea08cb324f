"""Mistakes of all sections of a study file are reported at once, and none that only follows."""

import pytest

from uqpen.core.errors import StudyError
from uqpen.study.load import parse_study

MODEL = """\
[model]
python = "line.py:f"
[model.inputs]
a = "m"
b = "kg"
[model.outputs]
y = "m"
"""
OTHERS = """\
[inputs]
a = "(2 ± 0.1) m"
b = { uniform = { lower = "2 kg", upper = "1 kg" } }
[dependence]
copula = "gaussian"
of = "ranks"
pairs = [{ inputs = ["a", "b"], correlation = 2 }]
[constraints]
keep = ["a >"]
[outputs.y]
quantiles = [2]
[designs.mc]
kind = "monte-carlo"
runs = 0
[surrogates.chaos]
kind = "polynomial-chaos"
design = "mk"
[published.paper]
source = "A paper"
[published.paper.y]
mean = "3 blorbs"
[failures]
retry = -1
"""
KEYS = [
    "inputs.b.uniform.upper",
    "dependence.pairs[0].correlation",
    "constraints.keep[0]",
    "outputs.y.quantiles[0]",
    "designs.mc.runs",
    "surrogates.chaos.design",
    "published.paper.y.mean",
    "failures.retry",
]

RIGHT = """\
[inputs]
a = "(2 ± 0.1) m"
b = { uniform = { lower = "1 kg", upper = "2 kg" }, lower = "1.1 kg" }
[dependence]
copula = "gaussian"
of = "ranks"
pairs = [{ inputs = ["a", "b"], correlation = 0.5 }]
[constraints]
keep = ["a * b > '1 kg m'", "c > a"]
[outputs.y]
unit = "cm"
exceeds = ["2 m"]
[designs.mc]
kind = "monte-carlo"
runs = 10
[surrogates.chaos]
kind = "polynomial-chaos"
design = "mc"
transform = { y = "log" }
[published.paper]
source = "A paper"
[published.paper.y]
mean = "3 m"
response = { a = 0.4 }
largest_contribution = "b"
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "line.py").write_text("def f(a, b):\n    return {'y': a}\n")
    return tmp_path


def keys(text, folder):
    with pytest.raises(StudyError) as caught:
        parse_study(f"seed = 1\n{text}", folder=folder)
    return [problem.key for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("model", "key"),
    [
        (MODEL, None),
        ("", "model"),
        ('[model]\nuse = "ishigamy"\n', "model.use"),
        ("[model]\n", "model"),
        (MODEL.replace("line.py:f", "absent.py:f"), "model.python"),
        (MODEL.replace("line.py:f", "line.py:g"), "model.python"),
        (MODEL.replace('"kg"', '"kgg"'), "model.inputs.b"),
        (MODEL.replace('y = "m"', "y = 3"), "model.outputs.y"),
        (MODEL.replace('line.py:f"', 'line.py:f"\ntime_limit = "-1 s"'), "model.time_limit"),
        (MODEL.replace('line.py:f"', 'line.py:f"\nvectorised = true'), "model.vectorised"),
        (MODEL.replace('line.py:f"', 'line.py:f"\nuse = "ishigami"'), "model"),
        ("model = 3\n", "model"),
    ],
)
def test_one_mistake_in_each_section_is_reported(folder, model, key):
    assert keys(model + OTHERS, folder) == ([] if key is None else [key]) + KEYS


def test_a_mistake_has_line_found_and_expected_though_the_model_is_unknown(folder):
    with pytest.raises(StudyError) as caught:
        parse_study(f'seed = 1\n[model]\nuse = "ishigamy"\n{OTHERS}', folder=folder)
    reported = str(caught.value)
    assert "9 mistakes" in reported
    assert (
        '  study.toml:6  inputs.b.uniform.upper\n    found     "1 kg"\n    expected  ' in reported
    )


@pytest.mark.parametrize(
    "model",
    ["", '[model]\nuse = "ishigamy"\n', "[model]\n", "model = 3\n", "[models.a]\nuse = 3\n"],
)
def test_nothing_follows_from_an_unknown_model(folder, model):
    reported = keys(model + RIGHT, folder)
    assert len(reported) == 1
    assert reported[0].startswith("model")


def test_no_key_of_a_publication_is_taken_for_an_output_of_an_unknown_model(folder):
    text = (
        RIGHT
        + """
[published.other]
source = "Another paper"
runs = 100
magnitudes = true
uncertainties = { d = "5.0 %" }
[published.other.readings.longer]
inputs = { a = "(3 ± 0.1) m" }
"""
    )
    assert keys('[model]\nuse = "ishigamy"\n' + text, folder) == ["model.use"]


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('a = "(2 ± 0.1) m"\n', "", "inputs.a"),
        ('a = "(2 ± 0.1) m"\n', 'aa = "(2 ± 0.1) m"\n', "inputs.aa"),
        ('a = "(2 ± 0.1) m"\n', 'a = "(2 ± 0.1) s"\n', "inputs.a"),
        ('copula = "gaussian"', 'copula = "gausian"', "dependence.copula"),
        ('kind = "monte-carlo"', 'kind = "monte"', "designs.mc.kind"),
        ('[designs.mc]\nkind = "monte-carlo"\nruns = 10\n', "", "designs"),
    ],
)
def test_nothing_follows_from_a_mistake_in_another_section(folder, old, new, key):
    right = RIGHT.replace(', "c > a"', "")
    assert old in right
    parse_study(f"seed = 1\n{MODEL}{right}", folder=folder)
    assert keys(MODEL + right.replace(old, new), folder) == [key]


def test_inputs_and_outputs_are_checked_though_the_function_cannot_be_loaded(folder):
    right = RIGHT.replace(', "c > a"', "").replace("(2 ± 0.1) m", "(2 ± 0.1) s")
    model = MODEL.replace("line.py:f", "absent.py:f")
    reported = keys(model + right.replace('"cm"', '"kg"'), folder)
    assert reported == ["model.python", "inputs.a", "outputs.y.unit"]


def test_no_dimension_is_guessed_where_quantities_differ(folder):
    right = RIGHT.replace('lower = "1 kg", upper', 'lower = "3 m", upper')
    assert keys('[model]\nuse = "ishigamy"\n' + right, folder) == ["model.use"]


def test_a_mistake_in_the_first_of_several_models_hides_none_of_the_second(folder):
    models = """\
[models.one]
use = "ishigami"
b = "wrong"
[models.two]
use = "ishigami"
with = { x1 = "1 m" }
[inputs]
x1 = 1
x2 = "2 m"
x3 = { uniform = { lower = -3, upper = 3 } }
[designs.mc]
kind = "monte-carlo"
runs = 10
"""
    assert keys(models, folder) == ["models.one.b", "models.two.with.x1", "inputs.x2"]


def test_a_value_out_of_range_is_reported_beside_one_of_another_type(folder):
    failures = '[failures]\nretry = -1\nat_most = "5 kg"\n'
    right = RIGHT.replace(', "c > a"', "").replace("runs = 10", "runs = 0\nseed = 1")
    assert keys(MODEL + right + failures, folder) == [
        "designs.mc.runs",
        "designs.mc.seed",
        "failures.retry",
        "failures.at_most",
    ]
    failures = "[failures]\nretry = 101\nat_most = 1.5\n"
    assert keys(MODEL + RIGHT.replace(', "c > a"', "") + failures, folder) == [
        "failures.retry",
        "failures.at_most",
    ]


JOINT = """\
[model]
python = "line.py:f"
[joint.both]
inputs = ["a", "b"]
chaospy = { name = "MvNormal", mu = [1, 2], sigma = [[1, 0], [0, 1]] }
[designs.mc]
kind = "monte-carlo"
runs = 9
"""


def test_inputs_of_a_joint_distribution_follow_no_missing_table(tmp_path):
    with pytest.raises(StudyError) as caught:
        parse_study(f"seed = 1\n{JOINT}", folder=tmp_path)
    assert [".".join(map(str, each.path)) for each in caught.value.problems] == [
        "model.inputs",
        "model.outputs",
    ]


def test_a_list_in_place_of_a_section_is_one_mistake():
    with pytest.raises(StudyError) as caught:
        parse_study('seed = 1\ninputs = ["x"]\ndesigns = []\n[model]\nuse = "ishigami"\n')
    assert [str(each) for each in caught.value.problems] == [
        'inputs: found ["x"]; expected an [inputs] table',
        "designs: found an empty list; expected at least one [designs.<name>]",
    ]
