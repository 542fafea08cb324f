"""``uqpen export``: the runs or the statistics of an archive as a table for other programs."""

from __future__ import annotations

from pathlib import Path

import click

from uqpen.cli.messages import show_message
from uqpen.cli.options import PATH
from uqpen.cli.table_file import alternatives, format_options, table_format, write_table
from uqpen.results import TABLE_FORMATS

__all__ = ["export"]


_TITLES = alternatives(each.title for each in TABLE_FORMATS.values())


@click.command(short_help=f"Write the runs or statistics of an archive as {_TITLES}.")
@click.argument("archive", type=PATH)
@click.option("--statistics", "what", flag_value="statistics", default=True, help="Every estimate.")
@click.option("--runs", "what", flag_value="runs", help="Every run.")
@format_options
@click.option("--si", is_flag=True, help="Runs in SI units, to the bit as in ARCHIVE.")
@click.option("--functions", is_flag=True, help="Distribution functions among the statistics.")
@click.option("-o", "file", type=PATH, help="The file to write; its ending names the format.")
def export(
    archive: Path, what: str, kind: str | None, si: bool, functions: bool, file: Path | None
) -> None:
    """Write the statistics of ARCHIVE, or its runs, as one table; nothing is run.

    Columns of runs are headed "name [unit]" in the units of the study. Estimates are in SI units,
    with a column for the unit. Without -o, the table goes to standard output.
    """
    from uqpen.archive.read import is_benchmark, open_archive
    from uqpen.core.errors import ExportError
    from uqpen.results.long_table import long_table
    from uqpen.results.runs_table import (
        designs_without_runs,
        has_runs,
        run_table_parts,
    )

    kind = table_format(file, kind)
    if si and what != "runs":
        raise click.UsageError("--si is for --runs; estimates are in SI units")
    if functions and what == "runs":
        raise click.UsageError("--functions is for --statistics")
    tree = open_archive(archive)
    if what != "runs":
        write_table(long_table(tree, functions=functions), kind, file)
        return
    if is_benchmark(tree):
        raise ExportError(f"{archive}: is a benchmark of methods, which keeps no runs")
    if designs := designs_without_runs(tree):
        text = f"{archive}: the runs of {', '.join(designs)} are not in it, only their statistics"
        if not has_runs(tree):
            raise ExportError(text)
        show_message(text)
    write_table(run_table_parts(tree, si=si), kind, file)
