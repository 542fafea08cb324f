"""``uqpen rerun``: the study of an archive, once more."""

from __future__ import annotations

from pathlib import Path

import click

from uqpen.cli.exit_code import ExitCode

__all__ = ["rerun"]


@click.command(short_help="Repeat the study of an archive.")
@click.argument("archive", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    "copy",
    type=click.Path(path_type=Path),
    help="The archive to write.  [default: <archive>_rerun.nc beside ARCHIVE]",
)
@click.option("--trust", is_flag=True, help="Execute models that ARCHIVE names and that are code.")
@click.option(
    "--folder",
    type=click.Path(path_type=Path),
    default=Path(),
    help="Where the files lie that its study names.  [default: here]",
)
def rerun(archive: Path, copy: Path | None, trust: bool, folder: Path) -> ExitCode:
    """Run the study whose text ARCHIVE holds, and write an archive of its own.

    Leaves with 3 if a design lost all of its runs.
    """
    import shlex

    from uqpen.archive.read import open_archive
    from uqpen.archive.write import prepare_destination, write
    from uqpen.cli.screen import output, progress
    from uqpen.summary.losses import has_lost_all
    from uqpen.verification.archived import archived_study, refuse_foreign_models
    from uqpen.workflow import run

    # Where the user stands now: a model may go elsewhere once it is loaded.
    here = Path.cwd()
    copy = copy or archive.with_name(f"{archive.stem}_rerun.nc")
    tree = open_archive(archive)
    if copy.exists() and copy.samefile(archive):
        raise click.UsageError(f"{copy}: is the archive to repeat, which is not overwritten")
    refuse_foreign_models(tree, archive, trust=trust)
    study = archived_study(tree, folder.absolute(), trust=trust)
    prepare_destination(here / copy)
    with progress() as reporter:
        again = run(study, progress=reporter)
    write(again, here / copy)
    output().print(f"archive: {copy}", soft_wrap=True, markup=False, highlight=False)
    command = shlex.join(["uqpen", "diff", str(archive), str(copy)])
    output().print(f"compare: {command}", soft_wrap=True, markup=False, highlight=False)
    if has_lost_all(again):
        click.echo("a design lost all of its runs", err=True)
        return ExitCode.LOST
    return ExitCode.DONE
