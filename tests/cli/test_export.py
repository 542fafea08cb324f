"""``uqpen export`` and ``uqpen completion`` as their user meets them."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import uqpen
from uqpen.cli.export import export, table_format
from uqpen.core.columns import read_columns
from uqpen.core.errors import TableError
from uqpen.results import TABLE_FORMATS
from uqpen.results.export import table_content

STUDY = """
    seed = 1
    [model]
    use = "ishigami"
    [inputs]
    x1 = { uniform = { lower = -3, upper = 3 } }
    x2 = 1
    x3 = 1
    [designs.draws]
    kind = "monte-carlo"
    runs = 20
"""


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("export") / "small.nc"
    uqpen.make_archive(uqpen.parse_study(STUDY), path)
    return path


def _export(*arguments):
    return CliRunner().invoke(export, [*map(str, arguments)])


def test_the_statistics_go_to_standard_output_as_csv(archive):
    done = _export(archive)
    heading, first, *_ = done.stdout.splitlines()
    assert heading.startswith("model,source,kind,output,statistic")
    assert first.startswith(",draws,design,y,mean")


def test_runs_are_written_to_a_file_in_the_format_of_its_ending(archive, tmp_path):
    path = tmp_path / "runs.json"
    done = _export(archive, "--runs", "-o", path)
    assert done.output == f"20 rows: {path}\n"
    assert [*json.loads(path.read_text())[0]] == [
        *("design", "run", "x1", "x2", "x3", "y", "status", "reason")
    ]


def test_no_text_is_a_formula_of_a_spreadsheet(tmp_path):
    """What fails may say anything; thresholds and numbers stay as they are."""
    texts = [
        '=HYPERLINK("a")',
        "+1+cmd|' /C calc'!A0",
        "@SUM(1)",
        "\t=1",
        "-x",
        "-5 mm",
        "-1",
        "a=1",
    ]
    frame = pd.DataFrame({"reason": [*texts, None], "x": [-1.5] * 9})
    (content,) = table_content([frame], "csv")
    read = pd.read_csv(io.BytesIO(content), keep_default_na=False)
    formulas = [f"'{text}" for text in texts[:5]]
    assert read["reason"].tolist() == [*formulas, *texts[5:], ""]
    assert read["x"].tolist() == [-1.5] * 9
    assert b'"=HYPERLINK' in b"".join(table_content([frame], "json")).replace(b"\\", b"")


def test_excel_has_the_headings_of_csv_and_no_formula(archive, tmp_path, monkeypatch):
    openpyxl = pytest.importorskip("openpyxl", reason="there is no openpyxl here")
    for number in (1, 2):
        done = _export(archive, "--runs", "-o", tmp_path / f"{number}.xlsx")
        assert done.output == f"20 rows: {tmp_path / f'{number}.xlsx'}\n"
    assert (tmp_path / "1.xlsx").read_bytes() == (tmp_path / "2.xlsx").read_bytes()
    found = pd.read_excel(tmp_path / "1.xlsx")
    expected = pd.read_csv(io.StringIO(_export(archive, "--runs").stdout))
    pd.testing.assert_frame_equal(found, expected, rtol=1e-15, check_dtype=False)
    odd = {"a [mm]": ["=1+1", "\x07", None], "b": [np.inf, np.nan, 0.1], "c": [True, False, True]}
    (content,) = table_content([pd.DataFrame(odd)], "xlsx")
    sheet = openpyxl.load_workbook(io.BytesIO(content)).worksheets[0]
    cells = [[cell.value for cell in row] for row in sheet.iter_rows()]
    assert cells[1:] == [
        ["=1+1", "inf", True],
        ["\N{REPLACEMENT CHARACTER}", None, False],
        [None, 0.1, True],
    ]
    assert sheet["A2"].data_type == "s"
    # Points of a surrogate, or of a design, may stand in such a file.
    (column,) = read_columns(tmp_path / "1.xlsx", {}).columns[2:3]
    assert column.values("1") == pytest.approx(expected["x1"], rel=1e-15)
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    assert "pip install uqpen[excel]" in str(_export(archive, "-o", tmp_path / "3.xlsx").exception)
    with pytest.raises(TableError, match="needs openpyxl: pip install"):
        read_columns(tmp_path / "1.xlsx")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "runs.xls"], "runs.xls: unknown ending; name --csv, --parquet, --xlsx or --json"),
        (["--parquet"], "--parquet needs -o FILE"),
        (["--si"], "--si is for --runs; estimates are in SI units"),
        (["--runs", "--functions"], "--functions is for --statistics"),
    ],
)
def test_options_that_do_not_fit_are_refused(archive, arguments, message):
    done = _export(archive, *arguments)
    assert done.exit_code == 2
    assert message in done.output


@pytest.mark.slow
def test_a_shell_is_answered(command_line):
    assert command_line("completion").err.endswith(
        "Missing argument '{bash|zsh|fish}'. Choose from:\n  bash,\n  zsh,\n  fish\n"
    )
    script = command_line("completion", "bash").out
    assert "_UQPEN_COMPLETE=bash_complete" in script
    asked = {"_UQPEN_COMPLETE": "bash_complete", "COMP_WORDS": "uqpen exp", "COMP_CWORD": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "uqpen"],
        env={**os.environ, **asked},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "plain,export\n"


@pytest.mark.parametrize("kind", TABLE_FORMATS)
def test_the_ending_of_a_file_names_each_format(kind):
    assert table_format(Path(f"table.{kind.upper()}")) == kind
