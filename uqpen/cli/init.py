"""``uqpen init``: a first study file of a user-defined model, or of a data file."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import click

from uqpen.cli.options import PATH

# Endings of data files. Another file may be the template of a program.
_DATA = (".csv", ".tsv", ".txt", ".dat", ".nc", ".parquet", ".xlsx")


@click.command(short_help="Write a first study file of a function, a program or a data file.")
@click.argument("source", required=False, metavar="[FILE.py[:FUNCTION] | DATA | TEMPLATE]")
@click.option("--command", metavar='"PROGRAM ARGUMENTS"', help="The program to run, as in a shell.")
@click.option("-o", "file", type=PATH, help="The study file to write.  [default: <model>.toml]")
def init(source: str | None, command: str | None, file: Path | None) -> None:
    """Write a commented study file of a Python function, of a program, or of runs in a file.

    Arguments of FUNCTION become inputs, and its defaults their nominal values. The file is parsed,
    not executed. A program has inputs by placeholders {name}, in its arguments or in TEMPLATE. DATA
    is a CSV, Excel, NetCDF, Parquet or Dakota file with a column for each input and output.

    \b
    uqpen init beam.py:deflection
    uqpen init beam.dat.template --command "./solver beam.dat"
    uqpen init runs.csv

    Lines to fill in are marked; `uqpen check` accepts the file as it is.
    """  # noqa: D301 - the \\b keeps the lines that follow it as they are
    from uqpen.cli.export import write_file
    from uqpen.cli.messages import printable
    from uqpen.core.errors import ExportError
    from uqpen.study.new_study import command_draft, data_draft, function_draft

    stem, colon, function = (source or "").rpartition(".py:")
    model = Path(f"{stem}.py" if colon else source or "")
    function = function if colon else ""
    is_data = command is None and model.suffix.lower() in _DATA
    if command is None and model.suffix != ".py" and not is_data:
        found = source or "nothing"
        expected = f"FILE.py:FUNCTION, a data file ({', '.join(_DATA)}), or --command"
        raise click.UsageError(f"found {found}; expected {expected}")
    if command is not None and function:
        raise click.UsageError("--command takes a template, not a function")
    try:
        words = shlex.split(command or "")
    except ValueError as error:
        raise click.UsageError(f"--command: found {command}: {error}") from None
    name = (function or model.stem) if command is None else Path((words or ["study"])[0]).stem
    file = file or Path(f"{name}.toml")
    if file.exists():
        raise ExportError(f"{file}: is there already; expected a new file (-o)")
    reference = Path(os.path.relpath(model, file.parent)).as_posix()
    if is_data:
        text = data_draft(model, reference).text(str(file))
    elif command is None:
        text = function_draft(model, function, reference).text(str(file))
    else:
        text = command_draft(words, model if source else None, reference).text(str(file))
    write_file(file, text.encode())
    shown = printable(str(file))
    click.echo(f"study: {shown}; fill in the marked lines, then:  uqpen check {shown}")
