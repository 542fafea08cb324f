"""Options of commands that make runs: where they are made, and which of them again."""

from __future__ import annotations

import functools
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any, NamedTuple

import click

if TYPE_CHECKING:
    from uqpen.execution import Map

__all__ = ["ExecutorOptions", "ResumeOptions", "executor_option", "resume_option"]

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


def executor_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command that is told where to make runs, as its argument `where`."""

    @_WORKERS
    @_SCHEDULER
    @functools.wraps(command)
    def run_command(
        *arguments: Any, workers: int | None, scheduler: str | None, **options: Any
    ) -> Any:
        if workers is not None and scheduler is not None:
            raise click.UsageError("--workers and --scheduler exclude each other")
        return command(*arguments, executor=ExecutorOptions(workers or 1, scheduler), **options)

    return run_command


_FRESH = click.option(
    "--fresh", is_flag=True, help="Make all runs anew, those too that an earlier start has kept."
)
_RETRY_FAILED = click.option(
    "--lost-again", is_flag=True, help="Make those runs anew that were kept, but were lost."
)


class ResumeOptions(NamedTuple):
    """What becomes of runs that an earlier start has kept.

    Attributes
    ----------
    fresh : bool
        All are made again.
    retry_failed : bool
        Those are that were lost.
    """

    fresh: bool
    retry_failed: bool


def resume_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command that is told what becomes of runs that are kept, as its argument `start`."""

    @_FRESH
    @_RETRY_FAILED
    @functools.wraps(command)
    def run_command(*arguments: Any, fresh: bool, lost_again: bool, **options: Any) -> Any:
        return command(*arguments, resume=ResumeOptions(fresh, lost_again), **options)

    return run_command


class ExecutorOptions(NamedTuple):
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

    def open_map(self) -> AbstractContextManager[Map]:
        """A map over batches of runs."""
        if self.scheduler is not None:
            from uqpen.execution.cluster import cluster

            return cluster(self.scheduler)
        if self.workers == 1:
            return nullcontext(map)
        from uqpen.execution.processes import processes

        return processes(self.workers)
