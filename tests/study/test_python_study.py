"""A study made from Python objects is the study that a file of the same content is."""

import tomllib

import chaospy
import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

import uqpen
from uqpen.cli.verify import rerun
from uqpen.core.errors import ModelError
from uqpen.execution import Progress
from uqpen.study.study import ValidatedStudy

FILE = """\
title = "Area"
seed = 7

[model]
python = "area.py:area"
inputs = { length = "m", width = "cm" }
outputs = { area = "m2" }

[inputs]
length = { normal = { mean = "2 m", std = "0.1 m" }, lower = "1.8 m" }
width = "(30 ± 2) cm"

[dependence]
copula = "gaussian"
of = "normal-scores"
inputs = ["length", "width"]
matrix = [[1, 0.5], [0.5, 1]]

[constraints]
keep = ["length > width"]

[outputs.area]
unit = "m2"
exceeds = ["0.6 m2"]
quantiles = [0.99]
hold = [0.9]

[designs.mc]
kind = "monte-carlo"
runs = 60

[designs.lhs]
kind = "latin-hypercube"
runs = 60

[surrogates.pce]
kind = "polynomial-chaos"
design = "lhs"
order = 2

[failures]
at_most = "5 %"
"""

MODEL = """\
def area(length, width):
    return {"area": length * width / 100}
"""


def area(length, width):
    return {"area": length * width / 100}


def arguments(**changes):
    return {
        "title": "Area",
        "seed": 7,
        "model": area,
        "inputs": {
            "length": uqpen.Truncated(uqpen.Normal("2 m", std="0.1 m"), lower="1.8 m"),
            "width": "(30 ± 2) cm",
        },
        "dependence": uqpen.GaussianCopula(("length", "width"), ((1, 0.5), (0.5, 1))),
        "constraints": ["length > width"],
        "outputs": {
            "area": uqpen.OutputSpec("m2", exceeds=["0.6 m2"], quantiles=[0.99], hold=[0.9])
        },
        "designs": {"mc": uqpen.MonteCarlo(runs=60), "lhs": uqpen.LatinHypercube(runs=60)},
        "surrogates": {"pce": uqpen.PolynomialChaos(design="lhs", order=2)},
        "failures": uqpen.FailurePolicy(at_most="5 %"),
        **changes,
    }


def made(**changes):
    return uqpen.Study(**arguments(**changes))


def message(**changes):
    with pytest.raises(uqpen.StudyError) as caught:
        made(**changes)
    return str(caught.value)


class TestSameContent:
    @pytest.mark.slow
    def test_its_archive_has_the_same_groups_as_that_of_a_file(self, tmp_path):
        (tmp_path / "area.py").write_text(MODEL)
        (tmp_path / "study.toml").write_text(FILE)
        of_file = uqpen.run(uqpen.load_study(tmp_path / "study.toml"))
        of_objects = uqpen.run(made())
        groups = {node.path for node in of_file.subtree} - {"/", "/files"}
        assert groups == {node.path for node in of_objects.subtree} - {"/"}
        for path in sorted(groups):
            one, other = of_file[path].to_dataset(), of_objects[path].to_dataset()
            assert one.identical(other), path

    def test_its_text_is_a_study_that_reads_the_same(self):
        study = made()
        content = tomllib.loads(study.to_toml())
        assert content["inputs"]["length"] == {
            "lower": "1.8 m",
            "normal": {"mean": "2 m", "std": "0.1 m"},
        }
        assert content["failures"] == {"at_most": "5 %"}
        again = uqpen.parse_study(study.to_toml(), objects={("model",): area})
        assert again.joint == study.joint
        assert again.quantities_of_interest == study.quantities_of_interest
        assert (again.designs, again.surrogates) == (study.designs, study.surrogates)

    @pytest.mark.parametrize(
        "copula",
        [
            uqpen.ClaytonCopula(("length", "width"), 2.0),
            uqpen.FrankCopula(("length", "width"), -3.0),
            uqpen.GumbelCopula(("length", "width"), 2.0),
            uqpen.JoeCopula(("length", "width"), 1.5),
        ],
        ids=lambda copula: type(copula).__name__,
    )
    def test_any_copula_joins_the_inputs_that_it_names(self, copula):
        study = made(dependence=copula)
        assert study.joint.dependence == copula
        assert uqpen.parse_study(study.to_toml(), objects={("model",): area}).joint == study.joint

    def test_a_study_from_a_file_has_the_same_class(self, tmp_path):
        (tmp_path / "area.py").write_text(MODEL)
        (tmp_path / "study.toml").write_text(FILE)
        study = uqpen.load_study(tmp_path / "study.toml")
        assert isinstance(study, uqpen.Study)
        assert isinstance(study, ValidatedStudy)
        assert study.to_toml() == FILE

    @pytest.mark.parametrize("use", ["ishigami", {"use": "ishigami"}, uqpen.Ishigami()])
    def test_a_built_in_model_is_named_or_an_object(self, use):
        spread = {name: uqpen.Uniform(-3.0, 3.0) for name in ("x1", "x2", "x3")}
        study = made(model=use, inputs=spread, outputs=None, dependence=None, constraints=())
        assert study.model.name == "ishigami"

    @given(st.text(st.characters(codec="utf-8", exclude_categories=["Cs"])))
    def test_any_text_survives_the_way_through_toml(self, text):
        title = f'a\n{text}\r\n\'"""'
        assert made(title=title).title == title


