"""Inputs whose values are labels: what each method does with them, or why it refuses."""

import numpy as np
import pytest
from click.testing import CliRunner

import uqpen
from uqpen.cli.main import uqpen as command
from uqpen.statistics import texts
from uqpen.study.identity import model_identity

FUNCTION = """import numpy as np
SIZES = {"M8": 8.0, "M10": 10.0, "M 12": 12.0, "8": 7.0, "größe": 5.0}
def f(bolt, load):
    assert all(isinstance(each, str) for each in bolt)
    return {"y": load / np.array([SIZES[each] for each in bolt])}
"""
DESIGNS = '[designs.mc]\nkind = "monte-carlo"\nruns = 400'
CHOICE = '{ choice = { labels = ["M8", "M10"], weights = [3, 1] } }'


def study(folder, designs=DESIGNS, bolt=CHOICE, labels='["M8", "M10"]', extra=""):
    (folder / "m.py").write_text(FUNCTION, encoding="utf-8")
    text = (
        'seed = 1\n[model]\npython = "m.py:f"\nvectorized = true\n[model.labels]\n'
        f'bolt = {labels}\n[model.inputs]\nload = "1"\n[model.outputs]\ny = "1"\n[inputs]\n'
        f'bolt = {bolt}\nload = "10 ± 1"\n{extra}\n[outputs.y]\nexceeds = ["1.2"]\n{designs}\n'
    )
    return uqpen.parse_study(text, folder=folder)


class TestExactAnswers:
    """A load of N(10, 1) on a bolt of 8 mm (0.75) or 10 mm."""

    def test_a_probability_and_indices(self, tmp_path):
        designs = (
            '[designs.mc]\nkind = "monte-carlo"\nruns = 4000\n'
            '[designs.blocks]\nkind = "saltelli"\nbase = 2048'
        )
        tree = uqpen.run(study(tmp_path, designs))
        for design in ("mc", "blocks"):
            _, lower, upper = tree[f"statistics/{design}/y"]["exceedance"].values.ravel()
            assert lower < 0.4972538394 < upper
        blocks = tree["statistics/blocks/y"]
        exact = {
            "first_order": {"bolt": 0.4518072, "load": 0.5436747},
            "total_order": {"bolt": 0.4563253},
        }
        for name, indices in exact.items():
            for each, value in indices.items():
                _, lower, upper = blocks[name].sel(input=each).values.ravel()
                assert lower < value < upper
        first = tree["statistics/mc/y"]["first_order"].sel(input="bolt").values
        assert first[0] == pytest.approx(0.4518072, abs=0.03)

    def test_the_share_of_each_label_is_its_weight(self, tmp_path):
        designs = '[designs.lhs]\nkind = "latin-hypercube"\nruns = 400\nreplicates = 1'
        runs = uqpen.run(study(tmp_path, designs))["runs/lhs"]
        assert np.bincount(runs["bolt"].values.astype(int)).tolist() == [300, 100]


def test_reordered_labels_change_no_number(tmp_path):
    three = '["M8", "M10", "M 12"]'
    one = uqpen.run(study(tmp_path, labels=three))
    bolt = '{ choice = { labels = ["M10", "M8"], weights = [1, 3] } }'
    other = uqpen.run(study(tmp_path, bolt=bolt, labels=three))
    for group in ("runs/mc", "statistics/mc/y"):
        for name, values in one[group].data_vars.items():
            np.testing.assert_array_equal(other[group][name].values, values.values)
    first, second = (
        model_identity(study(tmp_path, labels=each), "").fingerprint
        for each in (three, '["M10", "M8", "M 12"]')
    )
    assert first != second


def test_the_archive_has_codes_and_their_meanings(tmp_path):
    labels = '["8", "M 12", "größe"]'
    bolt = '{ choice = { labels = ["größe", "8", "M 12"] } }'
    runs = uqpen.run(study(tmp_path, bolt=bolt, labels=labels))["runs/mc"]
    attributes = runs["bolt"].attrs
    assert attributes["code_labels"] == ["8", "M 12", "größe"]
    assert attributes["flag_values"].tolist() == [0, 1, 2]
    assert attributes["flag_meanings"] == "8_0 M_12_1 größe_2"
    sizes = np.array([7.0, 12.0, 5.0])[runs["bolt"].values.astype(int)]
    np.testing.assert_allclose(runs["y"], runs["load"] / sizes)


