"""Outputs that a study derives from fields: read, refused, made in Python, and what they cost."""

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.core.model import Dimension, Input, Model, Output, Results
from uqpen.results.field_tables import field_lines
from uqpen.study.summary import output_rows

MODEL = """\
import numpy as np

def sir(rate):
    time = np.linspace(0, 160, 5)
    return {
        "infected": 100 * rate * time / 160,
        "speed": np.where(time <= 400 * rate, rate, np.nan),
        "field": rate * np.ones((2, 3)),
        "number": rate,
    }
"""
STUDY = """\
seed = 1
[model]
python = "epidemic.py:sir"
inputs = { rate = "1" }
[model.outputs]
infected = { unit = "1", along = { time = { unit = "day", from = 0, to = 160, size = 5 } } }
speed = { unit = "degC", along = { time = { unit = "day", from = 0, to = 160, size = 5 } }, may_end = true }
field = { unit = "Pa", along = { x = { values = [0, 1] }, y = { values = [0, 1, 2] } } }
number = "1"
[inputs]
rate = { uniform = { lower = "0.1", upper = "0.5" } }
[designs.mc]
kind = "monte-carlo"
runs = 40
"""  # noqa: E501 - a table of TOML in braces has one line


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "epidemic.py").write_text(MODEL)
    return tmp_path


def parsed(derived, folder):
    return uqpen.parse_study(STUDY + derived, folder=folder)  # type: ignore[return-value]


def refused(derived, folder):
    with pytest.raises(uqpen.StudyError) as error:
        parsed(derived, folder)
    assert "nothing was run" in str(error.value)
    first = len(STUDY.splitlines())
    lines = [each for each in str(error.value).split("\n") if each.startswith("  study.toml:")]
    assert all(int(line.split(":")[1].split()[0]) > first for line in lines), lines
    return [f"{each.key}: {each.found}; {each.expected}" for each in error.value.problems]


class TestRead:
    def test_a_derived_output_is_one_more_quantity(self, folder):
        text = '[outputs.peak]\nof = "infected"\ntake = "max"\nexceeds = ["20"]\nhold = [0.95]\n'
        study = parsed(text, folder)
        assert [each.name for each in study.model.outputs] == [
            "infected", "speed", "field", "number",
        ]  # fmt: skip
        peak = study.quantities_of_interest[-1]
        assert peak.output == study.model.all_outputs[-1]
        assert peak.thresholds[0].value == 20.0
        name, asked = output_rows(study)[-1]
        assert name == "peak"
        assert asked.startswith("largest infected along time; moments")

    @pytest.mark.parametrize(
        ("keys", "expected"),
        [
            ('time_of = "max"', "time of the largest infected"),
            ('take = "idxmin"', "time of the smallest infected"),
            ('time_of = "last"', "last time of infected"),
            ('at = { time = "10 day" }', "infected at time = 10 day"),
            ('take = "integral"\nunit = "hour"', "integral of infected over time"),
            ('take = "first_above"\nthreshold = 30', "first time of infected above 30"),
        ],
    )
    def test_ways_to_say_it(self, keys, expected, folder):
        study = parsed(f'[outputs.found]\nof = "infected"\n{keys}\n', folder)
        assert study.model.derived[0].output.title == expected

    def test_other_models_have_it_where_they_have_the_field(self, folder):
        text = STUDY.replace("[model]", "[models.first]").replace("[model.", "[models.first.")
        text += (
            '[models.bare]\npython = "epidemic.py:sir"\n[models.bare.inputs]\nrate = "1"\n'
            '[models.bare.outputs]\nnumber = "1"\n'
            '[outputs.peak]\nof = "infected"\ntake = "max"\n'
        )
        study = uqpen.parse_study(text, folder=folder)
        names = {
            name: [each.output.name for each in variant.model.derived]
            for name, variant in study.models.items()
        }
        assert names == {"first": ["peak"], "bare": []}