class TestModels:
    @pytest.mark.slow
    def test_a_closure_and_a_lambda_run_on_two_processes(self, tmp_path):
        factor = 0.01
        study = made(model=lambda length, width: {"area": length * width * factor}, surrogates=None)
        alone = uqpen.make_archive(study, tmp_path / "one.nc")
        spread = uqpen.make_archive(study, tmp_path / "two.nc", workers=2)
        assert alone.identical(spread)
        assert (tmp_path / "one.nc").read_bytes() == (tmp_path / "two.nc").read_bytes()

    def test_a_function_takes_each_input_in_the_unit_in_which_it_is_written(self):
        units = {}

        def record(length, width):
            units.update(length=length, width=width)
            return {"area": 1.0}

        uqpen.run(made(model=record, surrogates=None))
        assert 1.8 < units["length"] < 3
        assert 20 < units["width"] < 40

    @pytest.mark.slow
    def test_a_model_may_state_its_own_units(self):
        in_metres = uqpen.PythonModel(
            lambda length, width: {"area": length * width},
            inputs={"length": "m", "width": "m"},
            outputs={"area": "m2"},
            vectorized=True,
        )
        one = uqpen.run(made(surrogates=None))
        other = uqpen.run(made(model=in_metres, surrogates=None))
        path = "statistics/mc/area"
        np.testing.assert_allclose(one[path]["mean"], other[path]["mean"], rtol=1e-12)


class TestMistakes:
    def test_they_name_the_argument_and_all_are_reported_at_once(self):
        text = message(
            inputs={"length": {"normal": {"mean": "2 m", "std": "1 kg"}}, "width": "30 cm"},
            dependence=None,
            designs={"mc": object()},
            surrogates=None,
            seed=-1,
        )
        assert "uqpen.Study: 3 mistakes; nothing was run" in text
        for where, found in (
            ("uqpen.Study(inputs=…)  inputs.length.normal.std", '"1 kg"'),
            ("uqpen.Study(designs=…)  designs.mc", "an object of class object"),
            ("uqpen.Study(seed=…)  seed", "-1"),
        ):
            assert f"  {where}\n    found     {found}" in text

    def test_a_quantity_that_cannot_be_read_is_refused_where_it_is_written(self):
        with pytest.raises(uqpen.UqpenError, match="with a decimal comma"):
            uqpen.Normal("2,5 m", "1 m")

    @pytest.mark.parametrize(
        ("make", "reported"),
        [
            (lambda: uqpen.Normal("2 m", "1 kg"),
             'std: found "1 kg"; expected .* to "m", the unit of mean'),
            (lambda: uqpen.Uniform("2 m", "3"),
             'upper: found "3"; expected .* to "m", the unit of lower'),
            (lambda: uqpen.Discrete(["1 m", "20 cm", "3 s"]),
             'values: found "3 s"; expected .* to "m"'),
        ],
        ids=["normal", "uniform", "discrete"],
    )  # fmt: skip
    def test_units_that_do_not_agree_are_refused_where_they_are_written(self, make, reported):
        with pytest.raises(uqpen.UqpenError, match=reported):
            make()

    @pytest.mark.parametrize(
        ("changes", "found"),
        [
            ({"inputs": {"length": uqpen.Normal("2 m", "10 cm"), "width": "(30 ± 2) cm"},
              "dependence": None}, "found     values in m and cm"),
            ({"model": lambda length: {"area": length}}, "cannot take the inputs"),
        ],
    )  # fmt: skip
    def test_what_a_bare_function_cannot_take_is_refused(self, changes, found):
        assert found in message(**changes)

    def test_a_file_cannot_name_an_object(self, tmp_path):
        path = tmp_path / "study.toml"
        path.write_text(made().to_toml())
        with pytest.raises(uqpen.StudyError) as caught:
            uqpen.load_study(path)
        assert f'{path}:5  model.object\n    found     "area"' in str(caught.value)
        assert 'python = "my_model.py:area"' in str(caught.value)