@pytest.mark.parametrize(
    ("design", "reason"),
    [
        ('"one-at-a-time"', "no step leads from one label to another"),
        ('"morris"\ntrajectories = 4', "no step leads from one label to another"),
        ('"quadrature"\norder = 1', "labels have no moments"),
        ('"form"\nevent = "y > 1.2"', "no step leads from one label to another"),
        ('"active-learning"\nevent = "y > 1.2"', "no step leads from one label to another"),
    ],
)
def test_a_method_that_needs_an_order_is_refused(design, reason, tmp_path):
    with pytest.raises(uqpen.StudyError, match="over bolt, whose values are labels") as caught:
        study(tmp_path, f"[designs.d]\nkind = {design}")
    assert reason in str(caught.value)


@pytest.mark.parametrize(
    "design",
    [
        '"sobol-sequence"\nruns = 256',
        '"halton"\nruns = 208',
        '"subset-simulation"\nevent = "y > 1.4"\nsamples = 200',
        '"importance-sampling"\nevent = "y > 1.4"\nsamples = 200',
    ],
)
def test_a_method_without_an_order_takes_labels(design, tmp_path):
    made = study(tmp_path, f"[designs.d]\nkind = {design}")
    assert {*np.unique(uqpen.run(made)["runs/d"]["bolt"])} == {0.0, 1.0}


def test_measures_that_need_an_order_say_so(tmp_path):
    statistics = uqpen.run(study(tmp_path))["statistics/mc/y"]
    for name in ("pearson", "spearman", "partial", "partial_rank"):
        assert np.isnan(statistics[name].sel(input="bolt", bound="estimate"))
        assert np.isfinite(statistics[name].sel(input="load", bound="estimate"))
        assert texts.CODES_WITHOUT_ORDER in statistics[f"{name}_interval"].attrs["flag_note"]
    for name in ("first_order", "delta"):
        assert np.isfinite(statistics[name].sel(input="bolt", bound="estimate"))


def test_the_nominal_label_is_the_likeliest_and_one_may_be_fixed(tmp_path):
    bolt = '{ choice = { labels = ["M8", "M10"], weights = [1, 3] } }'
    assert study(tmp_path, bolt=bolt).joint.nominal()["bolt"] == 1.0
    bolt = '{ choice = { labels = ["M10", "M8"] } }'
    assert study(tmp_path, bolt=bolt).joint.nominal()["bolt"] == 0.0  # the first of several
    fixed = study(tmp_path, bolt='"M10"')
    assert [entry.variable.name for entry in fixed.joint.random] == ["load"]
    assert float(uqpen.run(fixed)["runs/mc"]["bolt"]) == 1.0


@pytest.mark.parametrize(
    ("bolt", "labels", "expected"),
    [
        ('"M9"', '["M8", "M10"]', "a label of bolt; known: M8, M10"),
        ("8", '["M8", "M10"]', "a label of bolt"),
        ('{ choice = { labels = ["M8", "M9"] } }', '["M8", "M10"]', "a label of bolt"),
        ('{ choice = { labels = ["M8"] } }', '["M8", "M10"]', "two or more, each once"),
        ('{ choice = { labels = ["M8", "M10"], weights = [1] } }', '["M8", "M10"]', "one for each"),
        ("{ choice = { labels = [8, 10] } }", '["M8", "M10"]', "labels in a list"),
        (f"{CHOICE[:-2]}, lower = 1 }}", '["M8", "M10"]', "its values within them alone"),
        ("{ normal = { mean = 1, std = 1 } }", '["M8", "M10"]', "labels have no mean and no unit"),
        ("{ mixture = [] }", '["M8", "M10"]', "labels have no mean and no unit"),
        (CHOICE, '["M8"]', "two texts or more, each once"),
        (CHOICE, "[8, 10]", "two texts or more, each once"),
    ],
)
def test_mistakes_are_met(bolt, labels, expected, tmp_path):
    with pytest.raises(uqpen.StudyError) as caught:
        study(tmp_path, bolt=bolt, labels=labels)
    assert expected in str(caught.value)
    assert "study.toml:" in str(caught.value)


@pytest.mark.parametrize(
    "text", ['[constraints]\nkeep = ["bolt > 0"]', '[constraints]\nkeep = ["load > 2 * bolt"]']
)
def test_no_formula_has_the_codes(text, tmp_path):
    with pytest.raises(uqpen.StudyError, match="an input of the model; known: load"):
        study(tmp_path, extra=text)


