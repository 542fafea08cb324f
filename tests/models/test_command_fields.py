"""Programs whose outputs are fields: read from each kind of file, and lost with a place."""

import sys

import numpy as np
import pytest

import uqpen
from uqpen.core.errors import StudyError
from uqpen.core.status import Status
from uqpen.execution.processes import processes

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="programs run on POSIX only")

PROGRAM = """\
#!{python}
import json, sys
x = float(sys.argv[1])
{body}
"""
STUDY = """\
seed = 1
[model]
command = ["./program", "{{x}}"]
noise = false
{read}
[model.dimensions]
time = {{ unit = "min", values = [0, 1, 2] }}
depth = {{ values = [10, 20] }}
[model.inputs]
x = "1"
[model.outputs]
y = {{ unit = "cm", along = {along}{further} }}
[inputs]
x = {{ uniform = {{ lower = 1, upper = 2 }} }}
[designs.few]
kind = "monte-carlo"
runs = {runs}
[failures]
trial = false
stop_after = 0
"""
CSV = 'open("out.csv", "w").write("t,y\\n" + "".join(f"{t},{x + t}\\n" for t in range(3)))'


def study(folder, body, read="", along='["time"]', further="", runs=1):
    program = folder / "program"
    program.write_text(PROGRAM.format(python=sys.executable, body=body))
    program.chmod(0o755)
    text = STUDY.format(read=read, along=along, further=further, runs=runs)
    return uqpen.parse_study(text, folder=folder)  # type: ignore[return-value]


def made(folder, *arguments, **options):
    return uqpen.run(study(folder, *arguments, **options))["runs/few"].to_dataset()


def problems(folder, *arguments, **options):
    with pytest.raises(StudyError) as refused:
        study(folder, *arguments, **options)
    return [str(problem) for problem in refused.value.problems]


def check(runs, slope=1.0):
    assert not runs["status"].values.any()
    expected = (runs["x"].values[:, np.newaxis] + slope * np.arange(3)) / 100
    np.testing.assert_allclose(runs["y"].values, expected)
    assert runs["time"].values.tolist() == [0.0, 60.0, 120.0]


CURVES = {
    "csv": (CSV, 'read = { csv = "out.csv" }'),
    "table": (
        'open("out.dat", "w").write("# t y\\n" + "".join(f"{t} {x + t}\\n" for t in range(3)))',
        'read = { y = { table = "out.dat", column = "y" } }',
    ),
    "json": ('print(json.dumps({"y": [x, x + 1, x + 2]}))', ""),
    "text": ("for t in range(3): print('step', t, 'y =', x + t)",
             "read = { y = { text = \"stdout\", pattern = 'y = (\\S+)' } }"),
    "netcdf": ("import netCDF4\n" "with netCDF4.Dataset('out.nc', 'w') as d:\n"
               "    d.createDimension('t', 3)\n"
               "    d.createVariable('y', 'f8', ('t',))[:] = [x, x + 1, x + 2]",
               'read = { netcdf = "out.nc" }'),
}  # fmt: skip


@pytest.mark.parametrize("kind", CURVES)
def test_a_curve_is_read_whole(tmp_path, kind):
    check(made(tmp_path, *CURVES[kind]))


def test_two_dimensions_are_nested_lists_or_rows_in_order(tmp_path):
    nested = 'print(json.dumps({"y": [[x, 0], [1, 0], [2, 0]]}))'
    rows = 'print("y"); [print(v) for v in (x, 0, 1, 0, 2, 0)]'
    along = '["time", "depth"]'
    one = made(tmp_path, nested, along=along)
    other = made(tmp_path, rows, 'read = { csv = "stdout" }', along)
    assert one["y"].dims == ("run", "time", "depth")
    assert one["y"].values[0, :, 1].tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_array_equal(one["y"].values, other["y"].values)


LOST = [
    (CSV.replace("range(3)", "range(2)"),
     'column "y" in out.csv has 2 numbers, not 3 along (time)'),
    (CSV.replace('"t,y', '"t,z'), 'out.csv has no column "y"'),
    (CSV.replace("{x + t}", "{x if t != 1 else '-'}"),
     'row 1 of column "y" in out.csv is no number (time = 1 min)'),
    (CSV.replace("{x + t}", "{x if t != 1 else 'nan'}"), "y is nan at time = 1 min"),
    (CSV.replace("{t},{x + t}", "{t}"), 'there is no row 0 of column "y" in out.csv (time = 0'),
    ("", "wrote no out.csv"),
]  # fmt: skip