class TestRefused:
    @pytest.mark.parametrize(
        ("table", "expected"),
        [
            ('of = "infectd"\ntake = "max"',
             'outputs.found.of: "infectd"; an output of epidemic.py:sir with dimensions; '
             'did you mean "infected"? known: infected, speed, field'),
            ('of = "number"\ntake = "max"',
             'outputs.found.of: "number"; an output of epidemic.py:sir with dimensions; '
             "known: infected, speed, field"),
            ('of = "infected"', "outputs.found: nothing to take; one of take, at, time_of"),
            ('of = "infected"\ntake = "max"\ntime_of = "max"',
             "outputs.found: take and time_of; one of take, at, time_of"),
            (
                'of = "infected"\ntake = "maximum"',
                'outputs.found.take: "maximum"; something to take; did you mean "max"? known: '
                "max, min, mean, integral, first, last, idxmax, idxmin, idxlast, first_above, "
                "first_below, total_variation",
            ),
            ('of = "infected"\ntim_of = "max"', "outputs.found.tim_of: an unknown dimension; "
             'did you mean "time_of"? known: time_of'),
            ('of = "infected"\ntime_of = "least"',
             'outputs.found.time_of: "least"; one of max, min, last'),
            ('of = "infected"\ntime_of = ["max"]',
             "outputs.found.time_of: [\"max\"]; one of max, min, last"),
            ('of = ["infected"]\ntake = "max"',
             "outputs.found.of: [\"infected\"]; the name of an output with dimensions"),
            ('of = "infected"\ntake = "first_above"',
             'outputs.found.threshold: nothing; a plain number, such as "0.5"'),
            ('of = "infected"\ntake = "first_above"\nthreshold = "3 m"',
             'outputs.found.threshold: "3 m"; a plain number, such as "0.5"'),
            ('of = "infected"\nat = { time = "200 day" }',
             "outputs.found.at: time = 200 day; a coordinate from 0 day to 160 day"),
            ('of = "field"\nat = { x = 0.5 }', "outputs.found.at: no y; a coordinate from 0 to 2"),
            ('of = "infected"\nat = { depth = "1 m", time = "1 day" }',
             "outputs.found.at.depth: an unknown dimension; known: time"),
            ('of = "infected"\nat = "10 day"',
             'outputs.found.at: "10 day"; a table of coordinates, such as { time = "10 day" }'),
            ('of = "field"\ntake = "total_variation"',
             "outputs.found.take: field has 2 dimensions; a curve, along one dimension"),
            ('of = "field"\nx_of = "max"',
             "outputs.found.x_of: field has 2 dimensions; a curve, along one dimension"),
            ('of = "speed"\ntake = "total_variation"\nunit = "degC"',
             'outputs.found.unit: "degC"; a unit such as "K", as it is a difference'),
        ],
    )  # fmt: skip
    def test_with_a_message(self, table, expected, folder):
        assert refused(f"[outputs.found]\n{table}\n", folder) == [expected]

    @pytest.mark.parametrize(
        ("asked", "where"),
        [
            ('exceeds = ["5 degC"]', "outputs.ups.exceeds[0]"),
            ('below = { "5 degC" = { at_most = 0.1 } }', "outputs.ups.below.5 degC"),
            ('[joint_probabilities]\nall = ["ups > 5 degC"]', "joint_probabilities.all[0]"),
            ('[published.a]\nsource = "b"\n[published.a.ups]\nmean = "5 degC"',
             "published.a.ups.mean"),
            ('[designs.it]\nkind = "monte-carlo"\naccept = "P(ups > 5 degC) < 0.1"\n'
             "at_most = 50", "designs.it.accept"),
        ],
    )  # fmt: skip
    def test_a_difference_in_a_unit_with_a_zero(self, asked, where, folder):
        text = f'[outputs.ups]\nof = "speed"\ntake = "total_variation"\n{asked}\n'
        expected = '"5 degC", in a unit with a zero of its own; a difference, such as "1 K"'
        assert refused(text, folder) == [f"{where}: {expected}"]
        parsed(text.replace("degC", "K"), folder)

    @pytest.mark.parametrize("name", ["infected", "rate", "time"])
    def test_a_name_that_is_taken(self, name, folder):
        found = refused(f'[outputs.{name}]\nof = "infected"\ntake = "max"\n', folder)
        assert found[0].startswith(f'outputs.{name}: an output "{name}", a name that the study')

    def test_a_name_that_a_companion_has(self, folder):
        text = (
            '[outputs.a]\nof = "infected"\ntake = "first_above"\nthreshold = 1\n'
            '[outputs.a_occurs]\nof = "infected"\ntake = "max"\n'
        )
        assert len(refused(text, folder)) == 1

    def test_what_asks_for_a_mistaken_one_is_no_mistake_besides(self, folder):
        text = (
            '[outputs.peak]\nof = "infected"\ntake = "maximum"\nexceeds = ["20"]\n'
            '[joint_probabilities]\nhigh = ["peak > 20"]\n'
        )
        assert len(refused(text, folder)) == 1


