"""``--workers``: where the runs of a command are made."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from uqpen.evaluation import Map

__all__ = ["map_on", "workers_option"]

workers_option = click.option(
    "--workers",
    type=click.IntRange(min=1),
    default=1,
    metavar="N",
    help="Make the runs on N processes; the archive is the same.  [default: 1]",
)


def map_on(workers: int) -> AbstractContextManager[Map]:
    """A map over batches of runs: here for one worker, on processes of their own for more."""
    if workers == 1:
        return nullcontext(map)
    from uqpen.executors.processes import processes

    return processes(workers)