class Solver:
    def area(self, length, width):
        return area(length, width)


@pytest.fixture(scope="module")
def made_here(tmp_path_factory):
    path = tmp_path_factory.mktemp("archives") / "area.nc"
    uqpen.make_archive(made(title="<script>", surrogates=None), path)
    return path


class TestArchives:
    def outcomes(self, path, **options):
        checks = uqpen.verify(path, **options)
        return {check.name: (check.verdict.name, check.text) for check in checks}

    def test_runs_are_not_repeated_without_the_function(self, made_here):
        for trust in (False, True):
            outcomes = self.outcomes(made_here, trust=trust)
            assert outcomes["runs"] == (
                "UNCHECKED",
                "not repeated: area is an object of the Python program that made the archive",
            )
            assert {outcome for outcome, _ in outcomes.values()} == {"EQUAL", "UNCHECKED"}

    def test_with_the_function_all_is_checked(self, made_here):
        outcomes = self.outcomes(made_here, model=area, runs=20)
        assert {outcome for outcome, _ in outcomes.values()} == {"EQUAL"}

    def test_another_function_is_reported(self, made_here):
        def other(length, width):
            return {"area": length * width / 101}

        outcomes = self.outcomes(made_here, model=other, runs=20)
        assert outcomes["runs"][0] == "DIFFERENT"
        assert outcomes["source"][0] == "DIFFERENT"

    @pytest.mark.parametrize("options", [[], ["--trust"]])
    def test_rerun_refuses_it(self, made_here, options):
        result = CliRunner().invoke(rerun, [str(made_here), *options])
        assert isinstance(result.exception, ModelError)
        assert "its model is an object of a Python program (area)" in str(result.exception)

    def test_its_source_is_in_it_to_be_read(self, made_here):
        text = uqpen.open_archive(made_here).attrs["study_text"]
        assert "return {" in tomllib.loads(text)["model"]["source"]

    def test_runs_of_an_unknown_function_are_not_kept(self, tmp_path):
        calls = []

        class Interrupted(Progress):
            def advance(self, runs, failed, in_progress):
                calls.append(runs)
                raise KeyboardInterrupt

            def warn(self, text):
                warnings.append(text)

        warnings = []
        study = made(model=Solver().area)
        with pytest.raises(KeyboardInterrupt, match="nothing was written"):
            uqpen.make_archive(study, tmp_path / "area.nc", progress=Interrupted())
        assert not list(tmp_path.rglob("*.npz"))
        assert warnings == [
            'an interrupted start is not resumed: "area" is an object of class Solver, so another '
            "version of the model cannot be distinguished from this one"
        ]


class TestOtherLibraries:
    def test_distributions_that_are_data_are_written_as_data(self):
        study = made(
            inputs={
                "length": uqpen.FrozenDistribution(stats.genextreme(-0.1, loc=2, scale=0.1), "m"),
                "width": uqpen.FrozenDistribution(chaospy.Normal(30, 2), "cm"),
            },
            surrogates=None,
        )
        inputs = tomllib.loads(study.to_toml())["inputs"]
        assert inputs["length"]["scipy"] == {
            "name": "genextreme", "c": -0.1, "loc": 2.0, "scale": 0.1, "unit": "m"
        }  # fmt: skip
        assert inputs["width"]["chaospy"] == {
            "name": "Normal", "mu": 30.0, "sigma": 2.0, "unit": "cm"
        }  # fmt: skip
        # A standard error of the median of 60 runs is 1.25 * 0.02 / sqrt(60) = 0.003.
        runs = uqpen.run(study)["runs/mc"]
        assert float(runs["width"].median()) == pytest.approx(0.3, abs=0.01)

    @pytest.mark.slow
    def test_a_distribution_that_is_an_object_is_given_to_verify(self, tmp_path):
        width = uqpen.FrozenDistribution(chaospy.Normal(30, 2) + 1, "cm")
        path, inputs = tmp_path / "area.nc", {"length": "2 m", "width": width}
        uqpen.make_archive(made(inputs=inputs, dependence=None, surrogates=None), path)
        (refused,) = [each for each in uqpen.verify(path) if each.name == "repetition"]
        assert refused.verdict.name == "IMPOSSIBLE"
        checks = uqpen.verify(path, model=area, inputs={"width": width.frozen}, runs=20)
        assert {check.verdict.name for check in checks} == {"EQUAL"}

    @pytest.mark.parametrize(
        ("table", "found", "expected"),
        [
            ({"name": "gausian", "loc": 1}, '"gausian"', "a distribution of"),
            (
                {"name": "gamma", "b": 1, "unit": "m"},
                "b 1: it takes a, loc, scale",
                "parameters of",
            ),
            ({"name": "gamma", "a": -1, "unit": "m"}, "a -1: it is not defined", "parameters of"),
            ({"name": "norm", "loc": "2 m", "unit": "m"}, '"2 m"', "a number, in the unit"),
            ({"name": "norm", "unit": "kg"}, "kg", "a length, such as"),
        ],
    )
    def test_a_mistake_in_one_is_reported(self, table, found, expected):
        model = uqpen.PythonModel(area, {"length": "m", "width": "cm"}, {"area": "m2"})
        text = message(
            model=model,
            inputs={"length": {"scipy": table}, "width": "30 cm"},
            dependence=None,
            surrogates=None,
        )
        assert found in text
        assert expected in text


