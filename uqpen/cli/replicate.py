"""``uqpen replicate``: the figures of a publication tested with the runs of an archive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uqpen.cli.messages import ExitCode
from uqpen.cli.options import (
    PATH,
    ExecutorOptions,
    executor_option,
    folder_option,
    quiet_option,
    trust_option,
)

if TYPE_CHECKING:
    from uqpen.replication import PrintedFigure, ReadingResult, Replication

_Rows = list[Sequence[str]]


@click.command(short_help="Test published figures, and name the readings that fit.")
@click.argument("archive", type=PATH)
@click.option(
    "--publication",
    default="",
    metavar="NAME",
    help="The [published.<name>] to test.  [default: the only one]",
)
@click.option(
    "--runs",
    type=click.IntRange(min=2),
    help="Independent runs of the study and each reading.  [default: those of the archive]",
)
@click.option("--json", "as_text", is_flag=True, help="JSON on standard output, in SI units.")
@trust_option
@folder_option()
@executor_option
@quiet_option
def replicate(
    archive: Path,
    publication: str,
    runs: int | None,
    as_text: bool,
    trust: bool,
    folder: Path | None,
    executor: ExecutorOptions,
) -> ExitCode:
    """Test the figures that a publication gives for the study of ARCHIVE.

    Means and standard deviations are tested together at 5 %, with the noise of both samples and
    the rounding of the print. Only if that fails, or a response is not the printed one, the
    readings that the study declares are tested, too, and all that fit are named.

    The runs of a reading are kept as an archive beside ARCHIVE.
    """
    from uqpen.cli.messages import printable_json
    from uqpen.cli.progress import show_progress
    from uqpen.replication import replicate as replicate_archive
    from uqpen.replication import replication_json

    folder = folder and folder.absolute()
    with show_progress() as progress, executor.open_map() as spread:
        found = replicate_archive(
            archive,
            publication,
            runs=runs,
            folder=folder,
            trust=trust,
            map=spread,
            progress=progress,
        )
    if as_text:
        click.echo(printable_json(replication_json(found)))
    else:
        _show(found)
    return ExitCode.DONE


def _show(found: Replication) -> None:
    from rich.text import Text

    from uqpen.cli.console import show_line, show_plain_tables, standard_output
    from uqpen.cli.messages import screen_text
    from uqpen.results.digits import number_text

    console, stated = standard_output(), found.stated
    show_line(f"{found.source}: figures beside those of {stated.moments.runs} runs, SI units")
    rows: _Rows = [
        (
            f"{each.figure} of {each.output}",
            f"{each.published:.{each.decimals}f}",
            f"{each.found:.{each.decimals}f}",
            number_text(each.published_error, 2),
            number_text(each.found_error, 2),
            f"{each.z:.2f}",
        )
        for each in stated.moments.figures
    ]
    header = ["figure", "printed", "here", "its noise", "noise here", "z"]
    printed = [*_printed_rows(stated.uncertainties), *_printed_rows(stated.responses)]
    show_plain_tables(
        console, (header, rows), (["without noise", "printed", "here", "same"], printed)
    )
    console.print()
    for line in _sentences(found):
        show_line(line)
    readings: _Rows = [_reading_row(each) for each in found.readings]
    names = ["reading", "p", "largest |z|", "responses", "against it"]
    show_plain_tables(console, (names, readings))
    if notes := [f"{each.name}: {each.note}" for each in found.readings if each.note]:
        console.print()
        for note in notes:
            console.print(Text(screen_text(note)))


def _printed_rows(figures: Sequence[PrintedFigure]) -> Iterator[Sequence[str]]:
    from uqpen.results.digits import number_text

    for each in figures:
        what = f"response of {each.output} to" if each.output else "uncertainty of"
        agrees = "yes" if each.agrees else "no"
        values = (number_text(100 * value) for value in (each.published, each.found))
        yield (f"{what} {each.input} [%]", *values, agrees)


def _reading_row(result: ReadingResult) -> Sequence[str]:
    reasons = [f"uncertainty of {name}" for name in result.contradictions]
    if result.is_rejected:
        reasons.insert(0, "means and deviations")
    largest = max((abs(each.z) for each in result.moments.figures), default=0.0)
    return (
        result.name,
        _probability_text(result.moments.p),
        f"{largest:.2f}",
        f"{result.same_responses} of {len(result.responses)}",
        ", ".join(reasons) or "–",
    )


def _probability_text(p: float) -> str:
    """Return a probability that was found from random vectors, which may hold no such case."""
    from uqpen.statistics.published import VECTORS

    return f"{p:.2g}" if p else f"below {1 / VECTORS:.0e}"


def _sentences(found: Replication) -> Iterator[str]:
    stated = found.stated
    if stated.moments.figures:
        verdict = "is rejected at 5 %" if stated.is_rejected else "is not rejected at 5 %"
        p = _probability_text(stated.moments.p)
        yield f"Means and deviations together: p = {p}. The study {verdict}."
    if stated.is_rejected and found.has_few_runs:
        yield "With a heavy tail, so few runs reject a right study in more than 5 %: see --runs."
    if stated.is_rejected and found.readings:
        fitting = [each.name for each in found.readings if each.fits]
        names = f": {', '.join(fitting)}" if fitting else ""
        yield f"{len(fitting)} of {len(found.readings)} readings fit all printed figures{names}."
        yield "A reading that fits is possible, not proven; those not listed are not tested."
    if stated.responses and stated.same_responses < len(stated.responses):
        count = f"{stated.same_responses} of {len(stated.responses)}"
        yield f"Responses that agree to the printed digit: {count}."
        if found.readings:
            most = max(each.same_responses for each in (stated, *found.readings))
            names = ", ".join(
                each.name or "the study"
                for each in (stated, *found.readings)
                if each.same_responses == most
            )
            yield (
                f"Most agree, {most}, by {names}; by chance {found.chance_agreements:.2g} readings "
                "would have as many."
            )
