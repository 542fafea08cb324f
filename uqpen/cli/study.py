"""``uqpen study``: from a study file to an archive."""

from __future__ import annotations

from pathlib import Path

import click

from uqpen.cli.exit_code import ExitCode
from uqpen.cli.workers import Start, Where, start_option, workers_option

__all__ = ["study"]


@click.command(short_help="Run a study and write its archive.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    "archive",
    type=click.Path(path_type=Path),
    help="The archive to write.  [default: archives/<study>.nc]",
)
@click.option("--report", "is_reported", is_flag=True, help="Write its report beside it, too.")
@start_option
@workers_option
def study(
    file: Path, archive: Path | None, is_reported: bool, start: Start, where: Where
) -> ExitCode:
    """Make the runs of the study FILE, analyse them, and write everything into one archive.

    Runs that are done are kept beside the archive until it is there: if this is interrupted in
    whatever way, the same command goes on from them.

    Leaves with 3 if a design lost all of its runs.
    """
    from uqpen.cli.making import make
    from uqpen.cli.report import name_report, write_report_of
    from uqpen.cli.screen import show_tables
    from uqpen.study.load import load_study

    # Where the user stands now: a model may go elsewhere once it is loaded.
    here = Path.cwd()
    loaded = load_study(file)
    archive = archive or Path("archives") / f"{loaded.name}.nc"
    code = make(loaded, here, archive, start=start, where=where, show=show_tables)
    if code is not ExitCode.INTERRUPTED:
        if is_reported:
            write_report_of(archive, here)
        else:
            name_report(archive)
    return code
