"""What the commands have in common that make an archive of a study."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uqpen.cli.executor_options import ExecutorOptions, ResumeOptions
from uqpen.cli.exit_code import ExitCode

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.study.study import Study

__all__ = ["make_and_show"]


def make_and_show(
    study: Study,
    here: Path,
    archive: Path,
    *,
    resume: ResumeOptions,
    executor: ExecutorOptions,
    show: Callable[[xr.DataTree], None] = lambda tree: None,
) -> ExitCode:
    """Make the archive of a study, and report the outcome.

    Parameters
    ----------
    study : Study
        Whose runs are made.
    here : Path
        Where the user stands.
    archive : Path
        The archive, as the user calls it.
    resume : ResumeOptions
        What becomes of runs that were kept.
    executor : ExecutorOptions
        Where its runs are made.
    show : callable
        Shows what the archive reports.
    """
    from uqpen.checkpoints.make_archive import make_archive
    from uqpen.cli.progress import show_progress
    from uqpen.cli.screen import standard_output
    from uqpen.results.failed_runs import has_failed_design

    try:
        with executor.open_map() as spread, show_progress() as reporter:
            path = here / archive
            tree = make_archive(
                study,
                path,
                map=spread,
                progress=reporter,
                fresh=resume.fresh,
                lost_again=resume.retry_failed,
            )
    except KeyboardInterrupt as interrupt:
        click.echo(": ".join(["interrupted", *map(str, interrupt.args)]), err=True)
        return ExitCode.INTERRUPTED
    show(tree)
    standard_output().print(f"archive: {archive}", soft_wrap=True, markup=False, highlight=False)
    if has_failed_design(tree):
        click.echo("a design lost all of its runs", err=True)
        return ExitCode.TOO_MANY_FAILED
    return ExitCode.DONE
