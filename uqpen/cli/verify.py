"""``uqpen verify``: an archive compared with its hashes and with fresh runs."""

from __future__ import annotations

from pathlib import Path

import click

from uqpen.cli.loading import loading
from uqpen.cli.messages import ExitCode
from uqpen.cli.options import (
    PATH,
    ExecutorOptions,
    executor_option,
    folder_option,
    quiet_option,
    trust_option,
)

__all__ = ["verify"]


@click.command(short_help="Check an archive against its hashes and repeated runs.")
@click.argument("archive", type=PATH)
@click.option(
    "--runs",
    type=click.IntRange(min=1),
    help="How many runs to repeat, drawn at random.  [default: 100]",
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
    number = None if all_runs else runs or 100
    # Where the user stands now: a model may go elsewhere once it is loaded.
    folder = folder and folder.absolute()
    with show_progress() as reporter:
        # Shown before the imports, which take seconds.
        reporter.start_step("reading the archive")
        with loading():
            from uqpen.cli.verification_screen import show_check
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
    if CheckOutcome.DIFFERENT in verdicts:
        return ExitCode.DIFFERENT
    return ExitCode.MISTAKE if CheckOutcome.IMPOSSIBLE in verdicts else ExitCode.DONE
