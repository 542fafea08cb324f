"""``uqpen verify``, ``rerun`` and ``diff``: an archive against its hashes, runs and others."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import click

from uqpen.cli.messages import ExitCode, loading, show_message
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

# Its hashes, and some of its runs once more.


@click.command(short_help="Check an archive against its hashes and repeated runs.")
@click.argument("archive", type=PATH)
@click.option(
    "--runs",
    type=click.IntRange(min=1),
    help="How many runs to repeat, drawn at random.  [default: 100, with noise 1000]",
)
@click.option("--all", "all_runs", is_flag=True, help="Repeat all runs.")
@trust_option
@folder_option()
@executor_option
@quiet_option
def verify(
    archive: Path,
    runs: int | None,
    all_runs: bool,
    trust: bool,
    folder: Path | None,
    executor: ExecutorOptions,
) -> ExitCode:
    """Check that ARCHIVE is unchanged, and that its study gives the same results.

    This checks its hashes, repeats some runs at the archived inputs, and computes all statistics
    again from the archived runs.

    The exit code is 4 if something is different, and 2 if its study cannot be read here.
    """
    from uqpen.cli.progress import show_progress

    if all_runs and runs is not None:
        raise click.UsageError("--runs and --all exclude each other")
    number = None if all_runs else runs or 0
    # Where the user stands now: a model may go elsewhere once it is loaded.
    folder = folder and folder.absolute()
    with show_progress() as reporter:
        # Shown before the imports, which take seconds.
        reporter.start_step("reading the archive")
        with loading():
            from uqpen.cli.console import show_check
            from uqpen.verification.check_result import CheckOutcome
            from uqpen.verification.verify import verify

        with executor.open_map() as spread:
            results = list(
                verify(
                    archive, folder=folder, runs=number, trust=trust, map=spread, progress=reporter
                )
            )
    for result in results:
        show_check(result)
    verdicts = {result.verdict for result in results}
    if verdicts & {CheckOutcome.DIFFERENT, CheckOutcome.UNLIKELY}:
        return ExitCode.DIFFERENT
    return ExitCode.MISTAKE if CheckOutcome.IMPOSSIBLE in verdicts else ExitCode.DONE


# Its study once more.


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
    copy = copy or archive.parent / f"{archive.stem}_rerun.nc"
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


# Another archive.


@click.command(short_help="List the differences of two archives.")
@click.argument("first", type=PATH)
@click.argument("second", type=PATH)
def diff(first: Path, second: Path) -> ExitCode:
    """List the differences of the archives FIRST and SECOND: studies, points, outputs, statistics.

    Nothing is run. The exit code is 4 if they differ.
    """
    from uqpen.archive.read import read_tree
    from uqpen.cli.console import show_section
    from uqpen.verification.diff import diff_archives

    sections = list(diff_archives(read_tree(first), read_tree(second)))
    for section in sections:
        show_section(section)
    if sections:
        return ExitCode.DIFFERENT
    click.echo("the same")
    return ExitCode.DONE
