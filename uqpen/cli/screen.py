"""Tables of an archive on standard output."""

from __future__ import annotations

import shlex
import textwrap
from pathlib import Path

import xarray as xr
from rich.console import Console
from rich.text import Text

from uqpen.archive.read import group_names
from uqpen.cli.console import plain_table, show_table, standard_output
from uqpen.cli.messages import screen_text
from uqpen.core.errors import counted
from uqpen.core.labels import RUNS
from uqpen.core.status import STATUS_TEXT
from uqpen.results.failed_runs import failed_runs
from uqpen.results.field_tables import curve_tables, derived_lines, field_tables, place_option
from uqpen.results.noise import noise_lines
from uqpen.results.output_tables import output_tables
from uqpen.results.table import headed_models

# Reasons of lost runs that are shown; an archive holds them all.
_MOST_REASONS = 10
# Lines of the answer, below its title and above those that say where more is.
_ANSWER_LINES = 8


def show_answer(tree: xr.DataTree, archive: Path) -> None:
    """Show the main results in at most nine lines, and the command that shows the tables.

    A result that does not fit is left to the tables as a whole, and counted.
    """
    from uqpen.report.sections.summary import summary_lines  # tables need none of it

    console = standard_output()
    console.print(Text(screen_text(str(tree.attrs["title"])), style="bold"))
    every = [
        textwrap.wrap(text, console.width - 1, subsequent_indent="  ")
        for text in summary_lines(tree)
    ]
    left, omitted = _ANSWER_LINES, 0
    for lines in every:
        if len(lines) > left < _ANSWER_LINES:
            omitted += 1
            continue
        left -= len(lines)
        for line in lines:
            # Spaces at which no line ends have done their work.
            console.print(Text(screen_text(line.replace("\u00a0", " "))), soft_wrap=True)
    more = f" and {counted(omitted, 'more line')} of results" if omitted else ""
    command = shlex.join(["uqpen", "show", str(archive)])
    console.print(Text(screen_text(f"tables{more}: {command}")), soft_wrap=True)


def show_tables(tree: xr.DataTree, *, everything: bool = False) -> None:
    """Show a title, curves, a table for each other output, and the failed runs by reason."""
    console = standard_output()
    console.print(Text(screen_text(str(tree.attrs["title"])), style="bold"))
    # Shares and diagnostics of a curve say little without it.
    for table in (*curve_tables(tree), *field_tables(tree)):
        show_table(console, table)
    if option := place_option(tree):
        console.print(Text(f"\n{screen_text(option)}", style="dim"), soft_wrap=True)
    for table in output_tables(tree, everything=everything):
        show_table(console, table)
    models = headed_models(tree)
    lines = [
        f"{head}{line}"
        for head, each in models.items()
        for line in (*derived_lines(each), *noise_lines(each))
    ]
    if lines:
        console.print()
    for line in lines:
        console.print(Text(screen_text(line)))
    _show_failures(console, tree)
    console.print()


def _show_failures(console: Console, tree: xr.DataTree) -> None:
    found = [
        (head, failed)
        for head, model in headed_models(tree).items()
        for design in group_names(model, RUNS)
        for failed in failed_runs(model, design)
    ]
    if not found:
        return
    rows = [
        (head + failed.design, f"{failed.runs} {STATUS_TEXT[failed.status]}", failed.text)
        for head, failed in found[:_MOST_REASONS]
    ]
    console.print()
    console.print(plain_table(["design", "failed runs", "reason"], rows))
    if len(found) > len(rows):
        left = len(found) - len(rows)
        console.print(Text(f"and {counted(left, 'more reason')}", style="dim"))
