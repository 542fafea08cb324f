"""How outputs with dimensions are shown: as lines, JSON, tables, and on the page."""

import json

import pytest
import xarray as xr
from click.testing import CliRunner

import uqpen
from uqpen.cli.models import models
from uqpen.cli.run import run
from uqpen.cli.show import show
from uqpen.figures.page import available
from uqpen.report.page import report_page
from uqpen.results.archive import archive_html
from uqpen.results.digits import estimate_text
from uqpen.results.field_tables import (
    curve_tables,
    field_lines,
    field_tables,
    place_option,
    select_output,
)
from uqpen.results.json import archive_json
from uqpen.results.long_table import long_table
from uqpen.results.output_tables import output_tables

MODEL = """\
def simulate(x):
    return {"sheet": [[x, x + 1], [1, 2], [3, 4]], "y": x}
"""
STUDY = """\
seed = 11
[model]
python = "model.py:simulate"
[model.inputs]
x = "1"
[model.outputs]
y = "1"
[model.outputs.sheet]
unit = "cm"
[model.outputs.sheet.along]
time = { unit = "day", values = [0, 1, 4] }
level = { values = [1, 2] }
[inputs]
x = "0 ± 1"
[designs.mc]
kind = "monte-carlo"
runs = 30
"""
HEAD = "sheet [cm]: along time [day] from 0 to 4 (3), level from 1 to 2 (2)"


