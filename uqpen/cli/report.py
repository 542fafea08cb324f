"""``uqpen report``: an archive as one page for a person."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from uqpen.cli.loading import loading
from uqpen.cli.options import PATH
from uqpen.cli.printable import printable

__all__ = ["announce_report", "report", "write_and_announce"]


@click.command(short_help="Write the results of an archive as an HTML page.")
@click.argument("archive", type=PATH)
@click.argument("other", type=PATH, required=False)
@click.option(
    "-o",
    "file",
    type=PATH,
    help="The page to write.  [default: ARCHIVE with the ending .html, or ARCHIVE_OTHER.html]",
)
@click.option(
    "--section",
    "sections",
    multiple=True,
    metavar="FILE.py:FUNCTION",
    help="Add a section of your own, made by this function; can be given several times.",
)
@click.option(
    "--full", is_flag=True, help="Unfold the parts for a statistician, and so print them."
)
def report(
    archive: Path, other: Path | None, file: Path | None, sections: tuple[str, ...], full: bool
) -> None:
    """Write one HTML page with the results of ARCHIVE, to send to a colleague; nothing is run.

    It opens in any browser, without a network.

    With OTHER, the page shows both archives side by side: what changed in the study, and how its
    answers moved.
    """
    if other is None:
        write_and_announce(archive, Path(), file, sections, full=full)
    elif sections or full:
        option = "--section" if sections else "--full"
        raise click.UsageError(f"{option} is for the page of one archive")
    else:
        from uqpen.cli.progress import show_step

        path = file or archive.with_name(f"{_stem(archive)}_{_stem(other)}.html")
        with show_step("writing the report"):
            from uqpen.archive.read import open_archive
            from uqpen.report.revisions.revision_page import write_revision_report

            trees = open_archive(archive), open_archive(other)
            write_revision_report(*trees, path, names=(archive.name, other.name))
        click.echo(f"report: {printable(str(path))}")


def _stem(archive: Path) -> str:
    return archive.stem if archive.suffix == ".nc" else archive.name


def write_and_announce(
    archive: Path,
    here: Path,
    file: Path | None = None,
    sections: tuple[str, ...] = (),
    *,
    full: bool = False,
) -> None:
    """Write the report of an archive, by default beside it, and show the path of the page.

    The paths are relative to the folder `here` where the user stands; the files of `sections` are
    relative to the current folder.
    """
    from uqpen.cli.progress import show_step

    path = file or archive.with_name(f"{_stem(archive)}.html")
    with show_step("writing the report"):
        with loading():
            from uqpen.archive.read import open_archive
            from uqpen.report.page import write_report

        write_report(open_archive(here / archive), here / path, sections=sections, full=full)
    click.echo(f"report: {printable(str(path))}")


def announce_report(archive: Path) -> None:
    """Show the command that writes the page of an archive."""
    click.echo(f"report: {printable(shlex.join(['uqpen', 'report', str(archive)]))}")
