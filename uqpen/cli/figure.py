"""``uqpen figure``: a figure of an archive, as a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from uqpen.cli.loading import loading
from uqpen.cli.options import PATH

__all__ = ["figure"]


@click.command(short_help="Draw a figure of an archive.")
@click.argument("archive", type=PATH)
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option(
    "-o", "file", type=PATH, help="File that ends in .svg, .pdf or .png; without it NAME.svg."
)
@click.option("--list", "is_list", is_flag=True, help="List the figures of ARCHIVE.")
@click.option("--output", help="Show this output only.")
@click.option("--source", help="Show this design, surrogate or publication.")
@click.option("--model", help="Show this model, if there are several.")
def figure(
    archive: Path,
    names: tuple[str, ...],
    file: Path | None,
    is_list: bool,
    **selection: Any,
) -> None:
    """Draw the figure NAME of ARCHIVE, or several on a page; nothing is run.

    A figure of your own is a function in a file: my_figure.py:my_figure. Without NAME, or with
    --list, this lists the figures of ARCHIVE.
    """
    with loading():
        from uqpen.archive.read import open_archive
        from uqpen.cli.printable import printable
        from uqpen.figures.page import available
        from uqpen.figures.page import figure as drawn
        from uqpen.figures.style import figure_format

    if is_list or not names:
        for known, shows in available(open_archive(archive)).items():
            click.echo(f"{known:18}{shows}")
        return
    path = file or Path(f"{names[0].rpartition(':')[2]}.svg")
    figure_format(path)
    drawn(open_archive(archive), *names, **selection).save(path)
    click.echo(f"figure: {printable(str(path))}")