def made(folder, text):
    (folder / "model.py").write_text(MODEL)
    (folder / "study.toml").write_text(text)
    return uqpen.run(uqpen.load_study(folder / "study.toml"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fields")


@pytest.fixture(scope="module")
def mixed(folder):
    """A field and a number."""
    return made(folder, STUDY)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """A field and nothing else."""
    return made(tmp_path_factory.mktemp("alone"), STUDY.replace('y = "1"\n', ""))


def test_there_is_a_line_for_each_with_its_range(mixed):
    y = mixed["statistics/mc/y"].to_dataset()
    mean = estimate_text(*y["mean"].values.tolist())
    sd = estimate_text(*y["std"].values.tolist())
    assert list(field_lines(mixed)) == [
        f"{HEAD}; by mc mean from {mean} at time = 0 day, level = 1 to 4 at time = 4 day, "
        f"level = 2, sd at most {sd} at time = 0 day, level = 1"
    ]


def test_a_field_without_statistics_has_its_dimensions(mixed):
    tree = mixed.copy()
    tree["statistics/mc/sheet"] = xr.Dataset()
    assert list(field_lines(tree)) == [HEAD]


def test_of_several_models_lines_name_the_model(tmp_path):
    head, rest = STUDY.split("[model]\n")
    table, rest = rest.split("[inputs]\n")
    one = "[models.one]\n" + table.replace("[model.", "[models.one.")
    text = f"{head}{one}{one.replace('models.one', 'models.other')}[inputs]\n{rest}"
    lines = list(field_lines(made(tmp_path, text)))
    assert [line.partition(";")[0] for line in lines] == [f"one: {HEAD}", f"other: {HEAD}"]


def test_show_prints_them(mixed, alone, tmp_path):
    for tree in (mixed, alone):
        uqpen.write(tree, tmp_path / "study.nc")
        shown = CliRunner().invoke(show, [str(tmp_path / "study.nc"), "--all"])
        assert shown.exit_code == 0
        assert (
            "\nalong time [day] from 0 to 4 (3), level from 1 to 2 (2); mean by mc\n"
            in shown.output
        )
        assert "\nsheet [cm] " in shown.output
        assert max(map(len, shown.output.splitlines())) <= 80
    assert "quantile" not in shown.output


def test_fields_along_the_same_dimensions_share_a_table(mixed):
    (table,) = field_tables(mixed)
    y = mixed["statistics/mc/y"].to_dataset()
    ((label, (smallest, largest)),) = table.rows
    assert label == "sheet [cm]"
    assert smallest.startswith(estimate_text(*y["mean"].values.tolist()))
    assert largest == "4"


CURVE = """\
seed = 3
[model]
python = "curve.py:simulate"
inputs = { x = "1" }
[model.dimensions]
time = { unit = "day", from = 0, to = 10, size = 11 }
[model.outputs]
z = { unit = "cm", along = ["time"] }
[inputs]
x = { uniform = { lower = 0, upper = 1 } }
[designs.mc]
kind = "monte-carlo"
runs = 50
"""


def test_a_curve_has_a_table_at_five_places(tmp_path):
    code = "def simulate(x):\n    return {'z': [x * time for time in range(11)]}\n"
    (tmp_path / "curve.py").write_text(code)
    tree = uqpen.run(uqpen.parse_study(CURVE, folder=tmp_path))
    (table,) = curve_tables(tree)
    assert table.title == "z [cm] along time, by mc"
    assert table.columns == ["mean", "5 % quantile", "median", "95 % quantile"]
    days = [0, 2, 5, 7, 10]
    assert [place for place, _ in table.rows] == [f"time = {day} day" for day in days]
    mean = 100 * tree["statistics/mc/z"]["mean"].values
    for day, (_, cells) in zip(days[1:], table.rows[1:], strict=True):
        assert cells[0].startswith(estimate_text(*mean[day].tolist()))
    cut, _ = select_output(tree, "z", ["time=2 day"])
    assert [*curve_tables(cut)] == []
    uqpen.write(tree, tmp_path / "study.nc")
    shown = CliRunner().invoke(show, [str(tmp_path / "study.nc")]).output
    assert "\nz [cm] along time, by mc\n" in shown
    command = 'uqpen show ARCHIVE --output z --at "time=10 day"'
    assert f"\nall statistics at any place:\n  {command}\n" in shown


def test_where_curves_end_the_share_that_gets_there_stands_beside_statistics(tmp_path):
    # Twelve of the fifty runs of equal chance reach the last day, those of the highest curves.
    code = (
        "def simulate(x):\n"
        "    return {'z': [x + 1 if time <= 5 or x > 0.75 else None for time in range(11)]}\n"
    )
    (tmp_path / "curve.py").write_text(code.replace("None", "float('nan')"))
    text = CURVE.replace('along = ["time"]', 'along = ["time"], may_end = true')
    tree = uqpen.run(uqpen.parse_study(text, folder=tmp_path))
    share = float(tree["statistics/mc/z"]["reached"].values[-1, 0])
    assert 0.1 < share < 0.4
    (table,) = curve_tables(tree)
    assert table.columns == ["P(reached)", "mean", "5 % quantile", "median", "95 % quantile"]
    assert [cells[0].split()[0] for _, cells in table.rows][:3] == ["1.000"] * 3
    last = tree["statistics/mc/z"]["reached"].values[-1]
    assert table.rows[-1][1][0].startswith(estimate_text(*last.tolist()))
    (line,) = field_lines(tree)
    reached = f"(the {100 * share:.2g} % of the curves that get there)"
    assert f"at time = 6 day {reached}, sd at most" in line
    assert f"time\u00a0=\u00a06\u00a0day {reached}: " in report_page(tree)


def test_a_field_with_several_dimensions_has_no_table_of_places(mixed):
    assert [*curve_tables(mixed)] == []
    assert place_option(mixed).endswith('--output sheet --at "time=4 day" --at "level=2"')


def test_a_field_without_a_mean_has_a_row(mixed):
    tree = mixed.copy()
    tree["statistics/mc/sheet"] = xr.Dataset()
    (table,) = field_tables(tree)
    assert table.rows == [("sheet [cm]", ["–", "–"])]


def test_shares_over_a_field_that_is_cut_say_what_of(tmp_path):
    (tmp_path / "model.py").write_text(
        "def simulate(x, z):\n    return {'sheet': [[x, z], [x + z, 2 * z], [x, z]]}\n"
    )
    text = STUDY.replace('y = "1"\n', "").replace('x = "1"', 'x = "1"\nz = "1"')
    text = text.replace('x = "0 ± 1"', 'x = "0 ± 1"\nz = "0 ± 1"').replace("= 30", "= 100")
    tree = uqpen.run(uqpen.parse_study(text, folder=tmp_path))
    for at, over in (([], "all places"), (["level=2"], "the whole field, not only at level = 2")):
        cut, _ = select_output(tree, "sheet", at)
        assert f"sheet: shares of its variance over {over}" in [
            table.title for table in output_tables(cut)
        ]


def test_json_has_their_dimensions(mixed):
    outputs = json.loads(json.dumps(archive_json(mixed)))["designs"]["mc"]["outputs"]
    assert outputs["sheet"]["dimensions"] == {
        "time": {"size": 3, "units": "s", "coordinates": [0.0, 86_400.0, 345_600.0]},
        "level": {"size": 2, "units": "1", "coordinates": [1.0, 2.0]},
    }
    assert "dimensions" not in outputs["y"]


def test_json_has_lists_along_them(mixed):
    outputs = json.loads(json.dumps(archive_json(mixed)))["designs"]["mc"]["outputs"]
    field, number = outputs["sheet"], outputs["y"]
    for name in ("mean", "std"):
        assert field[name]["estimate"][0][0] == pytest.approx(number[name]["estimate"] / 100)
        assert [len(row) for row in field[name]["upper"]] == [2, 2, 2]
    # One text for all places, or one for each.
    assert field["std"]["interval_label"] == number["std"]["interval_label"]
    constant = {text for row in field["mean"]["note"][1:] for text in row}
    assert field["mean"]["note"][0] == 2 * [number["mean"]["note"]]
    assert number["mean"]["note"] not in constant
    assert field["quantiles"].keys() == number["quantiles"].keys()
    assert field["quantiles"]["0.5"]["estimate"][1:] == [[0.01, 0.02], [0.03, 0.04]]


def test_the_long_table_has_a_row_for_each_place(mixed):
    table = long_table(mixed).query("output == 'sheet' and statistic == 'mean'")
    assert table["time"].tolist() == [0.0, 0.0, 86_400.0, 86_400.0, 345_600.0, 345_600.0]
    assert table["level"].tolist() == [1.0, 2.0] * 3
    assert table["coordinates"].iloc[-1] == "time=345600.0, level=2.0"
    assert table["estimate"].iloc[-1] == 0.04


def test_a_page_names_them(mixed, alone):
    for tree in (mixed, alone):
        page = report_page(tree)
        assert HEAD in page
        assert HEAD in archive_html(tree)
        assert available(tree) is not None


def test_a_trial_run_gives_the_range(folder, mixed):
    shown = CliRunner().invoke(run, [str(folder / "study.toml")])
    assert "0 to 4 along time (3), level (2)" in shown.output


def test_models_are_described_by_their_dimensions():
    shown = CliRunner().invoke(models, ["walker-anderson-trajectory"])
    assert {"nose_depth", "numbers", "elapsed_time"} <= set(shown.output.split())
