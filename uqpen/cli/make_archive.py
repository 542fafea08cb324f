"""What the commands have in common that make an archive of a study."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uqpen.cli.exit_code import ExitCode
from uqpen.cli.options import ExecutorOptions

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.study.study import Study

__all__ = ["make_and_show"]


def make_and_show(
    study: Study,
    here: Path,
    archive: Path,
    executor: ExecutorOptions,
    show: Callable[[xr.DataTree], None] = lambda tree: None,
    **resume: bool,
) -> ExitCode:
    """Make `archive` in the folder `here` where the user stands, `show` it, and report the outcome.

    `resume` are `fresh` and `lost_again` of `uqpen.make_archive`.
    """
    from uqpen.checkpoints.make_archive import make_archive
    from uqpen.cli.progress import show_progress
    from uqpen.cli.screen import show_line
    from uqpen.results.failed_runs import has_failed_design

    try:
        with executor.open_map() as spread, show_progress() as reporter:
            tree = make_archive(study, here / archive, map=spread, progress=reporter, **resume)
    except KeyboardInterrupt as interrupt:
        click.echo(": ".join(["interrupted", *map(str, interrupt.args)]), err=True)
        return ExitCode.INTERRUPTED
    show(tree)
    show_line(f"archive: {archive}")
    if has_failed_design(tree):
        click.echo("a design lost all of its runs", err=True)
        return ExitCode.TOO_MANY_FAILED
    return ExitCode.DONE
