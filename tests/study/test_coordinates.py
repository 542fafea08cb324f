"""Coordinates of dimensions: shared, in a file, and in the model's code."""

import netCDF4
import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.core.errors import StudyError

MODEL = """\
import numpy as np
TIMES = np.array([0, 1, 4.0])
WRONG = [0, 2, 1]
def times():
    return [0, 1, 4]
def simulate(x):
    return {"y": x * TIMES, "z": np.outer(TIMES, [x, x]), "t": TIMES}
"""
STUDY = """\
seed = 1
[model]
python = "model.py:simulate"
[model.dimensions]
time = {time}
place = {{ values = [1, 2] }}
[model.inputs]
x = "1"
[model.outputs]
y = {{ unit = "1", along = ["time"]{further} }}
z = {{ unit = "1", along = ["time", "place"] }}
[inputs]
x = {{ uniform = {{ lower = 1, upper = 2 }} }}
[designs.few]
kind = "monte-carlo"
runs = 4
"""
MINUTES = (0.0, 60.0, 240.0)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "model.py").write_text(MODEL)
    (tmp_path / "times.csv").write_text("time [min],n\n0,1\n1,2\n4,3\n")
    (tmp_path / "plain.csv").write_text("time\n0\n1\n4\n")
    (tmp_path / "times.dat").write_text("# n time\n1 0.0\n2 1.0\n3 4.0D0\n")
    (tmp_path / "bare.txt").write_text("0\n1\n4\n")
    (tmp_path / "wrong.csv").write_text("time [min],text\n0,a\n4,b\n1,c\n")
    with netCDF4.Dataset(tmp_path / "times.nc", "w") as dataset:
        dataset.createDimension("n", 3)
        variable = dataset.createVariable("time", "f8", ("n",))
        variable.units = "min"
        variable[:] = [0, 1, 4]
    return tmp_path


def parsed(folder, time, further="", **options):
    text = STUDY.format(time=time, further=further)
    return uqpen.parse_study(text, folder=folder, **options)


def problems(folder, time, further="", **options):
    with pytest.raises(StudyError) as refused:
        parsed(folder, time, further, **options)
    return [str(problem) for problem in refused.value.problems]


SOURCES = [
    '{ file = "times.csv", column = "time" }',
    '{ file = "times.csv", column = "time [min]" }',
    '{ unit = "min", file = "plain.csv" }',
    '{ unit = "min", file = "times.dat", column = "time" }',
    '{ unit = "min", file = "times.dat", column = 1 }',
    '{ unit = "min", file = "bare.txt" }',
    '{ file = "times.nc", column = "time" }',
    '{ unit = "min", from_model = "TIMES" }',
    '{ unit = "min", from_model = "times" }',
]


class TestSources:
    @pytest.mark.parametrize("time", SOURCES)
    def test_they_say_the_same(self, folder, time):
        y, z = parsed(folder, time).model.outputs
        assert y.dims[0].values == MINUTES
        assert y.dims[0].display_unit == "min"
        assert z.dims[0] == y.dims[0]

    def test_the_unit_of_a_file_may_be_shown_in_another(self, folder):
        time = parsed(folder, '{ unit = "h", file = "times.nc" }').model.outputs[0].dims[0]
        assert (time.values, time.display_unit) == (MINUTES, "h")

    def test_a_file_is_part_of_the_study_and_its_archive(self, folder):
        study = parsed(folder, SOURCES[0])
        assert "times.csv" in {file.path.name for file in study.files()}
        tree = uqpen.run(study)
        assert "times.csv" in tree["files"]["name"].values
        assert tree["runs/few/time"].values.tolist() == list(MINUTES)

    def test_a_model_is_asked_once(self, folder):
        log = folder / "loads"
        text = f'{MODEL}\nwith open(r"{log}", "a") as log:\n    log.write("loaded ")\n'
        (folder / "model.py").write_text(text)
        parsed(folder, SOURCES[-1])
        assert log.read_text().split() == ["loaded"]


