"""``uqpen show``, ``figure`` and ``report``: an archive as tables, JSON, a figure or a page."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import click

from uqpen.cli.messages import loading, printable, printable_json, show_message
from uqpen.cli.options import PATH

# Tables, or the same as JSON.


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
        tree, places = resolve("uqpen.results.field_tables:select_output")(tree, output, at)
        for remark in filter(None, (place.remark for place in places)):
            show_message(remark)
    if as_text:
        function = "method_comparison:benchmark_json" if is_comparison else "json:archive_json"
        as_json = resolve(f"uqpen.results.{function}")
        click.echo(printable_json(as_json(tree)))
        return
    if is_comparison:
        resolve("uqpen.cli.benchmark_screen:show_benchmark")(tree)
    else:
        resolve("uqpen.cli.screen:show_tables")(tree, everything=everything)


# A figure, as a file.


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


# A page that stands alone.


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

        path = file or archive.parent / f"{_stem(archive)}_{_stem(other)}.html"
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

    path = file or archive.parent / f"{_stem(archive)}.html"
    with show_step("writing the report"):
        with loading():
            from uqpen.archive.read import open_archive
            from uqpen.report.page import write_report

        write_report(open_archive(here / archive), here / path, sections=sections, full=full)
    click.echo(f"report: {printable(str(path))}")


def announce_report(archive: Path) -> None:
    """Show the command that writes the page of an archive."""
    click.echo(f"report: {printable(shlex.join(['uqpen', 'report', str(archive)]))}")
