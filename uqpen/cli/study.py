"""``uqpen study``: from a study file to an archive."""

from __future__ import annotations

from pathlib import Path

import click

from uqpen.cli.exit_code import ExitCode
from uqpen.cli.workers import map_on, workers_option

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
@workers_option
def study(file: Path, archive: Path | None, workers: int) -> ExitCode:
    """Make the runs of the study FILE, analyse them, and write everything into one archive.

    Leaves with 3 if a design lost all of its runs.
    """
    from uqpen.archive.write import prepare_destination, write
    from uqpen.cli.screen import output, progress, show_tables
    from uqpen.study.load import load_study
    from uqpen.summary.losses import has_lost_all
    from uqpen.workflow import run

    # Where the user stands now: a model may go elsewhere once it is loaded.
    here = Path.cwd()
    loaded = load_study(file)
    archive = archive or Path("archives") / f"{loaded.name}.nc"
    prepare_destination(here / archive)
    try:
        with map_on(workers) as where, progress() as reporter:
            tree = run(loaded, map=where, progress=reporter)
        write(tree, here / archive)
    except KeyboardInterrupt:
        click.echo("interrupted; nothing was written", err=True)
        return ExitCode.INTERRUPTED
    show_tables(tree)
    output().print(f"archive: {archive}", soft_wrap=True, markup=False, highlight=False)
    if has_lost_all(tree):
        click.echo("a design lost all of its runs", err=True)
        return ExitCode.LOST
    return ExitCode.DONE
