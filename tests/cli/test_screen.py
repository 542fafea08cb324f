"""Tables on terminals that lack characters, and commands that show no progress."""

import io
import re
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from study_text import study_text

from uqpen.cli.console import plain_table, show_table, standard_output
from uqpen.cli.messages import SPELLED_OUT, screen_text
from uqpen.cli.options import quiet_option
from uqpen.cli.progress import show_progress
from uqpen.cli.screen import show_answer, show_tables
from uqpen.report.sections.summary import summary_lines
from uqpen.results.table import OutputTable

STUDY = study_text(
    "ishigami",
    inputs={"x1": (-3, 3), "x2": 1, "x3": 1},
    designs={"some": {"kind": "monte-carlo", "runs": 20}},
)


@pytest.mark.parametrize("name", ["schema_1", "schema_1_several"])
def test_rules_are_as_long_as_the_rows_where_characters_are_spelled_out(
    name, archives, monkeypatch
):
    content = io.BytesIO()
    tree = archives[name]
    with monkeypatch.context() as patch:
        stream = io.TextIOWrapper(content, encoding="ascii", errors=SPELLED_OUT)
        patch.setattr(sys, "stdout", stream)
        patch.setenv("COLUMNS", "80")
        show_tables(tree)
        stream.flush()
    lines = content.getvalue().decode("ascii").splitlines()
    assert "..." in "".join(lines)
    assert max(map(len, lines)) <= 80
    rules = [number for number, line in enumerate(lines) if line and not line.strip("-")]
    assert rules
    for number in rules:
        heading, rule, first = lines[number - 1 : number + 2]
        assert len(heading) == len(rule) == len(first)


@pytest.mark.parametrize("columns", [30, 80])
def test_a_table_is_that_of_rich(columns, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(columns))
    rows = [("mean of 値", ["1.00 ± 0.12", "–"]), ("sd", ["0.5", "0.4 (0.3 … 0.5) and so on"])]
    names = ["first order\nof monte_carlo", "sobol"]
    show_table(standard_output(), OutputTable("y [m]", names, rows))
    shown = capsys.readouterr().out
    parts = [names] if columns == 80 else [[name] for name in names]
    for part in parts:
        cells = [(label, *(own[names.index(name)] for name in part)) for label, own in rows]
        standard_output().print(plain_table(["", *part], cells))
    assert shown == "\ny [m]\n" + capsys.readouterr().out


def test_a_long_label_is_wrapped_so_that_its_values_are_shown_whole(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "40")
    label = "probability of a larger sum of squares, if model and stated errors are right"
    show_table(standard_output(), OutputTable("fit", ["value"], [(label, ["0.3612"])]))
    shown = capsys.readouterr().out
    assert "0.3612" in shown
    assert "".join(shown.split()).replace("0.3612", "").endswith("".join(label.split()))


def test_a_quiet_study_shows_its_results_alone(command_line, tmp_path):
    (tmp_path / "small.toml").write_text(STUDY)
    loud = command_line("study", "small.toml", "-o", "loud.nc")
    quiet = command_line("study", "small.toml", "-o", "quiet.nc", "-q")
    assert "some: 20 runs in" in loud.err
    assert quiet.err == ""
    assert quiet.out.replace("quiet.nc", "loud.nc") == loud.out
    assert (tmp_path / "quiet.nc").read_bytes() == (tmp_path / "loud.nc").read_bytes()


def test_a_warning_is_shown_quietly_too():
    @click.command()
    @quiet_option
    def work():
        with show_progress() as progress:
            progress.start_design("some", 10)
            progress.count_restored(5)
            progress.warn("cold")

    assert CliRunner().invoke(work, ["-q"]).stderr == "warning: cold\n"
    assert CliRunner().invoke(work).stderr.startswith("some: 5 of 10 runs already done\n")


@pytest.mark.parametrize("name", ["schema_1", "schema_1_several", "beam"])
def test_the_answer_fits_a_screen_and_begins_with_what_was_asked(
    name, archives, monkeypatch, capsys
):
    monkeypatch.setenv("COLUMNS", "80")
    show_answer(archives[name], Path("archives/a b.nc"))
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 10, "two more say where archive and page are"
    assert max(map(len, lines)) <= 80
    assert lines[0] == screen_text(archives[name].attrs["title"])
    assert re.search(r", (limit|P\(|tolerance|median).*: ", lines[1]), lines[1]
    # The runs of several models are too few for a measure of their inputs.
    assert sum(line.startswith("drivers of ") for line in lines) == (name != "schema_1_several")
    assert re.fullmatch(r"tables.*: uqpen show 'archives/a b.nc'", lines[-1])


def test_the_answer_says_once_that_estimates_are_of_the_completed_runs(archives):
    failed = [line for line in summary_lines(archives["beam"]) if "completed" in line]
    assert failed == [
        "22 of 120 runs failed, mainly where load is high; estimates are of the completed runs."
    ]


def test_what_does_not_fit_the_answer_is_counted(archives, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "34")
    show_answer(archives["beam"], Path("a.nc"))
    _, _, below = capsys.readouterr().out.partition("中\n")  # the end of the title
    *lines, last = below.splitlines()
    assert len(lines) <= 8
    shown = sum(not line.startswith(" ") for line in lines)
    every = len(list(summary_lines(archives["beam"])))
    assert 0 < shown < every
    assert last == f"tables and {every - shown} more lines of results: uqpen show a.nc"
