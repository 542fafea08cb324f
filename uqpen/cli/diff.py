"""``uqpen diff``: what two archives do not share."""

from __future__ import annotations

from pathlib import Path

import click

from uqpen.cli.messages import ExitCode
from uqpen.cli.options import PATH

__all__ = ["diff"]


@click.command(short_help="List the differences of two archives.")
@click.argument("first", type=PATH)
@click.argument("second", type=PATH)
def diff(first: Path, second: Path) -> ExitCode:
    """List the differences of the archives FIRST and SECOND: studies, points, outputs, statistics.

    Nothing is run. The exit code is 4 if they differ.
    """
    from uqpen.archive.read import read_tree
    from uqpen.cli.verification_screen import show_section
    from uqpen.verification.diff import diff_archives

    sections = list(diff_archives(read_tree(first), read_tree(second)))
    for section in sections:
        show_section(section)
    if sections:
        return ExitCode.DIFFERENT
    click.echo("the same")
    return ExitCode.DONE
