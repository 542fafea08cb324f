"""``uqpen rerun``: the study of an archive, once more."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import click

from uqpen.cli.loading import loading
from uqpen.cli.messages import ExitCode, show_message
from uqpen.cli.options import (
    PATH,
    ExecutorOptions,
    executor_option,
    folder_option,
    output_option,
    quiet_option,
    resume_options,
    trust_option,
)

__all__ = ["rerun"]


@click.command(short_help="Repeat the study of an archive.")
@click.argument("archive", type=PATH)
@output_option("copy", "<archive>_rerun.nc beside ARCHIVE")
@trust_option
@folder_option()
@resume_options
@executor_option
@quiet_option
def rerun(
    archive: Path,
    copy: Path | None,
    trust: bool,
    folder: Path | None,
    executor: ExecutorOptions,
    **resume: Any,
) -> ExitCode:
    """Run the study of ARCHIVE again, and write a new archive.

    After an interruption, the same command continues from the finished runs.

    The exit code is 3 if all runs of a design failed.
    """
    from uqpen.cli.progress import show_step
    from uqpen.cli.study import make_and_show

    # Where the user stands now: a model may go elsewhere once it is loaded.
    here = Path.cwd()
    copy = copy or archive.with_name(f"{archive.stem}_rerun.nc")
    # Shown before the imports, which take longer than the reading.
    with show_step("reading the archive"), loading():
        from uqpen.archive.read import open_archive
        from uqpen.cli.console import show_line
        from uqpen.verification.archived_study import (
            refuse_user_defined_names,
            restored_study,
            with_kept_folders,
        )

        tree = open_archive(archive)
    if copy.exists() and copy.samefile(archive):
        raise click.UsageError(f"{copy}: is the archive to repeat, which is not overwritten")
    refuse_user_defined_names(tree, archive, trust=trust)
    folder = folder and folder.absolute()
    with restored_study(tree, folder, trust=trust) as restored:
        for line in restored.different_files:
            show_message(f"not the archive's file: {line}")
        study = restored.study
        if restored.has_kept_files:
            # The folder of its files is there for the moment alone.
            study = with_kept_folders(study, here / copy.with_name(f"{copy.stem}_runs"))
        from uqpen.checkpoints.make_archive import ResumeOptions

        options = ResumeOptions(**resume, reuse=None)
        code = make_and_show(study, here, copy, executor, resume=options)
    if code is not ExitCode.INTERRUPTED:
        show_line("compare: " + shlex.join(["uqpen", "diff", str(archive), str(copy)]))
    return code
