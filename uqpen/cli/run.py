"""``uqpen run``: one run of a model, to try it by hand."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uqpen.cli.messages import ExitCode, show_message, wrapped_message
from uqpen.cli.options import folder_option, trust_option
from uqpen.cli.predict import open_surrogate, split_surrogate

if TYPE_CHECKING:
    from uqpen.core.arrays import FloatArray
    from uqpen.core.model import Input, Model, Output
    from uqpen.distributions.constraints import Constraint
    from uqpen.study.study import ValidatedStudy


@click.command(short_help="Run a model once and show its outputs.")
@click.argument("model")
@click.option(
    "--set",
    "given",
    multiple=True,
    metavar='NAME="VALUE UNIT"',
    help='The value of an input, such as impact_velocity="1400 m/s".',
)
@folder_option("an archive's study")
@trust_option
def run(model: str, given: tuple[str, ...], folder: Path | None, trust: bool) -> None:
    """Run MODEL once: a built-in model, a study file, or ARCHIVE:NAME, a surrogate of an archive.

    Inputs of a study or a surrogate that are not set are at their medians.
    """
    import numpy as np

    from uqpen.cli.console import standard_output
    from uqpen.core.lookup import resolve_name
    from uqpen.models import MODELS

    if archive := split_surrogate(model):
        _run_surrogate(*archive, given, folder, trust=trust)
        return
    if not model.endswith(".toml"):
        built_in: Model = resolve_name(MODELS, model, "built-in model")()
        defaults = {each.name: each.default for each in built_in.inputs if each.default is not None}
        inputs = {**defaults, **_parse_inputs(built_in.name, built_in.inputs, given)}
        _show_run(built_in, inputs, (), {})
        return
    from uqpen.study.load import load_study

    study = load_study(Path(model))
    for label, variant in study.models.items():
        if len(study.models) > 1:
            standard_output().print(f"\n{label}", markup=False)
        # What a model takes in place of the study's inputs is what makes it that model.
        trial = variant.model
        set_here = {**_parse_inputs(trial.name, trial.inputs, given), **variant.given}
        inputs = study.joint.nominal() | set_here
        if complete := study.joint.following(set_here):  # what follows from a value set here
            columns = complete({name: np.array(value) for name, value in inputs.items()})
            inputs = {name: float(value) for name, value in columns.items()}
        _show_run(trial, inputs, study.constraints, study.display_units())


def _run_surrogate(
    path: Path, name: str, given: Iterable[str], folder: Path | None, *, trust: bool
) -> None:
    """Show the predictions of a surrogate, in the units of its study."""
    from uqpen.archive.read import open_archive
    from uqpen.cli.console import plain_table, standard_output
    from uqpen.core.units import DIMENSIONLESS, scale
    from uqpen.surrogates.archived_surrogate import EXTRAPOLATED, std_names

    tree = open_archive(path)
    found = open_surrogate(tree, path, name, folder, trust=trust)
    values = _parse_inputs(found.fitted.name, found.inputs, given)
    if any(found.fitted.missing_inputs(values)):
        from uqpen.verification.archived_study import restored_study

        names = set(found.fitted.random_inputs)
        with restored_study(tree, folder, trust=trust) as restored:
            nominal = restored.study.joint.nominal()
        values = {**{name: value for name, value in nominal.items() if name in names}, **values}
    predicted = found.predict(values)
    rows = []
    for output in found.outputs:
        unit = output.preferred_unit
        shown = "" if unit == DIMENSIONLESS else unit
        value = scale(unit).from_si(float(predicted[output.name]))
        rows.append((output.name, f"{value:.10g}", shown))
        for std in filter(predicted.__contains__, std_names(output)):
            deviation = scale(unit).difference_from_si(float(predicted[std]))
            rows.append((std, f"{deviation:.3g}", shown))
    standard_output().print(plain_table(["output", "value", "unit"], rows))
    said = found.extrapolation_text(predicted[EXTRAPOLATED]), found.refutation_text
    for text in filter(None, said):
        show_message(text)


def _show_run(
    model: Model,
    inputs: Mapping[str, float],
    constraints: Sequence[Constraint],
    units: Mapping[str, str],
) -> None:
    """Make one run, and show the name, value and unit of each output."""
    import numpy as np

    from uqpen.cli.console import plain_table, standard_output
    from uqpen.core.errors import ModelError
    from uqpen.core.status import STATUS_TEXT, Status
    from uqpen.execution import Evaluator

    if model.uncallable_reason:
        raise ModelError(model.uncallable_reason)
    missing = [
        f'--set {name}="… {model.input(name).unit}"' for name in model.missing_inputs(inputs)
    ]
    if missing:
        raise ModelError(f"{model.name} also needs\n  " + "\n  ".join(missing))
    model.prepare()
    columns = {name: np.array([value]) for name, value in inputs.items()}
    results = Evaluator(model, constraints)(columns)
    status = Status(int(results.status[0]))
    if status is not Status.OK:
        raise ModelError(f"the run is {STATUS_TEXT[status]}: {results.reasons[0]}")
    values = model.derive(results.outputs, results.status, columns)
    outputs = ((each, units.get(each.name, each.preferred_unit)) for each in model.all_outputs)
    rows = list(_shown_values(outputs, values, 10))
    standard_output().print(plain_table(["output", "value", "unit"], rows))


def _shown_values(
    outputs: Iterable[tuple[Output, str]], values: Mapping[str, FloatArray], digits: int
) -> Iterator[tuple[str, str, str]]:
    """Yield the name of each output, its value, category, or range and dimensions, and its unit."""
    import numpy as np

    from uqpen.core.units import DIMENSIONLESS, scale

    for output, unit in outputs:
        found, shown = values[output.name][0], "" if unit == DIMENSIONLESS else unit
        if output.categories:
            yield output.name, output.categories[round(float(found))].label, ""
        elif output.dims:
            ends = scale(unit).from_si(np.array([np.nanmin(found), np.nanmax(found)]))
            lowest, highest = (f"{end:.{digits}g}" for end in ends)
            ended = f"{np.isfinite(found).sum()} of " if np.isnan(found).any() else ""
            along = ", ".join(f"{each.name} ({ended}{len(each.values)})" for each in output.dims)
            yield output.name, f"{lowest} to {highest} along {along}", shown
        elif output.absent and np.isnan(found):
            yield output.name, f"none: {output.absent}", ""
        else:
            yield output.name, f"{scale(unit).from_si(float(found)):.{digits}g}", shown


def _parse_inputs(model: str, inputs: Sequence[Input], pairs: Iterable[str]) -> dict[str, float]:
    """Parse the command line's ``name=value`` pairs; values in SI units."""
    from uqpen.core.errors import ModelError, QuantityError
    from uqpen.core.model import find_variable
    from uqpen.core.quantities import parse_quantity

    values = {}
    for text in pairs:
        name, equals, written = text.partition("=")
        if not equals:
            raise ModelError(f'--set {text}: expected the form name="value unit"')
        variable = find_variable(inputs, name.strip(), "input", model)
        try:
            values[variable.name] = (
                variable.label_code(written)
                if variable.labels
                else parse_quantity(written, variable.unit).value
            )
        except QuantityError as error:
            raise ModelError(f"--set {variable.name}: {error}") from None
    return values


