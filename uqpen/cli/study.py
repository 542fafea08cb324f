"""``uqpen study``: from a study file to an archive."""

from __future__ import annotations

from pathlib import Path

import click

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
def study(file: Path, archive: Path | None) -> None:
    """Make the runs of the study FILE, analyse them, and write everything into one archive."""
    from uqpen.archive.write import prepare_destination, write
    from uqpen.cli.screen import output, progress, show_tables
    from uqpen.study.load import load_study
    from uqpen.workflow import run

    loaded = load_study(file)
    archive = archive or Path("archives") / f"{loaded.name}.nc"
    prepare_destination(archive)
    with progress() as reporter:
        tree = run(loaded, progress=reporter)
    write(tree, archive)
    show_tables(tree)
    output().print(f"archive: {archive}", soft_wrap=True, markup=False, highlight=False)