class TestRuns:
    def test_are_those_of_the_field(self, folder):
        text = (
            '[outputs.peak]\nof = "infected"\ntake = "max"\n'
            '[outputs.late]\nof = "speed"\nat = { time = "100 day" }\n'
        )
        tree = uqpen.run(parsed(text, folder))
        runs = tree["runs/mc"].to_dataset()
        assert np.array_equal(runs["peak"], runs["infected"].max("time"))
        assert runs["peak"].attrs["derived_from"] == "infected"
        never = runs["rate"].values < 0.3  # the curve ends at a coordinate before 120 day
        assert np.array_equal(np.isnan(runs["late"]), never)
        assert np.array_equal(runs["late_occurs"], never.astype(np.int8))
        assert runs["late"].attrs["absent"] == "speed ends before time = 100 day"
        assert list(field_lines(tree))[-2:] == [
            "peak: largest infected along time",
            "late [degC]: speed at time = 100 day",
        ]

    def test_cost_nothing_in_python(self):
        calls = []

        def sir(rate):
            calls.append(rate)
            return {"infected": rate * np.linspace(0.0, 1.0, 3)}

        curve = uqpen.OutputSpec(
            "1", along={"time": {"unit": "day", "from": 0, "to": 2, "size": 3}}
        )
        tree = uqpen.run(
            uqpen.Study(
                model=sir,
                inputs={"rate": uqpen.Uniform(0.5, 1.0)},
                outputs={
                    "infected": curve,
                    "peak": uqpen.OutputSpec(of="infected", take="max", exceeds=[0.7]),
                    "start": {"of": "infected", "time_of": "min"},
                    "crossing": uqpen.OutputSpec(of="infected", take="first_above", threshold=0),
                    "middle": uqpen.OutputSpec(of="infected", at={"time": "1 day"}),
                },
                designs={"mc": uqpen.MonteCarlo(runs=30)},
                seed=1,
            )
        )
        # The trial run is made twice, and one run in 20 again, to see noise.
        assert len(calls) == 30 + 3
        rate = tree["runs/mc/rate"].values
        assert np.array_equal(tree["runs/mc/peak"], rate)
        assert np.array_equal(tree["runs/mc/middle"], rate / 2)
        assert np.array_equal(tree["runs/mc/start"], np.zeros(30))
        assert np.array_equal(tree["runs/mc/crossing"], np.zeros(30))
        assert tree["statistics/mc/peak/exceedance"].values[0, 0] == (rate > 0.7).mean()


class Course(Model):
    """A model of a class of its own, with a curve that ends."""

    name = "course"
    inputs = (Input("x", "1"),)
    outputs = (
        Output("depth", "m", dims=(Dimension("time", "s", values=(0, 1, 2)),), may_end=True),
    )

    def evaluate(self, inputs):
        depth = inputs["x"][:, None] * np.array([0.0, 1.0, 2.0])
        depth[inputs["x"] > 0.5, 2] = np.nan
        return Results.all_ok({"depth": depth})


class TestModelsThatAreNotLoaded:
    def test_an_archive_of_a_class_is_read_without_it(self, tmp_path):
        study = uqpen.Study(
            model=Course(),
            inputs={"x": uqpen.Uniform(0.0, 1.0)},
            outputs={
                "end": uqpen.OutputSpec(of="depth", take="last"),
                "late": uqpen.OutputSpec(of="depth", at={"time": "1.5 s"}),
            },
            designs={"mc": uqpen.MonteCarlo(runs=30)},
            seed=1,
        )
        uqpen.make_archive(study, tmp_path / "course.nc")
        verdicts = {
            check.name: str(check.verdict) for check in uqpen.verify(tmp_path / "course.nc")
        }
        assert verdicts["statistics"] == "equal"

    @pytest.mark.parametrize(
        ("old", "key"),
        [('rate = "1"', "model.inputs.rate"), ('{ unit = "1"', "model.outputs.infected.unit")],
    )
    def test_a_model_with_a_mistake_has_no_others(self, old, key, folder):
        text = STUDY.replace(old, old.replace("1", "parrot"), 1)
        text += '[outputs.cases]\nof = "infected"\ntake = "integral"\nexceeds = ["20 day"]\n'
        with pytest.raises(uqpen.StudyError) as error:
            uqpen.parse_study(text, folder=folder)
        assert [each.key for each in error.value.problems] == [key]


PLATE = """\
seed = 1
[model]
python = "plate.py:plate"
inputs = { load = "kN", area = "cm^2" }
outputs = { strength = "MPa", delay = "ms", heat = "degC" }
[inputs]
load = { uniform = { lower = "60 kN", upper = "140 kN" } }
area = "5 cm^2"
[designs.mc]
kind = "monte-carlo"
runs = 40
"""


@pytest.fixture
def plate(tmp_path):
    code = 'return {"strength": 200 + load / 50, "delay": load - 100, "heat": load}'
    (tmp_path / "plate.py").write_text(f"def plate(load, area):\n    {code}\n")
    return lambda added: uqpen.parse_study(PLATE + added, folder=tmp_path)


