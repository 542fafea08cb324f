"""Outputs with dimensions in a study: declared in a file and in Python, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import uqpen
from uqpen.core.model import Dimension, Output
from uqpen.study.summary import output_rows, unfitted_lines

MODEL = """\
import numpy as np

def sir(rate):
    time = np.linspace(0, 160, 5)
    return {"infected": np.exp(-rate * time), "recovered": 1 - np.exp(-rate * time), "peak": rate}
"""
TIME = 'time = { unit = "day", from = 0, to = 160, size = 5 }'
STUDY = f"""\
seed = 1
[model]
python = "epidemic.py:sir"
inputs = {{ rate = "day-1" }}
[model.outputs]
infected = {{ unit = "1", along = {{ {TIME} }} }}
recovered = {{ unit = "1", along = {{ {TIME} }}, may_end = true }}
peak = "day-1"
[inputs]
rate = {{ uniform = {{ lower = "0.1 day-1", upper = "0.3 day-1" }} }}
[designs.mc]
kind = "monte-carlo"
runs = 20
"""
DAY = 86_400.0


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "epidemic.py").write_text(MODEL)
    return tmp_path


def parsed(text, folder):
    return uqpen.parse_study(text, folder=folder)  # type: ignore[return-value]


def problems(text, folder):
    with pytest.raises(uqpen.StudyError) as refused:
        parsed(text, folder)
    return [str(problem) for problem in refused.value.problems]


def changed(old, new):
    assert old in STUDY
    return STUDY.replace(old, new, 1)


class TestDeclared:
    def test_by_its_ends_and_size(self, folder):
        infected, recovered, peak = parsed(STUDY, folder).model.outputs
        values = tuple(DAY * day for day in (0.0, 40.0, 80.0, 120.0, 160.0))
        time = Dimension("time", "s", "", "day", values)
        assert infected == Output("infected", "1", display_unit="1", dims=(time,))
        assert recovered.dims == (time,)
        assert recovered.may_end
        assert peak.dims == ()

    def test_by_its_values(self, folder):
        text = STUDY.replace(
            TIME, 'time = { unit = "day", values = [0, 1.5, 3], long_name = "day of it" }'
        )
        time = parsed(text, folder).model.outputs[0].dims[0]
        assert time.values == (0.0, 1.5 * DAY, 3 * DAY)
        assert time.title == "day of it"

    def test_up_to_three(self, folder):
        further = ", ".join(f"{name} = {{ values = [1, 2] }}" for name in "abc")
        text = changed(TIME, f"{TIME}, {further}")
        text = text.replace(", c = { values = [1, 2] }", "", 1)
        assert parsed(text, folder).model.outputs[0].shape == (5, 2, 2)
        found = problems(changed(TIME, f"{TIME}, {further}"), folder)
        assert found == [
            "model.outputs.infected.along: found time, a, b, c; expected at most 3 dimensions, of "
            "names that differ"
        ]

    def test_a_table_may_give_the_unit_alone(self, folder):
        text = changed('peak = "day-1"', 'peak = { unit = "day-1" }')
        assert parsed(text, folder).model.outputs == parsed(STUDY, folder).model.outputs

    def test_what_is_asked_is_listed(self, folder):
        rows = dict(output_rows(parsed(STUDY, folder)))
        assert rows["infected"] == (
            "at each place along time (5): mean, standard deviation, quantiles 0.05, 0.5, 0.95"
        )

    @given(
        st.lists(st.floats(-1e6, 1e6, allow_subnormal=False), min_size=1, max_size=5, unique=True)
    )
    def test_values_are_read_as_written(self, values):
        values = sorted(values)
        text = STUDY.replace(TIME, f"depth = {{ values = {values} }}")
        study = uqpen.parse_study(text, trust=False)
        assert list(study.model.outputs[0].dims[0].values) == values


class TestMistakes:
    @pytest.mark.parametrize(
        ("along", "message"),
        [
            ('run = { unit = "1", values = [1] }',
             '.run: found "run"; expected a name that archives do not use themselves'),
            ('rate = { unit = "1", values = [1] }',
             '.rate: found a dimension with the name of the variable "rate"; expected names '
             "that differ"),
            ("time = { values = [1, 3, 2] }",
             ".time.values[2]: found 2; expected finite numbers in ascending order"),
            ('time = { values = [1, "a"] }',
             '.time.values: found [1, "a"]; expected a list of numbers'),
            ("time = { from = 0, to = 1 }",
             ".time: found from and to; expected either from, to and size, or values, or file, "
             "or from_model"),
            ("time = {}",
             ".time: found no coordinates; expected either from, to and size, or values, or "
             "file, or from_model"),
            ("time = { from = 1, to = 0, size = 3 }",
             ".time.to: found 0; expected a number above 1"),
            ("time = { from = 0, to = 1, size = 1 }",
             ".time.size: found 1; expected a whole number, at least 2 and at most 1_000_000"),
            ('time = { unit = "dya", values = [1] }',
             '.time.unit: found "dya", which is not a known unit; expected a unit such as '
             '"g/cm^3", with whole powers'),
            ("time = { values = [1], step = 2 }",
             ".time.step: found an unknown key; expected known: unit, from, to, size, values, "
             "file, column, from_model, long_name"),
            ("", ": found an empty table; expected a dimension, such as time"),
            ("a = { from = 0, to = 1, size = 10_000 }, b = { from = 0, to = 1, size = 1_001 }",
             ": found 10_010_000 values; expected at most 10_000_000 in one run"),
        ],
    )  # fmt: skip
    def test_in_a_dimension(self, folder, along, message):
        found = problems(changed(TIME, along), folder)
        assert f"model.outputs.infected.along{message}" in found

    @pytest.mark.parametrize(
        ("old", "new", "message"),
        [
            ("size = 5 } } }\nrecovered", "size = 6 } } }\nrecovered",
             'model.outputs.recovered.along.time: found other coordinates of "time" than above; '
             "expected the same in all outputs along it"),
            ('peak = "day-1"', 'peak = { unit = "day-1", may_end = true }',
             "model.outputs.peak.may_end: found an output along 0 dimensions; expected a curve, "
             "along one dimension"),
            ('unit = "1", ', "", "model.outputs.infected: found a table; expected a unit such as "
             '"cm", or "1" where there is none'),
            ("runs = 20",
             'runs = 20\n[outputs.infected]\nunit = "%"\nexceeds = [0.5]\nhold = [0.9]',
             'outputs.infected.hold: found a tolerance limit of "infected"; expected an output '
             "without dimensions; a field has hold_between"),
            ("runs = 20",
             'runs = 20\n[published.book]\nsource = "a book"\ninfected = { mean = 0.5 }',
             'published.book.infected.mean: found an estimate of "infected"; expected an output '
             "without dimensions"),
        ],
    )  # fmt: skip
    def test_elsewhere(self, folder, old, new, message):
        assert problems(changed(old, new), folder) == [message]

    def test_a_stopping_target(self, folder):
        target = 'at_most = 2000\nuntil = { infected = { mean = "1 %" } }'
        found = "designs.mc.until.infected: found an output with dimensions"
        assert f"{found}; expected an output that is a number" in problems(
            STUDY.replace("runs = 20", target), folder
        )

    def test_its_unit_is_no_mistake(self, folder):
        study = parsed(STUDY + '[outputs.infected]\nunit = "%"\n', folder)
        assert study.quantities_of_interest[0].display_unit == "%"

    def test_a_surrogate_of_a_field(self, folder):
        surrogate = '[surrogates.pce]\nkind = "polynomial-chaos"\ndesign = "mc"\n'
        assert parsed(STUDY + surrogate, folder).surrogates
        transformed = STUDY + surrogate + 'transform = { infected = "log" }\n'
        assert problems(transformed, folder) == [
            'surrogates.pce.transform.infected: found the logarithm of "infected", which has '
            "dimensions; expected a scalar output: a field is fitted as it is"
        ]

    def test_what_a_surrogate_will_not_fit_is_said_before_any_run(self, folder):
        surrogate = '[surrogates.pce]\nkind = "polynomial-chaos"\ndesign = "mc"\n'
        early = '[outputs.early]\nof = "infected"\ntake = "first_below"\nthreshold = 0.5\n'
        assert list(unfitted_lines(parsed(STUDY + early + surrogate, folder))) == [
            "surrogates of recovered, which may end: up to the place that all training curves "
            "reach, or along time scaled by the end of each, whichever predicts runs left out "
            "better",
            "a surrogate of early only if no run lacks it, as where infected never lies below 0.5",
        ]
        assert list(unfitted_lines(parsed(STUDY + early, folder))) == []

    def test_models_with_other_coordinates(self, folder):
        head, rest = STUDY.split("[model]\n")
        table, rest = rest.split("[inputs]\n")
        one = "[models.one]\n" + table.replace("[model.", "[models.one.")
        other = one.replace("models.one", "models.other").replace("to = 160", "to = 100")
        assert problems(f"{head}{one}{other}[inputs]\n{rest}", folder) == [
            f'models.other: found an output "{name}" with other dimensions or coordinates; '
            "expected those that it has in the first model"
            for name in ("infected", "recovered")
        ]


def sir(rate):
    time = np.linspace(0, 160, 5)
    return {"infected": np.exp(-rate * time), "peak": rate}


ALONG = {"time": {"unit": "day", "from": 0, "to": 160, "size": 5}}


class TestInPython:
    def study(self, **options):
        outputs = {
            "infected": uqpen.OutputSpec("1", along=ALONG, may_end=True),
            "peak": uqpen.OutputSpec("day-1", exceeds=["0.2 day-1"]),
        }
        given = {"model": sir, "outputs": outputs, **options}
        return uqpen.Study(
            inputs={"rate": uqpen.Uniform("0.1 day-1", "0.3 day-1")},
            designs={"mc": uqpen.MonteCarlo(runs=20)},
            seed=1,
            **given,
        )

    def test_a_bare_function_has_the_dimensions_of_the_outputs(self, folder):
        infected, peak = self.study().model.outputs
        text = STUDY.replace("}\nrecovered", ", may_end = true }\nrecovered")
        assert infected == parsed(text, folder).model.outputs[0]
        assert peak.dims == ()

    def test_its_text_is_read_back(self):
        study = self.study()
        again = uqpen.parse_study(study.to_toml(), objects={("model",): sir})
        assert again.model.outputs == study.model.outputs
        assert again.text == study.to_toml()

    def test_a_python_model_states_its_own(self):
        model = uqpen.PythonModel(
            sir,
            {"rate": "day-1"},
            {"infected": uqpen.OutputSpec("1", along=ALONG, may_end=True), "peak": "day-1"},
        )
        study = self.study(model=model, outputs={"peak": "day-1"})
        assert study.model.outputs == self.study().model.outputs

    def test_coordinates_may_be_an_array(self):
        along = {"time": {"unit": "day", "values": np.linspace(0, 160, 5)}}
        outputs = {"infected": uqpen.OutputSpec("1", along=along), "peak": "day-1"}
        infected = self.study(outputs=outputs).model.outputs[0]
        assert infected.dims == self.study().model.outputs[0].dims

    def test_a_mistake_names_the_argument(self):
        outputs = {"infected": uqpen.OutputSpec("1", along={"run": {"values": [1]}}), "peak": "1"}
        with pytest.raises(uqpen.StudyError) as refused:
            self.study(outputs=outputs)
        assert "a name that archives do not use themselves" in str(refused.value)

    def test_it_runs(self):
        runs = uqpen.run(self.study())["runs/mc"]
        assert runs["infected"].shape == (20, 5)
        assert runs["infected"].values[:, 0].tolist() == [1.0] * 20
