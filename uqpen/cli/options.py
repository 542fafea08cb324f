"""Options that several commands share."""

from __future__ import annotations

import functools
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from uqpen.cli.messages import show_message

if TYPE_CHECKING:
    from uqpen.execution import Map

__all__ = [
    "PATH",
    "ExecutorOptions",
    "executor_option",
    "folder_option",
    "is_quiet",
    "output_option",
    "quiet_option",
    "resume_options",
    "trust_option",
]

PATH = click.Path(path_type=Path)


class ExecutorOptions(NamedTuple):
    """Number of processes for runs; a Dask cluster with a scheduler, or jobs of SLURM, if given."""

    workers: int
    scheduler: str | None
    slurm_jobs: int | None = None
    sbatch: str = ""

    @property
    def preparation(self) -> str:
        """Step before the first run, in words; empty for none."""
        if self.scheduler is not None:
            return "connecting to the Dask cluster"
        if self.slurm_jobs is not None:
            return f"submitting {self.slurm_jobs} jobs to SLURM"
        return f"starting {self.workers} worker processes" if self.workers > 1 else ""

    def open_map(self) -> AbstractContextManager[Map]:
        """Return a map over batches of runs."""
        if self.scheduler is not None:
            from uqpen.execution.cluster import cluster

            return cluster(self.scheduler, show_message)
        if self.slurm_jobs is not None:
            from uqpen.execution.slurm import slurm

            return slurm(self.slurm_jobs, self.sbatch, show_message)
        if self.workers == 1:
            return nullcontext(map)
        from uqpen.execution.processes import processes

        return processes(self.workers)


def executor_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of where to make runs, as its argument `executor`."""

    @click.option(
        "--workers",
        type=click.IntRange(min=1),
        metavar="N",
        help="Make the runs on N processes; the archive is the same.  [default: 1]",
    )
    @click.option(
        "--scheduler",
        metavar="ADDRESS|FILE",
        help="Make the runs on the Dask cluster with this scheduler; the archive is the same.",
    )
    @click.option(
        "--slurm",
        "slurm_jobs",
        type=click.IntRange(min=1),
        metavar="JOBS",
        help="Make the runs in this number of jobs of SLURM at a time; the archive is the same.",
    )
    @click.option(
        "--sbatch",
        metavar="OPTIONS",
        help='Options of these jobs, such as "--time=2:00:00 --cpus-per-task=4".',
    )
    @functools.wraps(command)
    def run_command(
        *arguments: Any,
        workers: int | None,
        scheduler: str | None,
        slurm_jobs: int | None,
        sbatch: str | None,
        **options: Any,
    ) -> Any:
        given = {"--workers": workers, "--scheduler": scheduler, "--slurm": slurm_jobs}
        if len(names := [name for name, value in given.items() if value is not None]) > 1:
            raise click.UsageError(f"{' and '.join(names)} exclude each other")
        if sbatch is not None and slurm_jobs is None:
            raise click.UsageError("--sbatch is for --slurm")
        executor = ExecutorOptions(workers or 1, scheduler, slurm_jobs, sbatch or "")
        return command(*arguments, executor=executor, **options)

    return run_command


# Key of the context of a command that shows no progress.
_QUIET = "uqpen.quiet"


def _be_quiet(context: click.Context, parameter: click.Parameter, value: bool) -> None:
    context.meta[_QUIET] = value


quiet_option = click.option(
    "-q",
    "--quiet",
    is_flag=True,
    expose_value=False,
    callback=_be_quiet,
    help="Show no progress; results, warnings and errors are shown.",
)


def is_quiet() -> bool:
    """Check that the command shows no progress."""
    context = click.get_current_context(silent=True)
    return context is not None and context.meta.get(_QUIET, False)


def output_option(name: str, default: str) -> Callable[..., Any]:
    """Give a command the path of the archive that it writes, as its argument `name`."""
    text = f"The archive to write.  [default: {default}]"
    return click.option("-o", "--output", name, type=PATH, help=text)


def resume_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the flags of `ResumeOptions`, about finished runs."""
    fresh = "Make all runs, also those that are finished, and replace the archive in any case."
    repeat_failed = "Repeat the finished runs that failed."
    read_again = "Read the kept folders of runs again, in place of making the runs."
    recheck = (
        "Make some finished runs again first, to see that they are the same; or none.  "
        "[default: unless one takes long]"
    )
    command = click.option("--recheck/--no-recheck", default=None, help=recheck)(command)
    command = click.option("--read-again", is_flag=True, help=read_again)(command)
    repeat_option = click.option("--lost-again", "repeat_failed", is_flag=True, help=repeat_failed)
    command = repeat_option(command)
    return click.option("--fresh", is_flag=True, help=fresh)(command)


def folder_option(study: str = "its study") -> Callable[..., Any]:
    """Give a command the folder of the files that an archived study names."""
    return click.option(
        "--folder",
        type=click.Path(exists=True, file_okay=False, path_type=Path),
        help=f"Folder with the files that {study} names.  [default: the archived files]",
    )


trust_option = click.option(
    "--trust",
    is_flag=True,
    help="Execute code that ARCHIVE names: models, distributions, designs, surrogates, analyses.",
)
