"""``uqpen report``: an archive as one page for a person."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["name_report", "report", "write_beside"]


@click.command(short_help="Write a page that shows what an archive holds.")
@click.argument("archive", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "file",
    type=click.Path(path_type=Path),
    help="The page to write.  [default: ARCHIVE with the ending .html]",
)
def report(archive: Path, file: Path | None) -> None:
    """Write one HTML page of all that ARCHIVE tells, to send to a colleague; nothing is run.

    It opens in any browser, without a network.
    """
    from uqpen.archive.read import open_archive
    from uqpen.report.page import write_report

    path = file or _beside(archive)
    tree = open_archive(archive)
    if path.exists() and path.samefile(archive):
        raise click.UsageError(f"{path}: is the archive itself, which is not overwritten")
    write_report(tree, path)
    _tell(str(path))


def write_beside(tree: xr.DataTree, here: Path, archive: Path) -> None:
    """Write the page of an archive that was just made beside it, and say where.

    Parameters
    ----------
    tree : DataTree
        What the archive holds.
    here : Path
        Where the user stands.
    archive : Path
        The archive, as the user calls it.
    """
    from uqpen.report.page import write_report

    path = _beside(archive)
    write_report(tree, here / path)
    _tell(str(path))


def name_report(archive: Path) -> None:
    """Say how the page of an archive is written."""
    import shlex

    _tell(shlex.join(["uqpen", "report", str(archive)]))


def _beside(archive: Path) -> Path:
    stem = archive.stem if archive.suffix == ".nc" else archive.name
    return archive.with_name(f"{stem}.html")


def _tell(what: str) -> None:
    from uqpen.cli.printable import printable

    click.echo(f"report: {printable(what)}")
