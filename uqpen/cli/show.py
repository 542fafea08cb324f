"""``uqpen show``: an archive's tables, or the same as JSON."""

from __future__ import annotations

from pathlib import Path

import click

__all__ = ["show"]


@click.command(short_help="Show what an archive holds.")
@click.argument("archive", type=click.Path(path_type=Path))
@click.option("--json", "as_text", is_flag=True, help="JSON on standard output, in SI units.")
def show(archive: Path, as_text: bool) -> None:
    """Show the statistics in ARCHIVE as `uqpen study` did; nothing is run."""
    from uqpen.archive.read import open_archive

    tree = open_archive(archive)
    if as_text:
        import json

        from uqpen.summary.json import as_json

        click.echo(json.dumps(as_json(tree), indent=2, ensure_ascii=False, allow_nan=False))
        return
    from uqpen.cli.screen import show_tables

    show_tables(tree)
