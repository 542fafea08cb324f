"""A study file becomes a study, or one error that lists every mistake in it."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from uqpen.core.errors import StudyError
from uqpen.distributions.joint_distribution import FixedInput, RandomInput
from uqpen.distributions.univariate import Normal, Truncated, Uniform
from uqpen.models.surroundings import ModelFolder
from uqpen.statistics.quantity_of_interest import Threshold
from uqpen.study.load import load_study, parse_study
from uqpen.study.study import ValidatedStudy

STUDIES = Path(__file__).parents[2] / "studies"

WHOLE = """\
title = "Whole"
seed = 1

[model]
use = "walker-anderson"

[inputs]
projectile_density = "17.5 g/cm^3"
projectile_yield_limit = "1.65 GPa"
projectile_length = "16 cm"
impact_velocity = "1400 m/s"
projectile_sound_speed = "3071 m/s"
target_density = "(2.5 ± 0.05) g/cm^3"
target_yield_limit = "400 MPa"
plasticity_radius = { normal = { mean = "100 mm", std = "25 mm" }, lower = "50 mm" }
crater_radius = { uniform = { lower = "14 mm", upper = "20 mm" } }

[outputs.penetration_depth]
unit = "cm"
quantiles = [0.99]
exceeds = ["60 cm", "0.6 m"]
hold = [0.9]

[constraints]
keep = ["plasticity_radius > 2 * crater_radius"]

