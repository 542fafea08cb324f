"""``uqpen compare``: the methods of a study at equal budgets."""

from __future__ import annotations

from pathlib import Path

import click

from uqpen.cli.exit_code import ExitCode
from uqpen.cli.workers import Where, workers_option

__all__ = ["compare"]


@click.command(short_help="Try a study's methods at equal budgets.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--budget",
    "budgets",
    metavar="RUNS[,RUNS…]",
    help="Numbers of runs to try.  [default: 128,256,1024,4096,8192, which are fair to all]",
)
@click.option("--repeats", type=int, help="How often to try each.  [default: 30]")
@click.option(
    "--reference",
    type=int,
    metavar="RUNS",
    help="Runs of the reference that errors are held to.  "
    "[default: 16 times the largest budget; at least 1 048 576 of a vectorized model]",
)
@click.option(
    "-o",
    "--output",
    "archive",
    type=click.Path(path_type=Path),
    help="The archive to write.  [default: archives/<study>_compare.nc]",
)
@workers_option
def compare(
    file: Path,
    budgets: str | None,
    repeats: int | None,
    reference: int | None,
    archive: Path | None,
    where: Where,
) -> ExitCode:
    """Run the designs of the study FILE head to head, scaled to equal budgets.

    For each statistic: how far each method is off, how fast that falls, which one wins at each
    budget, and whether it leads by more than the noise.

    Leaves with 3 if the reference lost all of its runs.
    """
    from uqpen.archive.write import prepare_destination, write
    from uqpen.cli.head_to_head_screen import progress, show_comparison
    from uqpen.cli.report import name_report
    from uqpen.cli.screen import output
    from uqpen.head_to_head.contest import compare, refuse
    from uqpen.head_to_head.terms import BUDGETS, REPEATS, Terms
    from uqpen.study.load import load_study
    from uqpen.summary.head_to_head import has_reference

    # Where the user stands now: a model may go elsewhere once it is loaded.
    here = Path.cwd()
    terms = Terms(
        budgets=BUDGETS if budgets is None else _numbers(budgets),
        repeats=REPEATS if repeats is None else repeats,
        reference=reference,
    )
    study = load_study(file)
    refuse(study, terms)
    archive = archive or Path("archives") / f"{study.name}_compare.nc"
    prepare_destination(here / archive)
    try:
        with where.map() as spread, progress() as reporter:
            tree = compare(study, terms, map=spread, progress=reporter)
        write(tree, here / archive)
    except KeyboardInterrupt:
        click.echo("interrupted: nothing was written", err=True)
        return ExitCode.INTERRUPTED
    show_comparison(tree)
    output().print(f"archive: {archive}", soft_wrap=True, markup=False, highlight=False)
    name_report(archive)
    if not has_reference(tree):
        click.echo("the reference lost all of its runs", err=True)
        return ExitCode.LOST
    return ExitCode.DONE


def _numbers(text: str) -> tuple[int, ...]:
    """The budgets of an option such as ``100,1_000``."""
    from uqpen.errors import Problem, SettingsError, as_written

    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError:
        expected = "whole numbers with commas between them, such as 128,1024"
        raise SettingsError([Problem(("--budget",), as_written(text), expected)]) from None
