"""``uqpen verify``: an archive held against its hashes and against fresh runs."""

from __future__ import annotations

from pathlib import Path

import click

from uqpen.cli.exit_code import ExitCode
from uqpen.cli.workers import Where, workers_option

__all__ = ["verify"]


@click.command(short_help="Hold an archive against its hashes and fresh runs.")
@click.argument("archive", type=click.Path(path_type=Path))
@click.option(
    "--runs",
    type=click.IntRange(min=1),
    help="How many runs to repeat, drawn at random.  [default: 100]",
)
@click.option("--all", "all_runs", is_flag=True, help="Repeat all runs.")
@click.option("--trust", is_flag=True, help="Execute models that ARCHIVE names and that are code.")
@click.option(
    "--folder",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Take the files that its study names from here.  [default: those that it keeps]",
)
@workers_option
def verify(
    archive: Path, runs: int | None, all_runs: bool, trust: bool, folder: Path | None, where: Where
) -> ExitCode:
    """Check that ARCHIVE is as it was written, and that its study gives what it holds.

    Its hashes are checked, some of its runs repeated at the inputs that it holds, and all of its
    statistics worked out again from its runs.

    Leaves with 4 if something is different, with 2 if its study cannot be read again here.
    """
    from uqpen.cli.progress import progress
    from uqpen.cli.verification_screen import show_part
    from uqpen.verification.report import Verdict
    from uqpen.verification.verify import verify

    if all_runs and runs is not None:
        raise click.UsageError("--runs and --all exclude each other")
    number = None if all_runs else runs or 100
    # Where the user stands now: a model may go elsewhere once it is loaded.
    folder = folder and folder.absolute()
    with where.map() as spread, progress() as reporter:
        parts = list(
            verify(archive, folder=folder, runs=number, trust=trust, map=spread, progress=reporter)
        )
    for part in parts:
        show_part(part)
    verdicts = {part.verdict for part in parts}
    if Verdict.DIFFERENT in verdicts:
        return ExitCode.DIFFERENT
    return ExitCode.MISTAKE if Verdict.IMPOSSIBLE in verdicts else ExitCode.DONE
