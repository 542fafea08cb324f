"""``uqpen export``: the runs or the statistics of an archive as a table for other programs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uqpen.cli.messages import show_message
from uqpen.cli.options import PATH
from uqpen.results import TABLE_FORMATS

if TYPE_CHECKING:
    import pandas as pd

# A table written to a file or to standard output, in the format that is named.


def alternatives(words: Iterable[str]) -> str:
    """Return words as a sentence lists them."""
    *most, last = words
    return f"{', '.join(most)} or {last}"


def format_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of the formats of a table, as its argument `kind`."""
    for name, each in reversed(TABLE_FORMATS.items()):
        command = click.option(f"--{name}", "kind", flag_value=name, help=each.help)(command)
    return command


def table_format(file: Path | None, kind: str | None = None) -> str:
    """Return the named format of a table, or else that of the file's ending, or else the first."""
    ending = file.suffix.removeprefix(".").lower() if file else ""
    kind = kind or ending or next(iter(TABLE_FORMATS))
    if kind not in TABLE_FORMATS:
        options = alternatives(f"--{name}" for name in TABLE_FORMATS)
        raise click.UsageError(f"{file}: unknown ending; name {options}")
    if TABLE_FORMATS[kind].needs_file and file is None:
        raise click.UsageError(f"--{kind} needs -o FILE")
    return kind


def write_file(file: Path, content: bytes | Iterable[bytes]) -> None:
    """Write a file, or replace it; an ExportError is raised if it cannot be written."""
    from uqpen.core.errors import ExportError
    from uqpen.core.files import replace_file

    try:
        replace_file(file, content)
    except OSError as error:
        raise ExportError(f"{file}: cannot be written: {error.strerror}") from None


def write_table(table: pd.DataFrame | Iterator[pd.DataFrame], kind: str, file: Path | None) -> None:
    """Write a table, or its parts one after the other; without a file, to standard output.

    An ExportError is raised if the file cannot be written, or no package for its format is
    installed.
    """
    from uqpen.cli.messages import printable
    from uqpen.core.errors import counted
    from uqpen.results.export import table_content

    rows = 0

    def parts() -> Iterator[pd.DataFrame]:
        nonlocal rows
        for part in table if isinstance(table, Iterator) else [table]:
            yield part
            rows += len(part)

    content = table_content(parts(), kind)
    if file is None:
        for text in map(bytes.decode, content):
            click.echo(printable(text) if sys.stdout.isatty() else text, nl=False)
        return
    write_file(file, content)
    click.echo(f"{counted(rows, 'row')}: {printable(str(file))}")


# The command.


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
    from uqpen.results.long_table import (
        designs_without_runs,
        has_runs,
        long_table,
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
