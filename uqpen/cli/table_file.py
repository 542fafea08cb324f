"""A table written to a file or to standard output, in the format that is named."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uqpen.results import TABLE_FORMATS

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["alternatives", "format_options", "table_format", "write_table"]


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


def write_table(table: pd.DataFrame | Iterator[pd.DataFrame], kind: str, file: Path | None) -> None:
    """Write a table, or its parts one after the other; without a file, to standard output.

    Raises
    ------
    ExportError
        If the file cannot be written, or no package for its format is installed.
    """
    from uqpen.cli.printable import printable
    from uqpen.core.errors import ExportError
    from uqpen.core.files import replace_file
    from uqpen.results.export import table_content

    rows = 0

    def counted() -> Iterator[pd.DataFrame]:
        nonlocal rows
        for part in table if isinstance(table, Iterator) else [table]:
            yield part
            rows += len(part)

    content = table_content(counted(), kind)
    if file is None:
        for text in map(bytes.decode, content):
            click.echo(printable(text) if sys.stdout.isatty() else text, nl=False)
        return
    try:
        replace_file(file, content)
    except OSError as error:
        raise ExportError(f"{file}: cannot be written: {error.strerror}") from None
    click.echo(f"{rows} rows: {printable(str(file))}")