def test_a_choice_of_an_input_with_numbers_is_told_of_both_ways(study_of):
    with pytest.raises(uqpen.StudyError) as caught:
        study_of("x", x=CHOICE)
    assert '[model.labels] x = ["M8", "M10"]' in str(caught.value)
    assert "such as 8 mm, are discrete" in str(caught.value)


def test_a_unit_of_labels_is_refused(tmp_path):
    (tmp_path / "m.py").write_text("def f(bolt):\n    return {'y': 1.0}\n")
    with pytest.raises(uqpen.StudyError, match="labels of an input in mm"):
        uqpen.parse_study(
            'seed = 1\n[model]\npython = "m.py:f"\n[model.labels]\nbolt = ["M8", "M10"]\n'
            '[model.inputs]\nbolt = "mm"\n[model.outputs]\ny = "1"\n[inputs]\nbolt = "M8"\n'
            "[designs.mc]\nkind = 'monte-carlo'\nruns = 10",
            folder=tmp_path,
        )


def test_a_study_in_python_has_labels(tmp_path):
    made = uqpen.Study(
        model=lambda bolt, load: {"y": load / {"8 mm": 8.0, "10 mm": 10.0}[bolt]},
        inputs={"bolt": uqpen.Choice(["8 mm", "10 mm"], [3, 1]), "load": uqpen.Normal(10, 1)},
        outputs={"y": "1"},
        designs={"mc": uqpen.MonteCarlo(runs=50)},
        seed=1,
    )
    runs = uqpen.run(made)["runs/mc"]
    np.testing.assert_allclose(
        runs["y"], runs["load"] / np.array([8, 10])[runs["bolt"].astype(int)]
    )


def test_init_reads_literals_and_the_command_line_has_labels(tmp_path, monkeypatch):
    source = (
        "from typing import Annotated, Literal\n"
        'def f(bolt: Literal["M8", "M10"], load: Annotated[float, "kN"] = 10.0):\n'
        '    return {"y": load / {"M8": 8.0, "M10": 10.0}[bolt]}\n'
    )
    (tmp_path / "m.py").write_text(source)
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        result = CliRunner().invoke(command, arguments, catch_exceptions=False)
        assert result.exit_code == 0, result.output
        return result.output

    call("init", "m.py:f", "-o", "s.toml")
    text = (tmp_path / "s.toml").read_text()
    assert "[model.labels]" in text
    assert 'bolt = { choice = { labels = ["M8", "M10"] } }' in text
    assert "choice: labels" in call("check", "s.toml")
    assert " 1.25 " in call("run", "s.toml")
    assert " 1.25 " not in call("run", "s.toml", "--set", "bolt=M10")
    call("study", "s.toml", "-o", "a.nc")
    call("verify", "a.nc")
    exported = call("export", "a.nc", "--runs")
    assert ",M10," in exported
    call("report", "a.nc", "-o", "a.html")
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert '"ticktext": ["M8", "M10"]' in page or '"ticktext":["M8","M10"]' in page


@pytest.mark.slow
def test_a_program_gets_the_text_in_its_file_and_its_arguments(tmp_path):
    solver = tmp_path / "solver.sh"
    solver.write_text('#!/bin/sh\nprintf "result = %s" "$(wc -c < in.txt)"\nprintf "\\n%s" "$1"\n')
    solver.chmod(0o755)
    (tmp_path / "in.txt.template").write_text("{bolt}")
    made = uqpen.parse_study(
        'seed = 1\n[model]\ncommand = ["./solver.sh", "{bolt}"]\n[model.templates]\n'
        '"in.txt" = "in.txt.template"\n[model.labels]\nbolt = ["a b", "größe"]\n'
        '[model.outputs]\nsize = "1"\n[model.read]\n'
        "size = { text = \"stdout\", pattern = 'result = *(\\S+)' }\n"
        '[inputs]\nbolt = { choice = { labels = ["größe", "a b"] } }\n'
        "[designs.mc]\nkind = 'monte-carlo'\nruns = 6",
        folder=tmp_path,
    )
    runs = uqpen.run(made)["runs/mc"]
    assert (runs["status"] == 0).all()
    assert runs["size"].values.tolist() == [
        3.0 if code == 0 else 7.0 for code in runs["bolt"].values
    ]


def test_labels_are_joined_by_no_copula(tmp_path):
    extra = '[dependence]\ncopula = "clayton"\ninputs = ["bolt", "load"]\ntheta = 2'
    with pytest.raises(uqpen.StudyError, match="labels have no order that a copula could join"):
        study(tmp_path, extra=extra)
