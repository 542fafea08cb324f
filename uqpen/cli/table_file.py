"""A table written to a file or to standard output, in the format that is named."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["table_format", "write_table"]


def table_format(file: Path | None, kind: str | None = None) -> str:
    """Return the format of a table: the one that is named, or that of a file's ending; else CSV."""
    from uqpen.results.export import FORMATS

    ending = file.suffix.removeprefix(".").lower() if file else ""
    kind = kind or (ending if ending in FORMATS else "csv" if not ending else None)
    if kind is None:
        raise click.UsageError(f"{file}: unknown ending; name --csv, --parquet or --json")
    return kind


def write_table(table: pd.DataFrame, kind: str, file: Path | None) -> None:
    """Write a table; without a file, to standard output.

    Raises
    ------
    ExportError
        If the file cannot be written, or no package for its format is installed.
    """
    from uqpen.cli.printable import printable
    from uqpen.core.errors import ExportError
    from uqpen.core.files import replace_file
    from uqpen.results.export import table_bytes

    content = table_bytes(table, kind)
    if file is None:
        text = content.decode()
        click.echo(printable(text) if sys.stdout.isatty() else text, nl=False)
        return
    try:
        replace_file(file, content)
    except OSError as error:
        raise ExportError(f"{file}: cannot be written: {error.strerror}") from None
    click.echo(f"{len(table)} rows: {printable(str(file))}")
