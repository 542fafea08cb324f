"""``uqpen export`` and ``uqpen completion`` as their user meets them."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from click.testing import CliRunner

import uqpen
from uqpen.cli.export import export, table_format
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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "runs.xls"], "runs.xls: unknown ending; name --csv, --parquet or --json"),
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
