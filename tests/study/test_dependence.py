"""``[dependence]`` and measured inputs, as a study file has them and as its user meets them."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from uqpen import designs
from uqpen.core.errors import StudyError
from uqpen.core.labels import DEPENDENCE, RUNS
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count
from uqpen.designs.design import Design
from uqpen.distributions import COPULAS
from uqpen.distributions.copulas import (
    ClaytonCopula,
    FrankCopula,
    GaussianCopula,
    StudentCopula,
    score_correlation,
)
from uqpen.distributions.measurements import Empirical
from uqpen.distributions.univariate import Lognormal, Normal, Truncated
from uqpen.study.load import parse_study
from uqpen.workflow import run

STUDY = """\
title = "Joined"
seed = 1
[model]
use = "ishigami"
[inputs]
x1 = { uniform = { lower = -3, upper = 3 } }
x2 = { normal = { mean = 0, std = 0.5 } }
x3 = 1
[dependence]
copula = "gaussian"
of = "ranks"
pairs = [ { inputs = ["x2", "x1"], correlation = 0.6 } ]
[designs.mc]
kind = "monte-carlo"
runs = 50
"""

PAIRS = 'of = "ranks"\npairs = [ { inputs = ["x2", "x1"], correlation = 0.6 } ]\n'


def changed(old, new, text=STUDY):
    assert old in text
    return text.replace(old, new)


def reported(text, folder=Path()):
    with pytest.raises(StudyError) as caught:
        parse_study(text, folder=folder)
    return str(caught.value)


def with_three(lines):
    text = changed("x3 = 1", 'x3 = "0.5 ± 0.1"')
    return changed(PAIRS, lines, text)


class TestDependence:
    def test_a_pair_is_a_correlation_of_what_it_says(self):
        score = score_correlation(0.6, "ranks")
        joint = parse_study(STUDY).joint
        assert joint.dependence == GaussianCopula(("x1", "x2"), ((1.0, score), (score, 1.0)))

    def test_pairs_that_are_not_given_have_no_correlation(self):
        text = with_three(
            'of = "normal-scores"\npairs = [ { inputs = ["x1", "x2"], correlation = 0.6 },'
            ' { inputs = ["x3", "x2"], correlation = -0.3 } ]\n'
        )
        matrix = ((1.0, 0.6, 0.0), (0.6, 1.0, -0.3), (0.0, -0.3, 1.0))
        assert parse_study(text).joint.dependence == GaussianCopula(("x1", "x2", "x3"), matrix)

    def test_a_matrix_is_in_the_order_of_its_inputs(self):
        text = with_three(
            'of = "kendall"\ninputs = ["x3", "x1", "x2"]\n'
            "matrix = [[1, 0.5, 0.2], [0.5, 1, 0.1], [0.2, 0.1, 1.0]]\n"
        )
        found = parse_study(text).joint.dependence
        assert isinstance(found, GaussianCopula)
        assert found.inputs == ("x3", "x1", "x2")
        assert found.matrix[0] == (
            1.0,
            score_correlation(0.5, "kendall"),
            score_correlation(0.2, "kendall"),
        )

    @pytest.mark.parametrize(
        ("lines", "expected"),
        [
            ('"clayton"\ninputs = ["x1", "x2"]\ntheta = 2\n', ClaytonCopula(("x1", "x2"), 2)),
            ('"frank"\ninputs = ["x1", "x2"]\ntheta = -2.5\n', FrankCopula(("x1", "x2"), -2.5)),
            (
                '"student"\nof = "t-scores"\ninputs = ["x1", "x2"]\ndegrees = 3\n'
                "matrix = [[1, 0.5], [0.5, 1]]\n",
                StudentCopula(("x1", "x2"), ((1.0, 0.5), (0.5, 1.0)), 3),
            ),
        ],
    )
    def test_other_copulas_have_their_own_parameters(self, lines, expected):
        text = changed('"gaussian"\n' + PAIRS, lines)
        assert parse_study(text).joint.dependence == expected

    def test_the_runs_depend_and_say_so(self):
        tree = run(parse_study(changed("runs = 50", "runs = 4000")))
        runs = tree[f"/{RUNS}/mc"]
        assert runs.attrs[DEPENDENCE].startswith("gaussian copula of x1, x2: ")
        ranks = [np.argsort(np.argsort(runs[name].values)) for name in ("x1", "x2")]
        # The standard error of a rank correlation of 0.6 from 4000 runs is about 0.01.
        assert np.corrcoef(ranks)[0, 1] == pytest.approx(0.6, abs=0.04)

    @pytest.mark.parametrize(
        ("old", "new", "line", "key", "found", "expected"),
        [
            ('"gaussian"', '"gausian"', 10, "copula", '"gausian"', 'did you mean "gaussian"'),
            ('copula = "gaussian"\n', "", 9, "copula", "nothing", f"one of {', '.join(COPULAS)}"),
            ('of = "ranks"\n', "", 9, "of", "nothing", "the kind of the correlations"),
            ('"ranks"', '"values"', 11, "of", '"values"', '"ranks": the ranks (Spearman\'s)'),
            ("correlation = 0.6", "correlation = 1", 12, "pairs[0].correlation", "1", "strictly"),
            (", correlation = 0.6", "", 12, "pairs[0].correlation", "nothing", "strictly between"),
            ("correlation", "corelation", 12, "pairs[0].corelation", "an unknown key", "did you"),
            ('"x2", "x1"', '"x2", "y1"', 12, "pairs[0].inputs[1]", '"y1"', "a random input"),
            ('"x2", "x1"', '"x2", "x3"', 12, "pairs[0].inputs[1]", "that is fixed", "a random"),
            ('"x2", "x1"', '"x2", "x2"', 12, "pairs[0].inputs", "1 of them", "two inputs"),
            ('"x2", "x1"', '"x2"', 12, "pairs[0].inputs", "1 of them", "two inputs"),
            ("0.6 }", '0.6 }, "x"', 12, "pairs[1]", '"x"', "correlation = 0.6"),
            ("0.6 }", '0.6 }, { inputs = ["x1", "x2"], correlation = 0.5 }', 12, "pairs[1].inputs",
             "for the second time", "each pair once"),
            (PAIRS, 'of = "ranks"\n', 9, "", "no correlations", "either pairs = ["),
            ("pairs = [", "matrix = [[1]]\npairs = [", 9, "", "both pairs and matrix", "either"),
            ("[dependence]", "[dependence]\nthetta = 2", 10, "thetta", "an unknown key", "known: "),
        ],
    )  # fmt: skip
    def test_a_mistake_is_reported_with_its_line(self, old, new, line, key, found, expected):
        report = reported(changed(old, new))
        assert f"study.toml:{line}  dependence{'.' * bool(key)}{key}\n" in report
        assert found in report
        assert expected in report

    @pytest.mark.parametrize(
        ("lines", "key", "found", "expected"),
        [
            ("JOINED [1, 0.5]", "matrix[0]", "1", "a row"),
            ('JOINED [[1, "a"], [0.5, 1]]', "matrix[0][1]", '"a"', "a number"),
            ("JOINED [[1, 0.5], [0.4, 1]]", "matrix[1][0]", "0.4", "symmetric"),
            (f"JOINED [[1, 9{'0' * 400}], [1.5, 1]]", "matrix[0][1]", "9", "between -1 and 1"),
            ("matrix = [[1, 0.5], [0.5, 1]]", "inputs", "nothing", "the random inputs"),
            ('inputs = ["x1", "x2", "x3"]\n'
             "matrix = [[1, 0.9, 0.9], [0.9, 1, -0.9], [0.9, -0.9, 1]]", "matrix",
             "the smallest eigenvalue -0.8", "positive definite"),
            ('pairs = [ { inputs = ["x1", "x2"], correlation = 0.9 },'
             ' { inputs = ["x1", "x3"], correlation = 0.9 } ]',
             "pairs", "the smallest eigenvalue -0.2", "positive definite"),
        ],
    )  # fmt: skip
    def test_wrong_correlations_are_reported(self, lines, key, found, expected):
        lines = lines.replace("JOINED", 'inputs = ["x1", "x2"]\nmatrix =')
        report = reported(with_three(f'of = "normal-scores"\n{lines}\n'))
        assert f"dependence.{key}\n" in report
        assert found in report
        assert expected in report

    def test_ranks_may_hold_together_where_their_scores_do_not(self):
        # This matrix has the eigenvalue 0.001 as it stands, and a negative one of the scores.
        lines = (
            'inputs = ["x1", "x2", "x3"]\n'
            "matrix = [[1, -0.4995, -0.4995], [-0.4995, 1, -0.4995], [-0.4995, -0.4995, 1]]\n"
        )
        parse_study(with_three('of = "normal-scores"\n' + lines))
        assert "smallest eigenvalue -0.0" in reported(with_three('of = "ranks"\n' + lines))

    @pytest.mark.parametrize(
        ("lines", "key", "expected"),
        [
            ('"clayton"\ninputs = ["x1", "x2"]\n', "theta", "above 0"),
            (f'"clayton"\ninputs = ["x1", "x2"]\ntheta = 1{"0" * 400}\n', "theta", "below 16"),
            ('"clayton"\ntheta = 1\n', "inputs", "the random inputs that it joins"),
            ('"clayton"\ninputs = ["x1", 3]\ntheta = 1\n', "inputs[1]", "a random input"),
            ('"joe"\ninputs = ["x1", "x2"]\ntheta = 2\nof = "ranks"\n', "of", "known: copula"),
            ('"student"\n' + PAIRS, "of", '"kendall"'),
        ],
    )
    def test_a_wrong_parameter_is_reported(self, lines, key, expected):
        report = reported(changed('"gaussian"\n' + PAIRS, lines))
        assert f"dependence.{key}\n" in report
        assert expected in report

    def test_inputs_that_are_not_understood_are_reported_alone(self):
        report = reported(changed("std = 0.5", "std = 0"))
        assert "1 mistake;" in report
        assert "inputs.x2.normal.std" in report


class TestRowsMeasuredTogether:
    """``[dependence] measured``: a copula fitted to rows of a file."""

    @pytest.fixture
    def rows(self, tmp_path):
        rng = np.random.default_rng(3)
        drawn = rng.multivariate_normal([0, 0], [[1, 0.7], [0.7, 1]], 40)
        lines = [f"{x1:.4f},{x2:.3f},soft" for x1, x2 in drawn]
        lines[7] = ",0.1,soft"
        (tmp_path / "rows.csv").write_text("\n".join(["x1,x2,kind", *lines]) + "\n")
        return tmp_path

    def text(self, lines='measured = "rows.csv"\n'):
        return changed('copula = "gaussian"\n' + PAIRS, lines)

    def test_the_copula_is_fitted_and_said_in_the_archive(self, rows):
        study = parse_study(self.text(), folder=rows)
        one, two = study.joint.dependence.inputs
        assert (one, two) == ("x1", "x2")
        said = run(study)[f"{RUNS}/mc"].attrs[DEPENDENCE]
        assert "fitted to 39 rows of rows.csv (1 row with a blank left out): " in said
        assert "; next by likelihood " in said
        assert [file.path.name for file in study.joint.files] == ["rows.csv"]

    def test_a_copula_may_be_given(self, rows):
        study = parse_study(self.text('measured = "rows.csv"\ncopula = "frank"\n'), folder=rows)
        assert isinstance(study.joint.dependence, FrankCopula)
        assert "next by" not in study.joint.dependence_text

    def test_check_warns_of_one_that_does_not_fit(self, rows, command_line):
        x = np.random.default_rng(1).random(60)
        table = np.column_stack([x, np.abs(x - 0.3)])
        np.savetxt("rows.csv", table, delimiter=",", header="x1,x2", comments="")
        Path("s.toml").write_text(self.text())
        shown = command_line("check", "s.toml").said
        assert "does not fit the rows of rows.csv: of samples of it, a share of 0.005" in shown

    @pytest.mark.parametrize(
        ("lines", "key", "found", "expected"),
        [
            ('measured = "no.csv"\n', "measured", "there is no file", "a CSV or NetCDF file"),
            ('measured = "rows.csv"\ncopula = "jo"\n', "copula", '"jo"', 'did you mean "joe"?'),
            ('measured = "rows.csv"\ninputs = ["x1", "x3"]\n', "inputs[1]",
             '"x3", an input that is fixed', "a random input"),
            ('measured = "rows.csv"\ntheta = 2\n', "theta", "an unknown key",
             "known: measured, inputs, copula"),
        ],
    )  # fmt: skip
    def test_a_mistake_is_reported(self, rows, lines, key, found, expected):
        message = reported(self.text(lines), rows)
        assert f"dependence.{key}" in message
        assert found in message
        assert expected in message


@dataclass(frozen=True)
class Independent(Design):
    """Stands for those whose indices need independent inputs."""

    runs: int = count(default=1)
    assumes_independence = True

    @property
    def sampling(self):
        return Sampling.INDEPENDENT

    def rounds(self, joint, stream):
        yield joint.points(stream.generator().random((self.runs, len(joint.random))), {})

    def run_count(self, joint):
        return self.runs


@pytest.fixture
def _independent_design(monkeypatch):
    monkeypatch.setitem(designs.DESIGNS, "monte-carlo", f"{__name__}:Independent")
    monkeypatch.setitem(sys.modules, __name__, sys.modules[Independent.__module__])


@pytest.mark.usefixtures("_independent_design")
def test_a_design_that_assumes_independence_is_refused_and_what_is_valid_offered():
    report = reported(STUDY)
    assert "study.toml:14  designs.mc.kind\n" in report
    assert '"monte-carlo" with inputs that depend on each other ([dependence])' in report
    assert "split the variance among inputs that vary independently" in report
    for valid in ("sobol-sequence", "first-order", "delta", "Shapley"):
        assert valid in report


@pytest.mark.usefixtures("_independent_design")
def test_over_independent_inputs_it_is_not():
    text = STUDY[: STUDY.index("[dependence]")] + STUDY[STUDY.index("[designs") :]
    assert parse_study(text).runs == 50


MEASURED = """\
title = "Measured"
seed = 1
[model]
use = "ishigami"
[inputs]
x1 = { measured = { file = "m.csv", column = "strength [%]" } }
x2 = 1
x3 = 1
[designs.mc]
kind = "monte-carlo"
runs = 50
"""


@pytest.fixture
def folder(tmp_path):
    # Quantiles of a lognormal law: they fit it well, and a uniform law badly.
    scores = [-1.96, -1.44, -1.15, -0.93, -0.76, -0.6, -0.45, -0.32, -0.19, -0.06]
    values = [round(50 * float(np.exp(0.5 * z)), 3) for z in scores + [-z for z in scores]]
    lines = [f"specimen {number},{value}" for number, value in enumerate(values)]
    (tmp_path / "m.csv").write_text("\n".join(["name,strength [%]", *lines]))
    return tmp_path


def random_input(text, folder):
    (entry,) = parse_study(text, folder=folder).joint.random
    return entry


class TestMeasured:
    def test_measurements_are_a_law_by_themselves(self, folder):
        entry = random_input(MEASURED, folder)
        assert isinstance(entry.distribution, Empirical)
        assert len(entry.distribution.measurements) == 20
        assert entry.nominal == pytest.approx(0.5, abs=0.001)
        assert entry.display_unit == "%"
        assert entry.description == (
            "as measured: 20 values of m.csv, strength [%], from 18.77 % to 133.2 %"
        )
        assert entry.fit["fit_family"] == "empirical"
        assert entry.fit["fit_measurements"] == 20

    def test_a_family_is_fitted_to_them(self, folder):
        text = changed('"strength [%]"', '"strength [%]", family = "lognormal"', MEASURED)
        entry = random_input(text, folder)
        assert isinstance(entry.distribution, Lognormal)
        assert entry.distribution.median == pytest.approx(0.5, abs=0.001)
        assert entry.fit["fit_mean"] == entry.distribution.mean
        assert entry.fit["fit_statistic"] < 0.1  # type: ignore[operator]
        assert entry.fit["fit_p_value"] > 0.5  # type: ignore[operator]
        assert "fit_warning" not in entry.fit
        assert "lognormal fitted to 20 values of m.csv, strength [%]: mean 5" in entry.description
        assert "Kolmogorov-Smirnov distance 0." in entry.description

    def test_truncation_is_as_of_any_law(self, folder):
        text = changed("} }", '}, lower = "30 %", upper = 0.9 }', MEASURED)
        entry = random_input(text, folder)
        assert isinstance(entry.distribution, Truncated)
        assert (entry.distribution.lower, entry.distribution.upper) == (0.3, 0.9)
        assert entry.description.endswith("; at least 30 %; at most 0.9")

    def test_the_archive_keeps_how_well_it_fits(self, folder):
        text = changed('"strength [%]"', '"strength [%]", family = "uniform"', MEASURED)
        runs = run(parse_study(text, folder=folder))[f"/{RUNS}/mc"]
        attributes = runs["x1"].attrs
        assert attributes["fit_family"] == "uniform"
        assert attributes["fit_p_value"] < 0.05
        assert attributes["fit_warning"].startswith("uniform does not fit")
        assert attributes["fit_source"] == "m.csv, strength [%]"
        assert attributes["units"] == "1"

    def test_another_inputs_fit_changes_nothing(self, folder):
        text = changed('"strength [%]"', '"strength [%]", family = "normal"', MEASURED)
        both = changed(
            "x2 = 1", 'x2 = { measured = { file = "m.csv", column = "strength" } }', text
        )
        alone = random_input(text, folder)
        first, _ = parse_study(both, folder=folder).joint.random
        assert first == alone
        assert isinstance(alone.distribution, Normal)

    @pytest.mark.parametrize(
        ("old", "new", "key", "found", "expected"),
        [
            ('file = "m.csv", ', "", "file", "nothing", "the path of a file"),
            ("m.csv", "absent.csv", "file", "there is no file", "a CSV or NetCDF file"),
            ("m.csv", "\\u0000", "file", "\\u0000", "the path of a file"),
            ("strength [%]", "strenght", "column", "no column", 'did you mean "strength [%]"'),
            (', column = "strength [%]"', "", "column", "has the columns name, str", "the heading"),
            ("strength [%]", "name", "column", '"specimen 0"', "a number"),
            ("column =", "colunm =", "colunm", "an unknown key", 'did you mean "column"'),
            ('[%]"', '[%]", family = "norml"', "family", '"norml"', 'did you mean "normal"'),
            ('[%]"', '[%]", family = "beta"', "family", "which is not fitted", "one of normal"),
            ('[%]"', '[%]", family = 3', "family", "3", "the name of a distribution"),
        ],
    )
    def test_a_mistake_is_reported_with_its_line(self, folder, old, new, key, found, expected):
        report = reported(changed(old, new, MEASURED), folder)
        assert f"study.toml:6  inputs.x1.measured.{key}\n" in report
        assert found in report
        assert expected in report

    @pytest.mark.parametrize(
        ("content", "family", "found", "expected"),
        [
            ("strength [%]\n" + "1\n" * 9, "", "9 measurements in m.csv", "at least 10"),
            ("strength [%]\n" + "1\n" * 4, "normal", "4 measurements in m.csv", "at least 5"),
            ("strength [%]\n" + "1\n" * 12, "", "that are all the same", "some that differ"),
            ("strength [%]\n1\nx\n", "", 'line 3, column "strength": found "x"', "a number"),
            ("strength [kg]\n1\n", "", 'is in "kg"', 'of numbers, with its unit: "strength [1]"'),
            ("strength [%]\n400\n" + "1\n" * 12, "", "400 % as measurement 1", "3.14159"),
            ("strength [%]\n-2\n1\n2\n3\n4\n", "gamma", "a measurement of -0.02", "above 0"),
        ],
    )
    def test_measurements_that_will_not_do_are_reported(
        self, folder, content, family, found, expected
    ):
        (folder / "m.csv").write_text(content)
        text = changed("strength [%]", "strength", MEASURED)
        if family:
            text = changed('"strength"', f'"strength", family = "{family}"', text)
        report = reported(text, folder)
        assert found in report
        assert expected in report


def test_check_shows_the_dependence_and_warns_of_a_bad_fit(command_line, folder):
    text = changed('"strength [%]"', '"strength [%]", family = "uniform"', MEASURED)
    for study, shown in (
        (STUDY, "gaussian copula of x1, x2: correlation of normal scores: x1 and x2 0.618"),
        (text, "uniform fitted to 20 values of m.csv, strength [%]: lower 18.77 %"),
        (text, "warning: x1: uniform does not fit the measurements"),
    ):
        (folder / "study.toml").write_text(study, encoding="utf-8")
        assert shown in command_line("check", "study.toml").said
