"""``uqpen rehearse``: a study repeated on its own surrogate."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from uqpen.cli.messages import ExitCode, show_message
from uqpen.cli.options import (
    EXAMPLE,
    PATH,
    ExecutorOptions,
    folder_option,
    quiet_option,
    read_precision,
    trust_option,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from uqpen.rehearsal.rehearse import SufficientRuns


@click.command(short_help="Repeat a study on its surrogate: do its intervals hold?")
@click.argument("study", type=PATH)
@click.option(
    "--surrogate", default="", metavar="NAME", help="The surrogate.  [default: the only one]"
)
@click.option(
    "--archive", type=PATH, help="The archive of a study file.  [default: archives/<study>.nc]"
)
@click.option(
    "--repeats",
    type=int,
    help="Number of repeats.  [default: as many as take 5 min, from 200 to 1 000]",
)
@click.option(
    "--runs",
    type=int,
    help="Number of runs at which designs are compared.  [default: a power of two near theirs]",
)
@click.option(
    "--until",
    "wanted",
    metavar="TABLE",
    help=f"State how many runs half-widths take, such as '{EXAMPLE}'.",
)
@click.option("--json", "as_text", is_flag=True, help="JSON on standard output, in SI units.")
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    default=1,
    metavar="N",
    help="Make the repeats on N processes; the result is the same.  [default: 1]",
)
@folder_option("an archive's study")
@trust_option
@quiet_option
def rehearse(
    study: Path,
    surrogate: str,
    archive: Path | None,
    repeats: int | None,
    runs: int | None,
    wanted: str | None,
    as_text: bool,
    workers: int,
    folder: Path | None,
    trust: bool,
) -> ExitCode:
    """Take the surrogate of STUDY for the truth, and repeat the study on it; no model is run.

    STUDY is a study file that has an archive, or an archive. For each statistic: how often the
    intervals of each design hold, and which design has the narrowest at equal numbers of runs.
    A note marks the statistics that hang on values beyond the surrogate's training range.

    Ctrl-C ends the repeats; the result is then of those that are finished.
    """
    from uqpen.cli.progress import show_progress, show_step

    with show_step("reading the study"):
        from uqpen.rehearsal.rehearse import RehearsalSettings, sufficient_runs
        from uqpen.rehearsal.rehearse import rehearse as rehearse_study
        from uqpen.rehearsal.rehearsed_study import open_rehearsed

        settings = RehearsalSettings(repeats, runs)
    opened = open_rehearsed(study, archive=archive, surrogate=surrogate, folder=folder, trust=trust)
    executor = ExecutorOptions("workers", workers)
    with opened as rehearsed:
        rule = None if wanted is None else read_precision(wanted, rehearsed.study)
        with show_progress() as progress, executor.open_map() as spread:
            findings = rehearse_study(rehearsed, settings, map=spread, progress=progress)
        is_whole = findings.attrs["repeats"] == findings.attrs["repeats_wanted"]
        found: list[SufficientRuns] = []
        try:
            with show_step("numbers of runs"):
                found += sufficient_runs(rehearsed.study, rule) if rule and is_whole else ()
        except KeyboardInterrupt:
            is_whole = False
    _show(findings, found, as_text=as_text)
    if not is_whole:
        show_message(f"interrupted: this is the result of {_repeats_text(findings)}")
        return ExitCode.INTERRUPTED
    return ExitCode.DONE


def _repeats_text(findings: xr.Dataset) -> str:
    """Return how many repeats were made, and of how many if that had been decided."""
    finished, wanted = findings.attrs["repeats"], findings.attrs["repeats_wanted"]
    return f"{finished} of {wanted} repeats" if wanted else f"{finished} repeats"


def _show(findings: xr.Dataset, sufficient: Sequence[SufficientRuns], *, as_text: bool) -> None:
    """Show the findings as tables or as JSON."""
    from uqpen.cli.messages import printable_json
    from uqpen.rehearsal.findings_tables import rehearsal_json

    if not as_text:
        from rich.text import Text

        from uqpen.cli.console import show_line, show_table, standard_output
        from uqpen.cli.messages import screen_text
        from uqpen.rehearsal.findings_tables import coverage_tables, rehearsal_heading, width_tables

        console = standard_output()
        title = f"{findings.attrs['title']}: rehearsal"
        console.print(Text(screen_text(title), style="bold"))
        for line in rehearsal_heading(findings):
            show_line(f" {line}")
        for table in (*coverage_tables(findings), *width_tables(findings)):
            show_table(console, table)
        if sufficient:
            from uqpen.cli.console import show_plain_tables
            from uqpen.rehearsal.rehearse import MOST_RUNS
            from uqpen.results.digits import grouped_number

            more = f"more than {grouped_number(MOST_RUNS)}"
            rows = [
                (each.target, each.design, grouped_number(each.runs) if each.runs else more)
                for each in sufficient
            ]
            show_plain_tables(console, (["target", "design", "runs that do"], rows))
        console.print()
        return
    found = rehearsal_json(findings)
    if sufficient:
        found["sufficient_runs"] = [each._asdict() for each in sufficient]
    click.echo(printable_json(found))
