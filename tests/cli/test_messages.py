"""Messages on a terminal and in a pipe, and the options that commands share."""

import re
import sys
from contextlib import nullcontext

import click
import pytest
from click.testing import CliRunner

from uqpen.cli.messages import show_message, wrapped_message
from uqpen.cli.options import executor_option
from uqpen.execution import EXECUTORS, Executor, ExecutorDetail

WORDS = "a mean and a standard deviation, such as "


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "60")


@pytest.mark.usefixtures("terminal")
def test_a_line_is_wrapped_below_its_text():
    message = f"study.toml:3  y\n    found     3\n    expected  {WORDS * 3}"
    lines = wrapped_message(message).split("\n")
    assert lines[:2] == ["study.toml:3  y", "    found     3"]
    assert max(map(len, lines)) <= 60
    assert all(line.startswith(" " * 14) for line in lines[3:])
    assert " ".join(wrapped_message(message).split()) == " ".join(message.split())


@pytest.mark.usefixtures("terminal")
@pytest.mark.parametrize(
    "value", [f"/home/{'folder-of-mine/' * 6}study.nc", '"(2.5 ± 0.5) g/cm^3 of a long value"']
)
def test_neither_a_path_nor_a_value_is_broken(value):
    shown = wrapped_message(f"{WORDS}{value} {WORDS}")
    assert value in shown
    assert len(shown.split("\n")) > 1


def test_the_width_is_that_of_the_stream_of_a_message(monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: False)
    monkeypatch.setenv("COLUMNS", "60")
    assert wrapped_message(f"  {WORDS * 3}") == f"  {WORDS * 3}"
    lines = wrapped_message(f"  {WORDS * 3}", sys.stdout).split("\n")
    assert max(map(len, lines)) <= 60
    assert all(line.startswith("  ") for line in lines)


def test_where_a_program_reads_no_line_is_wrapped(capsys):
    show_message(f"{WORDS * 5}\x1b[31m")
    assert capsys.readouterr().err == f"{WORDS * 5}\\x1b[31m\n"


def test_an_executor_has_its_option_and_its_further_one(monkeypatch):
    detail = ExecutorDetail("queue", "NAME", "The queue.")
    batch = Executor(
        f"{__name__}:open_batch", "JOBS", "In jobs.", "submitting {} jobs", detail=detail
    )
    monkeypatch.setitem(EXECUTORS, "batch", batch)

    @click.command()
    @executor_option
    def command(executor):
        with executor.open_map() as spread:
            click.echo(f"{executor.preparation}; {spread}")

    def printed(*arguments):
        return CliRunner().invoke(command, arguments).output.strip()

    assert printed("--batch", "4", "--queue", "long") == "submitting 4 jobs; 4 in long"
    assert printed("--batch", "4") == "submitting 4 jobs; 4 in"
    assert printed("--workers", "1") == printed() == f"; {map}"
    assert "--workers and --batch exclude each other" in printed("--batch", "4", "--workers", "2")
    assert "--queue is for --batch" in printed("--queue", "long")
    assert re.search(r"--batch JOBS +In jobs.", printed("--help"))


def open_batch(jobs, queue):
    """Stand in for an executor: its map is a text on what it was given."""
    return nullcontext(f"{jobs} in {queue}")
