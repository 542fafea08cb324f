"""How outputs with dimensions are shown: as lines, JSON, tables, and on the page."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import xarray as xr
from click.testing import CliRunner

import uqpen
from uqpen.cli.models import models
from uqpen.cli.run import run
from uqpen.cli.show import show
from uqpen.figures.page import available
from uqpen.report.page import report_page
from uqpen.results.field_texts import field_lines
from uqpen.results.html import archive_html
from uqpen.results.json import archive_json
from uqpen.results.long_table import long_table

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
LINES = [
    "sheet [cm]: along time [day] from 0 to 4 (3), level from 1 to 2 (2)",
    "not analysed: statistics take only scalar outputs",
]


def made(folder: Path, text: str) -> xr.DataTree:
    (folder / "model.py").write_text(MODEL)
    (folder / "study.toml").write_text(text)
    return uqpen.run(uqpen.load_study(folder / "study.toml"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fields")


@pytest.fixture(scope="module")
def mixed(folder: Path) -> xr.DataTree:
    """A field and a number."""
    return made(folder, STUDY)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> xr.DataTree:
    """A field and nothing else."""
    return made(tmp_path_factory.mktemp("alone"), STUDY.replace('y = "1"\n', ""))


def test_there_is_a_line_for_each_and_one_reason(mixed: xr.DataTree) -> None:
    assert list(field_lines(mixed)) == LINES


def test_of_several_models_lines_name_the_model(tmp_path: Path) -> None:
    head, rest = STUDY.split("[model]\n")
    table, rest = rest.split("[inputs]\n")
    one = "[models.one]\n" + table.replace("[model.", "[models.one.")
    text = f"{head}{one}{one.replace('models.one', 'models.other')}[inputs]\n{rest}"
    assert list(field_lines(made(tmp_path, text))) == [
        f"one: {LINES[0]}",
        f"other: {LINES[0]}",
        LINES[1],
    ]


def test_show_prints_them(mixed: xr.DataTree, alone: xr.DataTree, tmp_path: Path) -> None:
    for tree in (mixed, alone):
        uqpen.write(tree, tmp_path / "study.nc")
        shown = CliRunner().invoke(show, [str(tmp_path / "study.nc"), "--all"])
        assert shown.exit_code == 0
        for line in LINES:
            assert line in shown.output
    assert "mean" not in shown.output


def test_json_has_their_dimensions(mixed: xr.DataTree) -> None:
    outputs = json.loads(json.dumps(archive_json(mixed)))["designs"]["mc"]["outputs"]
    assert outputs["sheet"] == {
        "units": "m",
        "dimensions": {"time": {"size": 3, "units": "s"}, "level": {"size": 2, "units": "1"}},
    }
    assert "dimensions" not in outputs["y"]


def test_the_long_table_has_scalars_only(mixed: xr.DataTree, alone: xr.DataTree) -> None:
    assert set(long_table(mixed)["output"]) == {"y", ""}
    assert set(long_table(alone)["output"]) == {""}


def test_a_page_names_them(mixed: xr.DataTree, alone: xr.DataTree) -> None:
    for tree in (mixed, alone):
        page = report_page(tree)
        assert all(line in page for line in LINES)
        assert archive_html(tree)
        assert available(tree) is not None


def test_a_trial_run_gives_the_range(folder: Path, mixed: xr.DataTree) -> None:
    shown = CliRunner().invoke(run, [str(folder / "study.toml")])
    assert "0 to 4 along time (3), level (2)" in shown.output


def test_models_are_described_by_their_dimensions() -> None:
    shown = CliRunner().invoke(models, ["walker-anderson-trajectory"])
    assert {"nose_depth", "numbers", "elapsed_time"} <= set(shown.output.split())