class TestMistakes:
    @pytest.mark.parametrize(
        ("time", "message"),
        [
            ('{ file = "none.csv" }',
             '.file: found there is no file "{folder}/none.csv"; expected a CSV, NetCDF or '
             "blank-separated file with a column of coordinates"),
            ('{ file = "times.csv" }',
             '.file: found "times.csv" has the columns time [min], n; expected a CSV,'),
            ('{ file = "times.csv", column = 1 }',
             '.file: found "times.csv" has columns with headings; expected a CSV,'),
            ('{ file = "wrong.csv", column = "text" }',
             '.file: found "wrong.csv", line 2, column "text": found "a", expected a number;'),
            ('{ file = "wrong.csv", column = "time" }',
             '.file: found 1 at position 2 of column "time [min]" of "wrong.csv"; expected '
             "finite numbers in ascending order"),
            ('{ file = "times.dat", column = "n" , unit = "dya" }',
             '.unit: found "dya", which is not a known unit;'),
            ('{ file = "times.dat" }', '.file: found "times.dat" has several columns;'),
            ('{ file = "times.dat", column = 5 }',
             '.file: found row 0 of column 5 of "times.dat" is no number;'),
            ('{ unit = "kg", file = "times.csv", column = "time" }',
             '.file: found "times.csv", column "time" is in "min"; expected a mass,'),
            ('{ from_model = "TIME" }',
             '.from_model: found "TIME", which is not there; expected coordinates in the '
             "model's file or module, or a function that returns them"),
            ('{ from_model = "WRONG" }',
             '.from_model: found 1 at position 2 of "WRONG"; expected finite numbers in'),
            ('{ from_model = "simulate" }',
             '.from_model: found "simulate": TypeError: simulate() missing 1 required'),
            ('{ from_model = "np" }',
             '.from_model: found "np": ValueError: module in place of a number;'),
            ('{ column = "time" }',
             ": found column; expected either from, to and size, or values, or file, or"),
        ],
    )  # fmt: skip
    def test_of_a_source(self, folder, time, message):
        (found,) = problems(folder, time)
        assert found.startswith(f"model.dimensions.time{message.replace('{folder}', str(folder))}")

    def test_an_unknown_dimension(self, folder):
        text = STUDY.format(time=SOURCES[0], further="").replace('["time"]', '["tme", 3]')
        with pytest.raises(StudyError) as refused:
            uqpen.parse_study(text, folder=folder)
        known = "expected a dimension of [model.dimensions];"
        assert [str(problem) for problem in refused.value.problems] == [
            f'model.outputs.y.along[0]: found "tme"; {known} did you mean "time"? known: time, '
            "place",
            f"model.outputs.y.along[1]: found 3; {known} known: time, place",
        ]
        assert "study.toml:10  model.outputs.y.along[0]" in str(refused.value)

    @pytest.mark.parametrize(
        "model", ['command = ["sh", "{x}"]', 'umbridge = "http://127.0.0.1:1"']
    )
    def test_only_code_is_asked(self, folder, model):
        text = STUDY.format(time=SOURCES[-1], further="")
        with pytest.raises(StudyError) as refused:
            uqpen.parse_study(text.replace('python = "model.py:simulate"', model), folder=folder)
        assert [str(problem) for problem in refused.value.problems] == [
            'model.dimensions.time.from_model: found "times"; expected values or a file: only a '
            "Python function of a file or a module can be asked"
        ]


class TestGrids:
    @pytest.mark.parametrize(
        ("further", "message"),
        [
            (', on = { time = "t" }, interpolation = "spline"',
             '.interpolation: found "spline"; expected one of "linear", "cubic", "previous", '
             '"none"'),
            (', interpolation = "cubic"',
             ".on: found nothing; expected coordinates of the run's own, such as on = { time = "
             '"t" }'),
            (', on = { place = "t" }', '.on.place: found "place"; expected a dimension of y: time'),
            (', on = { time = "x" }',
             '.on.time: found "x"; expected the name of a run\'s own coordinates, which no '
             'input or output has: "t" or "t [s]"'),
            (', on = { time = "t [kg]" }',
             '.on.time: found "t [kg]"; expected a time, such as "10 s"'),
            (', on = { time = "t [" }',
             '.on.time: found "t ["; expected the name of a run\'s own coordinates, which no '
             'input or output has: "t" or "t [s]"'),
        ],
    )  # fmt: skip
    def test_a_mistake_is_met(self, folder, further, message):
        assert problems(folder, SOURCES[0], further) == [f"model.outputs.y{message}"]

    def test_a_vectorised_function_has_none(self, folder):
        text = STUDY.format(time=SOURCES[0], further=', on = { time = "t" }')
        text = text.replace('simulate"\n', 'simulate"\nvectorized = true\n')
        with pytest.raises(StudyError, match="vectorized = false, so that each run is a call"):
            uqpen.parse_study(text, folder=folder)

    def test_a_function_returns_its_steps(self, folder):
        further = ', on = { time = "t" }, interpolation = "none"'
        runs = uqpen.run(parsed(folder, SOURCES[0], further))["runs/few"]
        assert not runs["status"].values.any()
        short = MODEL.replace('"t": TIMES', '"t": TIMES[:2]')
        (folder / "model.py").write_text(short)
        study = parsed(folder, SOURCES[0], further)
        results = study.model.evaluate({"x": np.array([1.0])})
        assert results.reasons == {0: 'returned 3 values of "y" at 2 of "t"'}
        (folder / "model.py").write_text(MODEL.replace(', "t": TIMES', ""))
        results = parsed(folder, SOURCES[0], further).model.evaluate({"x": np.array([1.0])})
        assert results.reasons == {0: 'returned no "t", but "y", "z"'}


