"""``uqpen show``: an archive's tables, or the same as JSON."""

from __future__ import annotations

import json
from pathlib import Path

import click

from uqpen.cli.loading import loading
from uqpen.cli.messages import show_message
from uqpen.cli.options import PATH
from uqpen.cli.printable import printable_json

__all__ = ["show"]


@click.command(short_help="Show the results in an archive.")
@click.argument("archive", type=PATH)
@click.option("--json", "as_text", is_flag=True, help="JSON on standard output, in SI units.")
@click.option("--all", "everything", is_flag=True, help="All sensitivity measures of the inputs.")
@click.option("--output", help="Show this output only.")
@click.option(
    "--at",
    multiple=True,
    metavar="DIMENSION=PLACE",
    help='Show an output with dimensions there: --output infected --at "time=10 day".',
)
def show(
    archive: Path, as_text: bool, everything: bool, output: str | None, at: tuple[str, ...]
) -> None:
    """Show the results in ARCHIVE, as `uqpen study` or `uqpen compare` did; nothing is run."""
    with loading():
        from uqpen.archive.read import is_benchmark, open_archive
        from uqpen.core.lookup import resolve

    if at and output is None:
        raise click.UsageError("--at needs --output NAME")
    tree = open_archive(archive)
    is_comparison = is_benchmark(tree)
    if output is not None:
        if is_comparison:
            raise click.UsageError("--output is for the archive of a study")
        tree, places = resolve("uqpen.results.output_selection:select_output")(tree, output, at)
        for remark in filter(None, (place.remark for place in places)):
            show_message(remark)
    if as_text:
        function = "benchmark_tables:benchmark_json" if is_comparison else "json:archive_json"
        as_json = resolve(f"uqpen.results.{function}")
        text = json.dumps(as_json(tree), indent=2, ensure_ascii=False, allow_nan=False)
        click.echo(printable_json(text))
        return
    if is_comparison:
        resolve("uqpen.cli.benchmark_screen:show_benchmark")(tree)
    else:
        resolve("uqpen.cli.screen:show_tables")(tree, everything=everything)