def test_it_is_shown_as_a_short_table():
    html = made(title="<script>")._repr_html_()
    assert "&lt;script&gt;" in html
    assert "<td>normal: mean 2 m, std 0.1 m; at least 1.8 m</td>" in html
    assert len(html) < 4000


def test_an_archive_is_shown_as_a_short_table_and_is_a_long_one(made_here):
    archive = uqpen.open_archive(made_here)
    html = archive._repr_html_()
    assert "&lt;script&gt;" in html
    assert "<th>area [m2]</th><th>mc</th><th>lhs</th>" in html
    assert len(html) < 10_000
    table = archive.to_frame()
    means = table[(table["statistic"] == "mean") & (table["source"] == "mc")]
    assert len(means) == 1
    row = means.iloc[0]
    assert row["lower"] < row["estimate"] < row["upper"]


_REST = {"seed": 1, "outputs": {"y": "1"}, "designs": {"draws": uqpen.MonteCarlo(runs=10)}}


def test_names_of_joint_inputs_that_join_to_one_text_are_kept_apart():
    joint = chaospy.MvNormal([0, 0], [[1, 0.5], [0.5, 1]])
    study = uqpen.Study(
        model=lambda a_b, c, a, b_c: {"y": a_b + c + a + b_c},
        inputs={("a_b", "c"): joint, ("a", "b_c"): joint},
        **_REST,
    )
    assert [group.inputs for group in study.joint.groups] == [("a_b", "c"), ("a", "b_c")]


def test_one_input_may_stand_in_a_tuple():
    study = uqpen.Study(model=lambda a: {"y": a}, inputs={("a",): chaospy.Normal(1, 2)}, **_REST)
    assert study.joint.inputs[0].distribution.ppf(np.array([0.5]))[0] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("names", "value", "found"),
    [
        (("a", "b"), chaospy.Normal(0, 1), "one of dimension 1"),
        (("a", "b"), uqpen.Normal(mean=0, std=1), "an object of class Normal"),
        ((), chaospy.Normal(0, 1), "no names of inputs"),
    ],
)
def test_a_tuple_that_its_distribution_does_not_fit_is_refused(names, value, found):
    with pytest.raises(uqpen.StudyError) as caught:
        uqpen.Study(model=lambda a, b: {"y": a + b}, inputs={names: value}, **_REST)
    problem = caught.value.problems[0]
    assert problem.path == ("inputs", str(names))
    assert problem.found == found


def test_a_data_frame_is_a_sample_of_inputs():
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"a [mm]": [1.0, 2.0, 3.0], "b [s]": [1.0, 2.0, 4.0]})
    study = uqpen.Study(
        model=lambda a, b: {"y": a / b}, joint={"posterior": {"sample": frame}}, **_REST
    )
    assert [(each.variable.name, each.variable.unit) for each in study.joint.inputs] == [
        ("a", "m"),
        ("b", "s"),
    ]


def test_the_representation_of_a_study_is_one_line():
    study = uqpen.Study(
        model=lambda a: {"y": a}, inputs={"a": uqpen.Normal(mean=0, std=1)}, title="A", **_REST
    )
    assert repr(study) == "<uqpen.Study 'A': lambda; designs draws>"
