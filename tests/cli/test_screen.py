"""Tables on terminals that lack characters, and commands that show no progress."""

import io
import sys

import click
import pytest
from click.testing import CliRunner
from study_text import study_text

from uqpen.cli.console import plain_table, show_table, standard_output
from uqpen.cli.messages import SPELLED_OUT
from uqpen.cli.options import quiet_option
from uqpen.cli.progress import show_progress
from uqpen.cli.screen import show_tables
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
