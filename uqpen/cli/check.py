"""``uqpen check``: whether a study file is right, and what it would run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uqpen.cli.messages import ExitCode, loading
from uqpen.cli.options import PATH

if TYPE_CHECKING:
    from uqpen.study.study import ValidatedStudy


@click.command(short_help="Check a study file and show what it would run.")
@click.argument("file", type=PATH)
@click.option(
    "--try",
    "is_tried",
    is_flag=True,
    help="Also make one run of each model at the nominal inputs, and show its outputs.",
)
def check(file: Path, is_tried: bool) -> ExitCode:
    """Read the study FILE, report every mistake in it, and show what it would run.

    With --try, the exit code is 3 if the run fails.
    """
    with loading():
        from uqpen.cli.console import plain_table, standard_output
        from uqpen.cli.messages import printable
        from uqpen.study.load import load_study
        from uqpen.study.new_study import FILL_IN
        from uqpen.study.summary import (
            default_run_lines,
            design_rows,
            input_rows,
            models_text,
            output_rows,
            runs_text,
            section_lines,
            surrogate_rows,
            unanswered_lines,
            unfitted_lines,
        )

    study = load_study(file)
    console = standard_output()
    console.print(printable(study.title), style="bold", markup=False)
    console.print(f"{models_text(study)}, seed {study.seed}\n", markup=False)
    console.print(plain_table(["input", "value or distribution"], input_rows(study)))
    console.print()
    for remark in _input_remarks(study):
        console.print(f"{printable(remark)}\n", markup=False)
    console.print(plain_table(["output", "asked"], output_rows(study)))
    console.print()
    for line in section_lines(study):
        console.print(f"{printable(line)}\n", markup=False)
    for line in study.plan:
        console.print(f"planned: {line}", markup=False)
    if study.plan:
        console.print()
    console.print(plain_table(["design", "kind", "runs"], design_rows(study)))
    if study.surrogates:
        console.print()
        console.print(plain_table(["surrogate", "fitted to", "checked by"], surrogate_rows(study)))
        for line in unfitted_lines(study):
            console.print(printable(line), markup=False)
    for line in (*default_run_lines(study), *unanswered_lines(study)):
        console.print(f"\n{printable(line)}", markup=False)
    console.print(f"\n{runs_text(study)} in all; the study is right", markup=False)
    # Lines that `uqpen init` has left to its reader.
    if count := sum(f"# {FILL_IN}:" in line for line in study.text.splitlines()):
        lines = "1 line is" if count == 1 else f"{count} lines are"
        text = f"{lines} still marked {FILL_IN}; correct the value, then remove the mark"
        console.print(f"warning: {text}", markup=False)
    if not is_tried:
        return ExitCode.DONE
    from uqpen.cli.run import show_trial_runs

    return show_trial_runs(study)


def _input_remarks(study: ValidatedStudy) -> Iterator[str]:
    """Yield remarks on the random inputs that their distributions do not state."""
    if text := study.joint.dependence_text:
        yield text
    if (measured := study.joint.measured_dependence) and measured.warning:
        yield f"warning: {measured.warning}"
    for entry in study.joint.random:
        if "fit_warning" in entry.fit:
            yield f"warning: {entry.variable.name}: {entry.fit['fit_warning']}"
