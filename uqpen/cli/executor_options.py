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
    """Give a command the options of where to make runs, as its argument `executor`."""

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
        Failed runs are made again.
    """

    fresh: bool
    retry_failed: bool


def resume_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options for runs that were kept, as its argument `resume`."""

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
        The number of processes; 1 makes them in this process.
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
        from uqpen.execution.worker import preload_in_workers

        preload_in_workers("uqpen.cli.main")
        return processes(self.workers)
