"""What the commands have in common that make an archive of a study."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uqpen.cli.exit_code import ExitCode
from uqpen.cli.workers import Start, Where

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.study.study import Study

__all__ = ["make"]


def make(
    study: Study,
    here: Path,
    archive: Path,
    *,
    start: Start,
    where: Where,
    show: Callable[[xr.DataTree], None] = lambda tree: None,
) -> ExitCode:
    """Make the archive of a study, and tell what came of it.

    Parameters
    ----------
    study : Study
        Whose runs are made.
    here : Path
        Where the user stands.
    archive : Path
        The archive, as the user calls it.
    start : Start
        What becomes of runs that were kept.
    where : Where
        Where its runs are made.
    show : callable
        Shows what the archive tells.
    """
    from uqpen.cli.progress import progress
    from uqpen.cli.screen import output
    from uqpen.making.make import make_archive
    from uqpen.summary.losses import has_lost_all

    try:
        with where.map() as spread, progress() as reporter:
            path = here / archive
            tree = make_archive(study, path, map=spread, progress=reporter, **start._asdict())
    except KeyboardInterrupt as interrupt:
        click.echo(": ".join(["interrupted", *map(str, interrupt.args)]), err=True)
        return ExitCode.INTERRUPTED
    show(tree)
    output().print(f"archive: {archive}", soft_wrap=True, markup=False, highlight=False)
    if has_lost_all(tree):
        click.echo("a design lost all of its runs", err=True)
        return ExitCode.LOST
    return ExitCode.DONE
