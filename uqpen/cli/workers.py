"""Options of commands that make runs: where they are made, and which of them again."""

from __future__ import annotations

import functools
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any, NamedTuple

import click

if TYPE_CHECKING:
    from uqpen.evaluation import Map

__all__ = ["Start", "Where", "start_option", "workers_option"]

_WORKERS = click.option(
    "--workers",
    type=click.IntRange(min=1),
    metavar="N",
    help="Make the runs on N processes; the archive is the same.  [default: 1]",
)
_SCHEDULER = click.option(
    "--scheduler",
    metavar="ADDRESS|FILE",
    help="Make the runs on the Dask cluster with this scheduler; the archive is the same.",
)


def workers_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command that is told where to make runs, as its argument `where`."""

    @_WORKERS
    @_SCHEDULER
    @functools.wraps(command)
    def told(*arguments: Any, workers: int | None, scheduler: str | None, **options: Any) -> Any:
        if workers is not None and scheduler is not None:
            raise click.UsageError("--workers and --scheduler exclude each other")
        return command(*arguments, where=Where(workers or 1, scheduler), **options)

    return told


_FRESH = click.option(
    "--fresh", is_flag=True, help="Make all runs anew, those too that an earlier start has kept."
)
_LOST_AGAIN = click.option(
    "--lost-again", is_flag=True, help="Make those runs anew that were kept, but were lost."
)


class Start(NamedTuple):
    """What becomes of runs that an earlier start has kept.

    Attributes
    ----------
    fresh : bool
        All are made again.
    lost_again : bool
        Those are that were lost.
    """

    fresh: bool
    lost_again: bool


def start_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command that is told what becomes of runs that are kept, as its argument `start`."""

    @_FRESH
    @_LOST_AGAIN
    @functools.wraps(command)
    def told(*arguments: Any, fresh: bool, lost_again: bool, **options: Any) -> Any:
        return command(*arguments, start=Start(fresh, lost_again), **options)

    return told


class Where(NamedTuple):
    """Where the runs of a command are made.

    Attributes
    ----------
    workers : int
        On so many processes; in this one, for one.
    scheduler : str or None
        On the Dask cluster with this scheduler instead.
    """

    workers: int
    scheduler: str | None

    def map(self) -> AbstractContextManager[Map]:
        """A map over batches of runs."""
        if self.scheduler is not None:
            from uqpen.executors.cluster import cluster

            return cluster(self.scheduler)
        if self.workers == 1:
            return nullcontext(map)
        from uqpen.executors.processes import processes

        return processes(self.workers)
