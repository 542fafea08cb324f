"""Trial run of ``uqpen check --try`` on the screen."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from uqpen.checkpoints.folder import keep_runs
from uqpen.cli.console import plain_table, show_line, standard_output
from uqpen.cli.messages import ExitCode, wrapped_message
from uqpen.core.arrays import FloatArray
from uqpen.core.model import Output
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.study.study import ValidatedStudy
from uqpen.workflow.design_runs import TrialRun, trial_run

__all__ = ["show_trial_runs"]


def show_trial_runs(study: ValidatedStudy) -> ExitCode:
    """Make a run of each model at the nominal inputs; show its outputs, or why it failed."""
    found = [_show_trial_run(study, name) for name in study.models]
    return ExitCode.DONE if all(found) else ExitCode.TOO_MANY_FAILED


def _show_trial_run(study: ValidatedStudy, name: str) -> bool:
    """Show the trial run of a model; return True if it is ok."""
    show_line("")
    trial = trial_run(study, name)
    which = f" of {name}" if study.has_several_models else ""
    is_ok = trial.status is Status.OK
    if is_ok:
        show_line(f"trial run{which} at the nominal inputs, {trial.seconds:.3g} s\n")
        rows = list(_output_rows(study, name, trial))
        standard_output().print(plain_table(["output", "value", "unit"], rows))
        archive = Path("archives") / f"{study.name}.nc"
        if keep_runs(study, archive, trial.inputs, trial.results, name):
            show_line(f"kept for {archive}, as a design has this point")
    else:
        show_line(f"trial run{which} at the nominal inputs: {STATUS_TEXT[trial.status]}")
        _show_message(f"  {trial.reason}")
        if trial.folder is not None:
            _show_message(f"  its files are in {trial.folder}")
    for warning in trial.warnings:
        _show_message(f"warning: {warning}")
    return is_ok


def _show_message(text: str) -> None:
    show_line(wrapped_message(text, sys.stdout))


def _output_rows(
    study: ValidatedStudy, name: str, trial: TrialRun
) -> Iterator[tuple[str, str, str]]:
    """Yield the name, value and unit of each output, as the study shows them."""
    model = study.models[name].model
    values = model.derive(trial.results.outputs, trial.results.status)
    for quantity in study.model_quantities(model):
        output, unit = quantity.output, quantity.display_unit
        text = _value_text(output, unit, values[output.name][0])
        is_bare = bool(output.categories) or unit == DIMENSIONLESS or text.startswith("none")
        yield output.name, text, "" if is_bare else unit


def _value_text(output: Output, unit: str, values: FloatArray) -> str:
    """Return a value, a category, or the ends of a field with its dimensions."""
    if output.categories:
        return output.categories[round(float(values))].label
    if output.absent and np.isnan(values):
        return f"none: {output.absent}"
    shown = scale(unit).from_si(np.array([np.nanmin(values), np.nanmax(values)]))
    if not output.dims:
        return f"{shown[0]:.6g}"
    along = ", ".join(f"{each.name} ({len(each.values)})" for each in output.dims)
    return f"{shown[0]:.6g} to {shown[1]:.6g} along {along}"
