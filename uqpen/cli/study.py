"""``uqpen study``: from a study file to an archive."""

from __future__ import annotations

from pathlib import Path

import click

from uqpen.cli.exit_code import ExitCode
from uqpen.cli.options import PATH, ExecutorOptions, executor_option, resume_options

__all__ = ["study"]


@click.command(short_help="Run a study and write its archive.")
@click.argument("file", type=PATH)
@click.option(
    "-o",
    "--output",
    "archive",
    type=PATH,
    help="The archive to write.  [default: archives/<study>.nc]",
)
@click.option("--report", "is_reported", is_flag=True, help="Write its report beside it, too.")
@resume_options
@executor_option
def study(
    file: Path,
    archive: Path | None,
    is_reported: bool,
    executor: ExecutorOptions,
    **resume: bool,
) -> ExitCode:
    """Make the runs of the study FILE, analyse them, and write everything into one archive.

    Runs that are done are kept beside the archive until it is there: if this is interrupted in
    whatever way, the same command goes on from them.

    Leaves with 3 if a design lost all of its runs.
    """
    from uqpen.cli.make_archive import make_and_show
    from uqpen.cli.report import announce_report, write_and_announce
    from uqpen.cli.screen import show_tables
    from uqpen.study.load import load_study

    # Where the user stands now: a model may go elsewhere once it is loaded.
    here = Path.cwd()
    loaded = load_study(file)
    archive = archive or Path("archives") / f"{loaded.name}.nc"
    code = make_and_show(loaded, here, archive, executor, show_tables, **resume)
    if code is not ExitCode.INTERRUPTED:
        if is_reported:
            write_and_announce(archive, here)
        else:
            announce_report(archive)
    return code