class TestFormulas:
    def test_follow_from_outputs_and_inputs_in_their_units(self, plate):
        study = plate(
            '[outputs.margin]\nformula = "strength - load / area"\nbelow = ["0 MPa"]\n'
            '[outputs.worst]\nformula = "max(-margin, abs(margin) / 2)"\n'
        )
        runs = uqpen.run(study)["runs/mc"].to_dataset()
        margin = runs["strength"].values - runs["load"].values / 5e-4
        assert np.allclose(runs["margin"], margin, rtol=1e-12, atol=1e-3)  # of 2e8 Pa
        assert np.allclose(runs["worst"], np.maximum(-margin, abs(margin) / 2), atol=1e-3)
        assert runs["margin"].attrs["derived_from"] == "strength - load / area"
        assert runs["margin"].attrs["display_units"] == "MPa"
        assert "margin_occurs" not in runs

    def test_a_value_that_is_not_finite_is_a_missing_number_of_a_completed_run(self, plate):
        tree = uqpen.run(plate("[outputs.slow]\nformula = \"log10(delay / '1 ms')\"\n"))
        runs = tree["runs/mc"].to_dataset()
        has_none = runs["delay"].values <= 0
        assert 0 < has_none.sum() < 40
        assert (runs["status"] == 0).all()
        assert np.array_equal(np.isnan(runs["slow"]), has_none)
        assert np.array_equal(runs["slow_occurs"], has_none)
        mean = tree["statistics/mc/slow/mean"]
        assert mean.attrs["runs_absent"] == has_none.sum()
        assert mean.values[0] == pytest.approx(
            np.log10(runs["delay"].values[~has_none] * 1e3).mean()
        )

    def test_what_a_rare_event_is_of(self, plate):
        added = (
            '[outputs.margin]\nformula = "strength - load / area"\n[designs.rare]\n'
            'kind = "importance-sampling"\nsamples = 200\nevent = ["margin < -40 MPa"]\n'
        )
        (found,) = uqpen.run(plate(added))["joint_probabilities/rare"]["joint_probability"]
        # Below load (200 + load / 50) MPa - load / area falls at 240 kN / (2 - 1 / 50) = 121.2 kN.
        assert found.sel(bound="lower").item() < (140 - 240 / 1.98) / 80
        assert found.sel(bound="upper").item() > (140 - 240 / 1.98) / 80

    @pytest.mark.parametrize(
        ("table", "expected"),
        [
            ('formula = "strength - delay"',
             '.formula: "strength - delay", which compares Pa with s; sides of the same '
             "dimension"),
            ('formula = "log10(delay)"',
             '.formula: "log10(delay)", of a value in s; a plain number in it, such as '
             "log10(delay / '1 s')"),
            ('formula = "sqrt(load)"',
             '.formula: "sqrt(load)", of a value in N; a unit that has a square root, '
             "such as m2"),
            ('formula = "stength"',
             '.formula: "stength"; an output or input of plate.py:plate that is a number; '
             'did you mean "strength"? known: load, area, strength, delay, heat'),
            ('formula = "load"\nof = "strength"', ": of and formula; one of them"),
            ('formula = "heat - heat"\nunit = "degC"',
             '.unit: "degC"; a unit such as "K", as it is a difference'),
        ],
    )  # fmt: skip
    def test_refused_with_a_message(self, table, expected, plate):
        with pytest.raises(uqpen.StudyError) as error:
            plate(f"[outputs.margin]\n{table}\n")
        found = [f"{each.key}: {each.found}; {each.expected}" for each in error.value.problems]
        assert found == [f"outputs.margin{expected}"]

    def test_another_one_makes_no_run(self, plate, tmp_path, command_line):
        study = tmp_path / "study.toml"
        study.write_text(PLATE)
        assert command_line("study", str(study), "-o", str(tmp_path / "first.nc")).code == 0
        formula = '[outputs.margin]\nformula = "strength - load / area"\n'
        study.write_text(PLATE + formula)
        assert plate(formula).model.identity() == plate("").model.identity()
        again = str(tmp_path / "again.nc"), "--reuse", str(tmp_path / "first.nc")
        said = command_line("study", str(study), "-o", *again).err
        assert "40 of 40 runs from " in said
        assert "mc: 0 runs in " in said
        with xr.open_datatree(tmp_path / "first.nc") as first, xr.open_datatree(again[0]) as other:
            runs = other["runs/mc"].to_dataset()
            assert runs.drop_vars("margin").equals(first["runs/mc"].to_dataset())
            assert other.attrs["formulas_over"] == first.attrs["content_sha256"]
            assert "formulas_over" not in first.attrs
