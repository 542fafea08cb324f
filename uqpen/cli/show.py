"""``uqpen show``: an archive's tables, or the same as JSON."""

from __future__ import annotations

from pathlib import Path

import click

__all__ = ["show"]


@click.command(short_help="Show what an archive holds.")
@click.argument("archive", type=click.Path(path_type=Path))
@click.option("--json", "as_text", is_flag=True, help="JSON on standard output, in SI units.")
def show(archive: Path, as_text: bool) -> None:
    """Show what is in ARCHIVE as `uqpen study` or `uqpen compare` did; nothing is run."""
    from uqpen.archive.read import open_archive
    from uqpen.labels import HEAD_TO_HEAD, KIND
    from uqpen.lookup import resolve

    tree = open_archive(archive)
    is_comparison = tree.attrs.get(KIND) == HEAD_TO_HEAD
    if as_text:
        import json

        as_json = resolve(
            f"uqpen.summary.{'head_to_head_json' if is_comparison else 'json'}:as_json"
        )
        click.echo(json.dumps(as_json(tree), indent=2, ensure_ascii=False, allow_nan=False))
        return
    shown = "head_to_head_screen:show_comparison" if is_comparison else "screen:show_tables"
    resolve(f"uqpen.cli.{shown}")(tree)