# The trial run of ``uqpen check --try``.


def show_trial_runs(study: ValidatedStudy) -> ExitCode:
    """Make a run of each model at the nominal inputs; show its outputs, or why it failed."""
    from uqpen.checkpoints.folder import keep_runs
    from uqpen.cli.console import plain_table, show_line, standard_output
    from uqpen.core.status import STATUS_TEXT, Status
    from uqpen.workflow.design_runs import trial_run

    code = ExitCode.DONE
    for name, variant in study.models.items():
        show_line("")
        trial = trial_run(study, name)
        which = f" of {name}" if study.has_several_models else ""
        messages = [f"warning: {warning}" for warning in trial.warnings]
        messages += [trial.noise] if trial.noise else []
        if trial.status is Status.OK:
            show_line(f"trial run{which} at the nominal inputs, {trial.seconds:.3g} s\n")
            quantities = study.model_quantities(variant.model)
            outputs = ((each.output, each.display_unit) for each in quantities)
            results = trial.results
            values = variant.model.derive(results.outputs, results.status, trial.inputs)
            rows = list(_shown_values(outputs, values, 6))
            standard_output().print(plain_table(["output", "value", "unit"], rows))
            archive = Path("archives") / f"{study.name}.nc"
            if keep_runs(study, archive, trial.inputs, trial.results, name):
                show_line(f"kept for {archive}, as a design has this point")
        else:
            code = ExitCode.TOO_MANY_FAILED
            show_line(f"trial run{which} at the nominal inputs: {STATUS_TEXT[trial.status]}")
            if trial.folder is not None:
                messages.insert(0, f"  its files are in {trial.folder}")
            messages.insert(0, f"  {trial.reason}")
        for text in messages:
            show_line(wrapped_message(text, sys.stdout))
    return code