@pytest.mark.parametrize("time", [SOURCES[0], SOURCES[-1]])
def test_an_archive_is_checked_without_its_code(folder, time, command_line):
    uqpen.make_archive(parsed(folder, time), folder / "archive.nc")
    for file in ("model.py", "times.csv"):
        (folder / file).unlink()
    checked = command_line("verify", str(folder / "archive.nc"))
    assert checked.code == 0
    assert "computed again: bit-equal" in checked.said
    trusted = command_line("verify", str(folder / "archive.nc"), "--trust")
    assert "4 of 4 repeated: bit-equal" in trusted.said


def test_without_an_archive_and_trust_coordinates_are_not_known(folder):
    assert parsed(folder, SOURCES[0], trust=False).model.outputs[0].dims[0].values == MINUTES
    (found,) = problems(folder, SOURCES[-1], trust=False)
    assert found.startswith(
        'model.dimensions.time.from_model: found "times": model.py:simulate is not executed '
        "without --trust;"
    )


def test_other_coordinates_in_a_file_are_another_study(folder):
    path = folder / "archive.nc"
    uqpen.make_archive(parsed(folder, SOURCES[0]), path)
    (folder / "times.csv").write_text("time [min],n\n0,1\n1,2\n5,3\n")
    uqpen.make_archive(parsed(folder, SOURCES[0]), path)
    with xr.open_dataset(path, group="runs/few") as runs:
        assert runs["time"].values[-1] == 300.0


class TestInPython:
    def test_dimensions_are_shared_and_runs_have_a_grid(self):
        def decay(rate):
            steps = np.linspace(0, 3, 7)
            return {"mass": np.exp(-rate * steps), "rest": 1 - np.exp(-rate * steps), "t": steps}

        along = uqpen.OutputSpec("1", along=["time"], on={"time": "t"}, interpolation="previous")
        study = uqpen.Study(
            model=uqpen.PythonModel(
                decay,
                inputs={"rate": "min-1"},
                outputs={"mass": along, "rest": along},
                dimensions={"time": {"unit": "min", "values": np.arange(4)}},
            ),
            inputs={"rate": uqpen.Uniform("0.1 min-1", "0.2 min-1")},
            designs={"few": uqpen.MonteCarlo(runs=3)},
            seed=1,
        )
        runs = uqpen.run(study)["runs/few"]
        assert runs["time"].values.tolist() == [0.0, 60.0, 120.0, 180.0]
        rate = runs["rate"].values[:, np.newaxis] * 60
        np.testing.assert_allclose(runs["mass"].values, np.exp(-rate * np.arange(4)))

    def test_a_bare_function_takes_them_from_the_outputs(self):
        own = {"time": "t"}
        outputs = {"y": uqpen.OutputSpec("1", along={"time": {"values": [0, 1]}}, on=own)}
        study = uqpen.Study(
            model=lambda x: {"y": [x, 3 * x], "t": [0, 2]},
            inputs={"x": uqpen.Uniform(1, 2)},
            outputs=outputs,
            designs={"few": uqpen.MonteCarlo(runs=3)},
            seed=1,
        )
        runs = uqpen.run(study)["runs/few"]
        np.testing.assert_allclose(runs["y"].values[:, 1], 2 * runs["x"].values)
