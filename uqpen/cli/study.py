"""``uqpen study``: from a study file to an archive."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uqpen.cli.messages import ExitCode, show_message
from uqpen.cli.options import (
    PATH,
    ExecutorOptions,
    executor_option,
    output_option,
    quiet_option,
    resume_options,
)

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.checkpoints.make_archive import ResumeOptions
    from uqpen.core.progress import Progress
    from uqpen.study.study import ValidatedStudy


class _StudyCommand(click.Command):
    """Command whose option ``--watch`` may be followed by a port, or by another argument."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        following = [*args, ""][1:]
        args = [
            "--watch=0" if argument == "--watch" and not after.isdecimal() else argument
            for argument, after in zip(args, following, strict=True)
        ]
        return super().parse_args(ctx, args)


@click.command(cls=_StudyCommand, short_help="Run a study and write its archive.")
@click.argument("file", type=PATH)
@output_option("archive", "archives/<study>.nc")
@click.option("--all", "everything", is_flag=True, help="Show all tables, as `uqpen show` does.")
@click.option("--report", "is_reported", is_flag=True, help="Write its report beside it, too.")
@click.option(
    "--watch",
    "watch_port",
    type=click.IntRange(0, 65535),
    metavar="[PORT]",
    help="Show the results so far on a page of this machine while the study runs.  "
    "[default port: any free one]",
)
@click.option(
    "--reuse",
    type=PATH,
    multiple=True,
    metavar="OTHER",
    help="Take finished runs from this archive, too; may be given several times.",
)
@resume_options
@executor_option
@quiet_option
def study(
    file: Path,
    archive: Path | None,
    everything: bool,
    is_reported: bool,
    reuse: tuple[Path, ...],
    watch_port: int | None,
    executor: ExecutorOptions,
    **resume: Any,
) -> ExitCode:
    """Make the runs of the study FILE, analyse them, and write everything into one archive.

    No run is made twice: those that the archive has already are taken, if the model is the same.
    Finished runs are kept beside the archive until it is complete. After an interruption, the
    same command continues from them.

    The exit code is 3 if all runs of a design failed.
    """
    from uqpen.cli.messages import loading
    from uqpen.cli.progress import show_step
    from uqpen.cli.show import announce_report, write_and_announce

    if reuse and resume["fresh"]:
        raise click.UsageError("--reuse and --fresh exclude each other")
    # Where the user stands now: a model may go elsewhere once it is loaded.
    here = Path.cwd()
    # Shown before the imports, which take longer than the reading.
    with show_step("reading the study"), loading():
        from uqpen.cli.screen import show_answer, show_tables
        from uqpen.study.load import load_study

        loaded = load_study(file)
        # It loads what makes runs, which a study with a mistake does not need.
        from uqpen.checkpoints.make_archive import ResumeOptions
    for line in loaded.plan:
        show_message(f"planned: {line}")
    archive = archive or Path("archives") / f"{loaded.name}.nc"
    code = make_and_show(
        loaded,
        here,
        archive,
        executor,
        show_tables if everything else lambda tree: show_answer(tree, archive),
        watch_port=watch_port,
        resume=ResumeOptions(**resume, reuse=[here / other for other in reuse]),
    )
    if code is not ExitCode.INTERRUPTED:
        if is_reported:
            write_and_announce(archive, here)
        else:
            announce_report(archive)
    return code


def make_and_show(
    study: ValidatedStudy,
    here: Path,
    archive: Path,
    executor: ExecutorOptions,
    show: Callable[[xr.DataTree], None] = lambda tree: None,
    watch_port: int | None = None,
    receivers: Sequence[Progress] = (),
    resume: ResumeOptions | None = None,
) -> ExitCode:
    """Make `archive` in the folder `here` where the user stands, `show` it, and report the outcome.

    With a `watch_port`, a page on this machine shows the results meanwhile. `receivers` get the
    reports of progress, too.
    """
    from uqpen.checkpoints.make_archive import make_archive
    from uqpen.cli.console import show_line
    from uqpen.cli.progress import show_progress
    from uqpen.core.progress import ProgressBroadcast
    from uqpen.results.failed_runs import has_failed_design

    try:
        with _watched(study, watch_port) as watchers, show_progress() as screen:
            progress = ProgressBroadcast(screen, *watchers, *receivers)
            if executor.preparation:
                progress.start_step(executor.preparation)
            with executor.open_map() as spread:
                tree = make_archive(study, here / archive, resume, map=spread, progress=progress)
    except KeyboardInterrupt as interrupt:
        show_message(": ".join(["interrupted", *map(str, interrupt.args)]))
        return ExitCode.INTERRUPTED
    show(tree)
    show_line(f"archive: {archive}")
    if has_failed_design(tree):
        show_message("all runs of a design failed")
        return ExitCode.TOO_MANY_FAILED
    return ExitCode.DONE


@contextmanager
def _watched(study: ValidatedStudy, port: int | None) -> Iterator[Sequence[Progress]]:
    """Serve the page of a running study if a port is given; yield the receivers of its reports."""
    if port is None:
        yield ()
        return
    from uqpen.server.watch_server import serve_watch_page, watch_state
    from uqpen.workflow.running_results import RunningResults

    running = RunningResults(study)
    with ExitStack() as stack:
        try:
            server = stack.enter_context(serve_watch_page(lambda: watch_state(running), port))
        except OSError as error:
            message = f"--watch: cannot listen at port {port}: {error.strerror or error}"
            raise click.UsageError(message) from None
        show_message(f"watch: {server.url} shows the results so far, until the study ends")
        yield (running,)
