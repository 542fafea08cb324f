"""``uqpen plan``: how many runs a precision takes, by a pilot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from uqpen.cli.messages import ExitCode, loading
from uqpen.cli.options import (
    EXAMPLE,
    PATH,
    ExecutorOptions,
    executor_option,
    output_option,
    read_precision,
)

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.designs.stopping.precision import Precision
    from uqpen.statistics.running_estimates import RequiredRuns
    from uqpen.study.study import ValidatedStudy

_REMARK = (
    "Numbers of independent runs (monte-carlo), extrapolated from the pilot, and the time of the "
    "runs alone, made as they were here. A latin-hypercube or sobol-sequence may take far fewer "
    "for a mean. How many, or whether a surrogate would do, independent runs cannot tell."
)


@click.command(short_help="State how many runs a precision takes.")
@click.argument("file", type=PATH)
@click.option(
    "--until",
    "written",
    metavar="TABLE",
    help=f"The precision, as in a study: '{EXAMPLE}'.  [default: that of the study's designs]",
)
@click.option(
    "--pilot",
    "runs",
    type=click.IntRange(min=200),
    default=512,
    show_default=True,
    help="Number of runs to plan by.",
)
@output_option("archive", "archives/<study>.pilot.nc")
@executor_option
def plan(
    file: Path, written: str | None, runs: int, archive: Path | None, executor: ExecutorOptions
) -> ExitCode:
    """Make a pilot of the study FILE, and state how many independent runs a precision takes.

    The pilot's archive is kept: the study itself can reuse its runs. Of a model with noise of its
    own it has two runs at each point, and shows what more of them would buy.
    """
    from uqpen.cli.console import show_line
    from uqpen.cli.progress import show_step
    from uqpen.cli.study import make_and_show
    from uqpen.core.progress import ProgressRecord
    from uqpen.designs.design import RUNS

    here = Path.cwd()
    with show_step("reading the study"), loading():
        from uqpen.study.load import load_study, pilot_study

        study = load_study(file)
        rule = _rule(study, written)
        pilot = pilot_study(study, runs)
    archive = archive or Path("archives") / f"{study.name}.pilot.nc"
    record = ProgressRecord()
    code = make_and_show(pilot, here, archive, executor, receivers=[record])
    if code is not ExitCode.INTERRUPTED:
        keeps_runs = all(design.keep == RUNS for design in study.designs.values())
        rate = record.state.runs_per_second
        _show_required_runs(pilot, here / archive, rule, rate, keeps_runs=keeps_runs)
        show_line(f"to use these runs: uqpen study {file} --reuse {archive}")
    return code


def _rule(study: ValidatedStudy, written: str | None) -> Precision:
    """Return the wanted precision; a mistake in it is one of usage."""
    from uqpen.designs.stopping.precision import Precision

    if written is None:
        rules = (getattr(design, "until", None) for design in study.designs.values())
        rule = next((each for each in rules if isinstance(each, Precision)), None)
        if rule is None:
            message = f"no design of the study has until; expected --until '{EXAMPLE}'"
            raise click.UsageError(message)
        return rule
    return read_precision(written, study)


def _show_required_runs(
    study: ValidatedStudy, archive: Path, rule: Precision, rate: float | None, *, keeps_runs: bool
) -> None:
    """Show the number of runs, the time that each target takes, and the disk of very many runs."""
    import shutil

    from uqpen.archive.read import open_archive, read_group
    from uqpen.cli.console import plain_table, show_line, standard_output
    from uqpen.core.labels import MODELS, RUNS
    from uqpen.core.limits import RUNS_IN_MEMORY
    from uqpen.core.streams import Stream
    from uqpen.execution.omitted_runs import bytes_of_hashes
    from uqpen.execution.runs import bytes_of_a_run
    from uqpen.statistics.running_estimates import required_runs

    tree, (design,) = open_archive(archive), study.designs
    rows, most, size = [], 0.0, 0
    for name, variant in study.models.items():
        path = (MODELS, name) if study.has_several_models else ()
        quantities = study.model_quantities(variant.model)
        rng = Stream(study.seed, "plan").generator(name)
        made = read_group(tree, *path, RUNS, design)
        size += bytes_of_a_run(made)
        for each in required_runs(made, quantities, rule, rng):
            most = max(most, each.runs if math.isfinite(each.runs) else 0.0)
            prefix = f"{name}: " if study.has_several_models else ""
            rows.append((prefix + each.target, *_cells(each, rate)))
    show_line("")
    console = standard_output()
    console.print(plain_table(["target", "runs", "90 % interval", "time"], rows))
    console.print(f"\n{_REMARK}\n", markup=False)
    for text in _noise_texts(tree, most):
        console.print(text, markup=False)
    if most > RUNS_IN_MEMORY:
        without_runs = archive.stat().st_size + bytes_of_hashes(most * len(study.models))
        free = shutil.disk_usage(archive.parent).free
        text = _disk_text(most * size, without_runs, free, keeps_runs=keeps_runs)
        console.print(f"{text}\n", markup=False)


def _noise_texts(tree: xr.DataTree, most: float) -> Iterator[Any]:
    """Yield how much of each output is noise, and what repeats of each point would make of it."""
    from uqpen.archive.read import model_trees
    from uqpen.cli.console import plain_table
    from uqpen.results.archive_view import ArchiveView
    from uqpen.results.repeats import noise_plans

    for model in model_trees(tree):
        for sentence, (head, *rows), advice in noise_plans(
            ArchiveView(tree, model), math.ceil(most)
        ):
            yield sentence
            yield plain_table(head, rows)
            yield f"{advice}\n"


def _disk_text(runs: float, without_runs: float, free: float, *, keeps_runs: bool) -> str:
    """Return how much room the most runs take, and what keeping none of them would save."""
    from uqpen.core.limits import RUNS_IN_MEMORY

    once = (
        f"{_amount(runs)} until the statistics are there, and the archive {_amount(without_runs)}"
    )
    if keeps_runs:
        takes = f"{_amount(runs)} of disk, and twice that while the archive is written"
        other = f' With keep = "statistics" in its design, it takes {once}.'
    else:
        takes, other = f"{once}, as no run is kept", ""
    is_short = runs * (1 + keeps_runs) > free
    room = f" Only {_amount(free)} are free." if is_short else ""
    return (
        f"The largest number takes {takes}.{room}{other} "
        f"More than {RUNS_IN_MEMORY:_} runs are analysed from there and need no more memory."
    ).replace("_", " ")


def _amount(size: float) -> str:
    """Return a number of bytes in two digits or more."""
    if size < 1e9:
        return f"{math.ceil(size / 1e6)} MB"
    return f"{size / 1e9:.{0 if size >= 1e10 else 1}f} GB"


def _cells(required: RequiredRuns, rate: float | None) -> Iterator[str]:
    """Yield the number of runs, its interval and the time, given the runs per second."""
    from uqpen.results.texts import duration_text

    if not math.isfinite(required.runs):
        yield from ("unknown", "no interval in the pilot", "")
        return
    yield _rounded(required.runs)
    known = math.isfinite(required.lower)
    yield f"{_rounded(required.lower)} to {_rounded(required.upper)}" if known else "unknown"
    yield duration_text(required.runs / rate) if rate else "unknown"


def _rounded(runs: float) -> str:
    """Return a number of runs in two digits, rounded up."""
    from uqpen.results.digits import grouped_number

    step = 10 ** max(len(str(math.ceil(runs))) - 2, 0)
    return grouped_number(max(math.ceil(runs / step) * step, 2))