[designs.mc]
kind = "monte-carlo"
runs = 100
"""


def changed(old, new):
    assert old in WHOLE
    return WHOLE.replace(old, new)


def report(text, folder=Path()):
    with pytest.raises(StudyError) as caught:
        parse_study(text, folder=folder)
    return str(caught.value)


def test_a_whole_study_is_understood():
    study = parse_study(WHOLE)
    distribution = {entry.variable.name: entry for entry in study.joint.inputs}
    length, density = distribution["projectile_length"], distribution["target_density"]
    assert isinstance(length, FixedInput)
    assert (length.value, length.display_unit) == (0.16, "cm")
    assert isinstance(density, RandomInput)
    assert density.distribution == Normal(2500.0, 50.0)
    radius, crater = distribution["plasticity_radius"], distribution["crater_radius"]
    assert isinstance(radius, RandomInput)
    assert radius.distribution == Truncated(Normal(0.1, 0.025), 0.05)
    assert isinstance(crater, RandomInput)
    assert crater.distribution == Uniform(0.014, 0.02)
    smoothing = distribution["smoothing"]
    assert isinstance(smoothing, FixedInput)
    assert smoothing.value == 0.0, "the model's default"
    quantity = study.quantities_of_interest[0]
    assert quantity.quantiles == (0.05, 0.5, 0.95, 0.99)
    assert quantity.thresholds == (Threshold("60 cm", 0.6), Threshold("0.6 m", 0.6))
    assert (quantity.tolerance_contents, quantity.display_unit) == ((0.9,), "cm")
    assert [constraint.text for constraint in study.constraints] == [
        "plasticity_radius > 2 * crater_radius"
    ]
    assert study.runs == 100
    assert study.text == WHOLE


@pytest.mark.parametrize("path", sorted(STUDIES.glob("*.toml")), ids=lambda path: path.stem)
def test_the_studies_that_come_with_it_are_right(path):
    assert isinstance(load_study(path), ValidatedStudy)


@pytest.mark.parametrize(
    ("old", "new", "line", "key", "found", "expected"),
    [
        ("seed = 1", "seed = -1", 2, "seed", "-1", "a whole number"),
        ("seed = 1", "seed = 1.5", 2, "seed", "1.5", "a whole number"),
        ("seed = 1", "", None, "seed", "nothing", "a whole number"),
        ('title = "Whole"', "title = 3", 1, "title", "3", "a title"),
        ("seed = 1", "seed = 1\nsede = 2", 3, "sede", "an unknown key", 'did you mean "seed"'),
        ('"walker-anderson"', '"walker-andersen"', 5, "model.use", '"walker-andersen"',
         'did you mean "walker-anderson"'),
        ('use = "walker-anderson"', 'use = "walker-anderson"\ntolerence = 1e-6', 6,
         "model.tolerence", "an unknown key", 'did you mean "tolerance"'),
        ('use = "walker-anderson"', 'use = "walker-anderson"\ntolerance = 0', 6, "model.tolerance",
         "0", "above 0"),
        ('use = "walker-anderson"', "", 4, "model", "nothing that names a model", "use ="),
        ('use = "walker-anderson"', 'pyhton = "a.py:f"', 4, "model",
         "nothing that names a model, but pyhton", "python ="),
        ('"16 cm"', '"5 kg"', 10, "inputs.projectile_length", '"5 kg"', "a length"),
        ('"16 cm"', '"16,5 cm"', 10, "inputs.projectile_length", "decimal comma", '"16.5 cm"'),
        ('"16 cm"', "16", 10, "inputs.projectile_length", "without a unit", "a length"),
        ('"16 cm"', '"-16 cm"', 10, "inputs.projectile_length", '"-16 cm"', "a value > 0 m"),
        ('projectile_length = "16 cm"\n', "", 7, "inputs.projectile_length", "nothing", "a length"),
        ("projectile_length =", "projectile_lenght =", 10, "inputs.projectile_lenght",
         "an unknown input", 'did you mean "projectile_length"'),
        ("± 0.05", "± -0.05", 13, "inputs.target_density", "± -0.05", "above 0 behind the ±"),
        ('std = "25 mm"', 'std = "-25 mm"', 15, "inputs.plasticity_radius.normal.std", '"-25 mm"',
         "above 0"),
        ('std = "25 mm"', 'sd = "25 mm"', 15, "inputs.plasticity_radius.normal.sd",
         "an unknown key", "std"),
        ('lower = "50 mm"', 'lower = "50 kg"', 15, "inputs.plasticity_radius.lower", '"50 kg"',
         "a length"),
        ('lower = "50 mm"', 'lower = "9 m"', 15, "inputs.plasticity_radius", "no probability",
         "leave some of the distribution"),
        ("{ uniform =", "{ unifrom =", 16, "inputs.crater_radius.unifrom",
         "an unknown distribution", 'did you mean "uniform"'),
        ('upper = "20 mm" }', 'upper = "10 mm" }', 16, "inputs.crater_radius.uniform.upper",
         '"10 mm"', "above lower"),
        ('unit = "cm"', 'unit = "kg"', 19, "outputs.penetration_depth.unit", '"kg"',
         'a unit such as "m"'),
        ("quantiles = [0.99]", "quantiles = [0.5, 99]", 20,
         "outputs.penetration_depth.quantiles[1]", "99", "between 0 and 1"),
        ('"0.6 m"', '"60 cm"', 21, "outputs.penetration_depth.exceeds[1]", "a second time", "once"),
        ('"0.6 m"', '"6 s"', 21, "outputs.penetration_depth.exceeds[1]", '"6 s"', "a length"),
        ("hold = [0.9]", "hold = 0.9", 22, "outputs.penetration_depth.hold", "0.9", "a list"),
        ("[outputs.penetration_depth]", "[outputs.penetration_dept]", 18,
         "outputs.penetration_dept", "an unknown output", 'did you mean "penetration_depth"'),
        ("2 * crater_radius", "2 * crater_radios", 25, "constraints.keep[0]", '"crater_radios"',
         'did you mean "crater_radius"'),
        ("2 * crater_radius", "2", 25, "constraints.keep[0]", "compares m with 1",
         "same dimension"),
        ('kind = "monte-carlo"', 'kind = "monte-karlo"', 28, "designs.mc.kind", '"monte-karlo"',
         'did you mean "monte-carlo"'),
        ('kind = "monte-carlo"', 'kind = "sobol"', 28, "designs.mc.kind", '"sobol"',
         'did you mean "sobol-sequence"'),
        ("runs = 100", "runs = 0", 29, "designs.mc.runs", "0", "at least 1"),
        ("runs = 100", "runs = true", 29, "designs.mc.runs", "true", "a whole number"),
        ("runs = 100", "", 27, "designs.mc.runs", "nothing", "a whole number"),
        ("[designs.mc]", '[designs."m c"]', 27, "designs.m c", '"m c"', "letters, digits"),
        ("[designs.mc]", f"[designs.{101 * 'm'}]", 27, f"designs.{101 * 'm'}", "mmm",
         "at most 100"),
    ],
)  # fmt: skip
def test_a_mistake_is_reported_with_line_key_found_and_expected(
    old, new, line, key, found, expected
):
    text = report(changed(old, new))
    where = f"study.toml:{line}" if line else "study.toml"
    blocks = {head: rest for head, *rest in map(str.splitlines, text.split("\n\n")[1:])}
    reported_found, reported_expected = blocks[f"  {where}  {key}"]
    assert reported_found.startswith("    found     ")
    assert found in reported_found
    assert reported_expected.startswith("    expected  ")
    assert expected in reported_expected


def test_lines_are_counted_as_toml_counts_them():
    # A line separator of Unicode's is text to TOML.
    text = changed("seed = 1", "seed = 1 # a\u2028b\x85").replace("runs = 100", "runs = 0")
    assert "study.toml:29  designs.mc.runs" in report(text)


@pytest.mark.parametrize(
    "distribution",
    [
        'gamma = { mean = "1 m", std = "1e200 m" }',
        'gamma = { mean = "1e300 m", std = "1e-10 m" }',
        'lognormal = { mean = "1 m", std = "1e-200 m" }',
        'lognormal = { mean = "1e-200 m", std = "1e200 m" }',
        'normal = { mean = "1e308 m", std = "1e308 m" }',
        'weibull = { shape = 1e-3, scale = "1 m" }',
    ],
)
def test_a_law_that_cannot_be_drawn_from_is_reported(distribution):
    text = changed('uniform = { lower = "14 mm", upper = "20 mm" }', distribution)
    assert "too wide or too narrow to draw from" in report(text)


def test_every_missing_input_is_reported():
    text = WHOLE.replace('projectile_length = "16 cm"\n', "")
    reported = report(text.replace('projectile_sound_speed = "3071 m/s"\n', ""))
    assert "inputs.projectile_length" in reported
    assert "inputs.projectile_sound_speed" in reported
    assert 'or "projectile_young_modulus"' in reported


@pytest.mark.parametrize(
    ("text", "line", "reported"),
    [
        ("title = \n", 1, "Invalid value"),
        ("seed = 1\nload = (4 ± 1) m\n", 2, 'a text stands in straight quotes, such as "5 mm"'),
        ("seed = 1\nx = { lower = 0 m }\n", 2, "a comma or } behind each value; a text stands in"),
        ("seed = 1\nx = 5 mm\n", 2, "one value; a text stands in straight quotes"),
        ("seed = 1\nξ = 5\n", 2, 'in quotes, such as "ξ" = 1'),
        ("seed: 1\n", 1, "expected  [table], or key = value"),
        (f"seed = 1\nruns = {'1' * 4301}\n", 2, "found     a number of over 4300 digits"),
        ("seed = 1\nx = [1]\nseed = 2\n", 3, "found     seed, which is there already"),
        ("[a.b]\n[ a . b ] # again\n", 2, "found     [ a . b ], which is there already"),
        ("x = { a = 1, a = 2 }\n", 1, "found     Duplicate inline table key 'a'"),
        ('seed = 1\nload = "4 m\n', 2, "a quote at the end of the text"),
        ('title = "a"\ntitle = "b"\n', 2, "every key and table once"),
        ("[a]\n[a]\n", 2, "every key and table once"),
        ("a = " + "[" * 5000, 1, ""),
        ("seed = 1\n\nx = 'never closed\n", 3, ""),
    ],
)
def test_what_is_not_toml_is_reported_alone_with_its_line(text, line, reported):
    complaint = report(text)
    assert f"study.toml:{line}" in complaint
    assert reported in complaint
    assert "cannot be read as a study" in complaint


def test_a_file_in_another_encoding_is_reported_with_its_line(tmp_path):
    path = tmp_path / "old.toml"
    path.write_bytes("seed = 1\ntitle = 'Größe'\n".encode("latin-1"))
    with pytest.raises(StudyError, match=r"old\.toml:2\n.*not UTF-8"):
        load_study(path)


def test_a_byte_order_mark_is_no_matter(tmp_path):
    path = tmp_path / "bom.toml"
    path.write_bytes(b"\xef\xbb\xbf" + WHOLE.encode())
    assert load_study(path).title == "Whole"


@pytest.mark.parametrize("what", ["absent.toml", "."])
def test_a_file_that_is_none_is_reported(tmp_path, what):
    with pytest.raises(StudyError, match="cannot be read"):
        load_study(tmp_path / what)


class TestSoundSpeed:
    def test_a_young_modulus_is_enough(self):
        text = changed(
            'projectile_sound_speed = "3071 m/s"', 'projectile_young_modulus = "165 GPa"'
        )
        assert "projectile_young_modulus" in parse_study(text).joint.nominal()

    def test_both_may_be_given_where_they_agree(self):
        both = 'projectile_sound_speed = "3071 m/s"\nprojectile_young_modulus = "165 GPa"'
        parse_study(changed('projectile_sound_speed = "3071 m/s"', both))

    def test_both_are_refused_where_they_disagree(self):
        both = 'projectile_sound_speed = "3071 m/s"\nprojectile_young_modulus = "175 GPa"'
        reported = report(changed('projectile_sound_speed = "3071 m/s"', both))
        assert "within 1 %" in reported


def test_a_nominal_point_outside_the_models_domain_is_a_mistake():
    text = changed(
        '"100 mm", std = "25 mm" }, lower = "50 mm"', '"10 mm", std = "25 mm" }, lower = "9 mm"'
    )
    assert "violate plasticity_radius > crater_radius" in report(
        text.replace('upper = "20 mm"', 'upper = "80 mm"')
    )


def test_random_designs_over_fixed_inputs_are_a_mistake():
    fixed = WHOLE.replace('"(2.5 ± 0.05) g/cm^3"', '"2.5 g/cm^3"')
    fixed = re.sub(r"plasticity_radius = {.*", 'plasticity_radius = "100 mm"', fixed)
    fixed = re.sub(r"crater_radius = {.*", 'crater_radius = "17 mm"', fixed)
    assert "inputs that are all fixed" in report(fixed)


class TestTable:
    def test_a_table_may_give_what_the_study_does_not(self, tmp_path):
        (tmp_path / "points.csv").write_text(
            "projectile_length [cm],target_density [kg/m^3],plasticity_radius [mm],"
            "crater_radius [mm]\n15,2500,90,15\n"
        )
        text = changed('projectile_length = "16 cm"\n', "")
        text = text.replace(
            'kind = "monte-carlo"\nruns = 100', 'kind = "table"\nfile = "points.csv"'
        )
        study = parse_study(text, folder=tmp_path)
        assert study.runs == 1


PYTHON = """\
seed = 1
[model]
python = "mine.py:simulate"
[model.inputs]
rod_length = "cm"
speed = "m/s"
[model.outputs]
depth = "cm"
[inputs]
rod_length = "(16 ± 1) cm"
speed = "1.4 km/s"
[designs.mc]
kind = "monte-carlo"
runs = 10
"""


class TestPythonModel:
    def study(self, folder, source, text=PYTHON):
        (folder / "mine.py").write_text(source, encoding="utf-8")
        return parse_study(text, folder=folder)

    def reported(self, folder, source, text=PYTHON):
        with pytest.raises(StudyError) as caught:
            self.study(folder, source, text)
        return str(caught.value)

    def test_a_function_beside_the_study_is_a_model(self, tmp_path):
        source = "def simulate(rod_length, speed): return {'depth': rod_length}"
        study = self.study(tmp_path, source)
        assert [(variable.name, variable.unit) for variable in study.model.inputs] == [
            ("rod_length", "m"),
            ("speed", "m s-1"),
        ]
        assert study.quantities_of_interest[0].display_unit == "cm"

    @pytest.mark.parametrize(
        "source",
        [
            "import shared_name\ndef simulate(rod_length, speed): return shared_name.answer()",
            "def simulate(rod_length, speed):\n"
            "    import shared_name\n    return shared_name.answer()",
        ],
        ids=["at once", "late"],
    )
    def test_studies_do_not_share_the_modules_beside_them(self, tmp_path, source):
        before = dict(sys.modules)
        models = []
        for factor in (2, 3):
            folder = tmp_path / str(factor)
            folder.mkdir()
            (folder / "shared_name.py").write_text(f"def answer(): return {{'depth': {factor}}}")
            models.append(self.study(folder, source).model)
        inputs = {name: np.ones(1) for name in ("rod_length", "speed")}
        found = [model.evaluate(inputs).outputs["depth"].tolist() for model in (*models, models[0])]
        assert found == [[0.02], [0.03], [0.02]]
        assert models[0].identity() != models[1].identity(), "what it imports is part of it"
        assert "shared_name" not in sys.modules
        assert {name: sys.modules.get(name) for name in before} == before

    def test_a_folder_around_python_itself_is_no_surrounding(self):
        before = dict(sys.modules)
        with ModelFolder(Path(sys.base_prefix).parent).on_import_path():
            assert set(before) == set(sys.modules)

    def test_an_importable_module_is_a_model_too(self, tmp_path):
        (tmp_path / "module_of_mine.py").write_text("def go(rod_length, speed): return {}")
        text = PYTHON.replace("mine.py:simulate", "module_of_mine:go")
        assert self.study(tmp_path, "", text).model.name == "module_of_mine:go"

    @pytest.mark.parametrize(
        ("source", "complaint"),
        [
            ("def other(): pass", 'no function "simulate"; it defines other'),
            ("simulate = 3", 'no function "simulate"'),
            ("def simulate(rod_length): pass", "cannot take the inputs"),
            ("def simulate(rod_length, speed, mass): pass", "cannot take the inputs"),
            ("import absent_module_of_mine", "No module named 'absent_module_of_mine'"),
            ("import absent_module_of_mine", "a module absent_module_of_mine beside the study, or"),
            (
                "x = 1\ny = 1 / 0\n",
                "failed: ZeroDivisionError: division by zero (mine.py, line 2: y = 1 / 0)",
            ),
            ("def broken(:\n", "failed: SyntaxError: invalid syntax (mine.py, line 1)"),
            ("import sys\nsys.exit(0)\n", "failed: SystemExit: 0 (mine.py, line 2: sys.exit(0))"),
        ],
    )
    def test_a_function_that_cannot_be_used_is_reported(self, tmp_path, source, complaint):
        reported = self.reported(tmp_path, source)
        assert "model.python" in reported
        assert complaint in reported

    @pytest.mark.parametrize(
        ("old", "new", "complaint"),
        [
            ('"mine.py:simulate"', '"absent.py:simulate"', 'no file "absent.py"'),
            ('"mine.py:simulate"', '"mine.py"', "not of the form"),
            ('depth = "cm"', 'depth = "frob"', "not a known unit"),
            ('depth = "cm"', 'speed = "cm"', "the name of an input"),
            ('depth = "cm"', 'status = "cm"', "a name of letters"),
            ('depth = "cm"', "", "at least one"),
            ('[model.outputs]\ndepth = "cm"\n', "", "what the model gives"),
            ('speed = "m/s"', "speed = 3", 'a unit such as "cm"'),
            ('python = "mine', 'use = "ishigami"\npython = "mine', "use and python"),
        ],
    )
    def test_a_wrong_declaration_is_reported(self, tmp_path, old, new, complaint):
        source = "def simulate(rod_length, speed): return {}"
        assert complaint in self.reported(tmp_path, source, PYTHON.replace(old, new))
