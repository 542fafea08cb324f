"""``uqpen compare``: the methods of a study at equal budgets."""

from __future__ import annotations

from pathlib import Path

import click

from uqpen.cli.messages import ExitCode, loading, show_message
from uqpen.cli.options import PATH, ExecutorOptions, executor_option, output_option, quiet_option


@click.command(short_help="Compare a study's methods at equal budgets.")
@click.argument("file", type=PATH)
@click.option(
    "--budget",
    "budgets",
    metavar="RUNS[,RUNS…]",
    help="Numbers of runs to try.  [default: 128,256,1024,4096,8192, which are fair to all]",
)
@click.option("--repeats", type=int, help="Number of repeats of each.  [default: 30]")
@click.option(
    "--reference",
    type=int,
    metavar="RUNS",
    help="Number of runs of the reference, from which errors are measured.  "
    "[default: 16 times the largest budget; at least 1 048 576 of a vectorized model]",
)
@output_option("archive", "archives/<study>_compare.nc")
@executor_option
@quiet_option
def compare(
    file: Path,
    budgets: str | None,
    repeats: int | None,
    reference: int | None,
    archive: Path | None,
    executor: ExecutorOptions,
) -> ExitCode:
    """Benchmark the designs of the study FILE, scaled to equal budgets.

    For each statistic: the error of each method, how fast it falls, the best method at each
    budget, and whether its lead is larger than the noise.

    The exit code is 3 if all runs of the reference failed.
    """
    from uqpen.cli.progress import show_step
    from uqpen.cli.show import announce_report

    # Where the user stands now: a model may go elsewhere once it is loaded.
    here = Path.cwd()
    # Shown before the imports, which take longer than the reading.
    with show_step("reading the study"), loading():
        from uqpen.archive.write import prepare_destination, write
        from uqpen.benchmark.compare import check_study, compare
        from uqpen.benchmark.methods import BUDGETS, REPEATS, BenchmarkSettings
        from uqpen.checkpoints.folder import lock_archive
        from uqpen.cli.benchmark_screen import show_benchmark, show_progress
        from uqpen.cli.console import show_line
        from uqpen.execution.runs_in_file import runs_in_file
        from uqpen.results.method_comparison import MethodComparison
        from uqpen.study.load import load_study

        settings = BenchmarkSettings(
            budgets=BUDGETS if budgets is None else _parse_budgets(budgets),
            repeats=REPEATS if repeats is None else repeats,
            reference=reference,
        )
        study = load_study(file)
    check_study(study, settings)
    archive = archive or Path("archives") / f"{study.name}_compare.nc"
    path = here / archive
    prepare_destination(path)
    try:
        with lock_archive(path), runs_in_file(path.with_name(f"{path.name}.runs")) as checkpoint:
            with executor.open_map() as spread, show_progress() as reporter:
                tree = compare(
                    study, settings, map=spread, progress=reporter, checkpoint=checkpoint
                )
            write(tree, path)
    except KeyboardInterrupt:
        show_message("interrupted: nothing was written")
        return ExitCode.INTERRUPTED
    show_benchmark(tree)
    show_line(f"archive: {archive}")
    announce_report(archive)
    if not MethodComparison.of(tree).reference_runs_used:
        show_message("all runs of the reference failed")
        return ExitCode.TOO_MANY_FAILED
    return ExitCode.DONE


def _parse_budgets(text: str) -> tuple[int, ...]:
    """Parse the budgets of an option such as ``100,1_000``."""
    from uqpen.core.errors import Problem, SettingsError, toml_text

    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError:
        expected = "whole numbers with commas between them, such as 128,1024"
        raise SettingsError([Problem(("--budget",), toml_text(text), expected)]) from None