@pytest.mark.parametrize(("body", "reason"), LOST)
def test_a_lost_run_names_the_place(tmp_path, body, reason):
    runs = made(tmp_path, body, 'read = { csv = "out.csv" }')
    assert runs["lost_reason"].values[0].startswith(reason)
    expected = Status.NOT_FINITE if "nan" in reason else Status.FAILED
    assert runs["status"].values.tolist() == [expected]
    assert np.isnan(runs["y"].values).all()


def test_a_document_of_another_shape_is_named(tmp_path):
    runs = made(tmp_path, 'print(json.dumps({"y": [[1, 2]]}))')
    assert runs["lost_reason"].values.tolist() == [
        '"y" in stdout is of shape (1, 2), not (3,) along (time)'
    ]


def test_a_curve_that_may_end_has_fewer_rows(tmp_path):
    body = CSV.replace("range(3)", "range(2)")
    runs = made(tmp_path, body, 'read = { csv = "out.csv" }', further=", may_end = true")
    assert not runs["status"].values.any()
    assert np.isnan(runs["y"].values).tolist() == [[False, False, True]]


OWN = 'open("out.csv", "w").write("t,y\\n" + "".join(f"{t},{x + t * t}\\n" for t in (0, .5, 1, 3)))'
ON = ', on = { time = "t" }'


def test_a_grid_of_its_own_is_read_beside(tmp_path):
    runs = made(tmp_path, OWN, 'read = { csv = "out.csv" }', further=ON)
    assert not runs["status"].values.any()
    expected = (runs["x"].values[:, np.newaxis] + [0, 1, 5]) / 100
    np.testing.assert_allclose(runs["y"].values, expected)
    step = ', interpolation = "previous"'
    held = made(tmp_path, OWN, 'read = { csv = "out.csv" }', further=ON + step)
    np.testing.assert_allclose(held["y"].values - expected, [[0, 0, -0.04]], atol=1e-12)


def test_a_grid_that_is_too_short_is_named(tmp_path):
    body = OWN.replace("1, 3", "1, 1.5")
    runs = made(tmp_path, body, 'read = { csv = "out.csv" }', further=ON)
    assert runs["lost_reason"].values.tolist() == [
        'y is not there at time = 2 min: its own "t" ends at time = 1.5 min'
    ]


def test_a_choice_of_one_number_is_refused(tmp_path):
    read = 'read = { y = { csv = "out.csv", row = 2 } }'
    assert problems(tmp_path, CSV, read) == [
        "model.read.y.row: found a choice among the numbers of y; expected none: all of them are "
        "read, along its dimensions"
    ]


def test_coordinates_of_a_run_need_no_reading_of_an_output(tmp_path):
    read = 'read = { t = { csv = "out.csv" }, u = { csv = "out.csv" } }'
    assert problems(tmp_path, OWN, read, further=ON) == [
        "model.read.u: found an unknown output; expected known: t, y"
    ]


@pytest.mark.slow
@pytest.mark.processor
def test_workers_give_the_same_bytes(tmp_path):
    body = OWN.replace("1, 3", "1, 3 if x < 1.5 else 1.5")
    one = study(tmp_path, body, 'read = { csv = "out.csv" }', further=ON, runs=12)
    alone = uqpen.run(one)
    with processes(2) as pool:
        together = uqpen.run(one, map=pool)
    assert alone.identical(together)
    assert 0 < (alone["runs/few/status"].values == Status.FAILED).sum() < 12


@pytest.mark.slow
def test_kept_folders_are_read_again(tmp_path):
    wrong = study(tmp_path, CSV, 'read = { y = { csv = "out.csv", column = "u" } }')
    assert (uqpen.run(wrong)["runs/few/status"].values == Status.FAILED).all()
    right = study(tmp_path, CSV, 'read = { y = { csv = "out.csv" } }')
    model = right.model.reading_again()
    inputs = {"x": uqpen.run(wrong)["runs/few/x"].values}
    (tmp_path / "program").unlink()
    results = model.evaluate(inputs)
    assert not results.status.any()
    np.testing.assert_allclose(results.outputs["y"][:, 2], (inputs["x"] + 2) / 100)
