"""``uqpen run``: one run of a model, to try it by hand."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from uqpen.core.arrays import FloatArray
    from uqpen.core.model import Model, Output
    from uqpen.distributions.constraints import Constraint

    Inputs = Mapping[str, float]

__all__ = ["run"]


@click.command(short_help="Run a model once and show its outputs.")
@click.argument("model")
@click.option(
    "--set",
    "given",
    multiple=True,
    metavar='NAME="VALUE UNIT"',
    help='The value of an input, such as impact_velocity="1400 m/s".',
)
def run(model: str, given: tuple[str, ...]) -> None:
    """Run MODEL once: a built-in model, or a study file, whose inputs are then at their medians."""
    from uqpen.cli.screen import plain_table, standard_output

    trials = list(_trial_runs(model))
    for label, trial, inputs, own, constraints in trials:
        if len(trials) > 1:
            standard_output().print(f"\n{label}", markup=False)
        # What a model takes in place of the study's inputs is what makes it that model.
        inputs = {**inputs, **_parse_inputs(trial, given), **own}
        rows = list(_output_rows(trial, inputs, constraints))
        standard_output().print(plain_table(["output", "value", "unit"], rows))


def _trial_runs(
    name: str,
) -> Iterator[tuple[str, Model, Inputs, Inputs, Sequence[Constraint]]]:
    """Yield each model with its name in the study, its inputs and those that cannot be set."""
    from uqpen.core.lookup import resolve_name
    from uqpen.models import MODELS

    if name.endswith(".toml"):
        from uqpen.study.load import load_study

        study = load_study(Path(name))
        nominal = study.joint.nominal()
        for label, variant in study.models.items():
            yield label, variant.model, nominal, variant.given, study.constraints
    else:
        model: Model = resolve_name(MODELS, name, "model")()
        defaults = {v.name: v.default for v in model.inputs if v.default is not None}
        yield "", model, defaults, {}, ()


def _output_rows(
    model: Model, inputs: Inputs, constraints: Sequence[Constraint]
) -> Iterator[tuple[str, str, str]]:
    """Make one run, and yield the name, value and unit of each output."""
    import numpy as np

    from uqpen.core.errors import ModelError
    from uqpen.core.status import STATUS_TEXT, Status
    from uqpen.core.units import DIMENSIONLESS, scale
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
    for output in model.outputs:
        unit = output.preferred_unit
        if output.dims:
            shown = _field_text(output, results.outputs[output.name][0])
            yield output.name, shown, "" if unit == DIMENSIONLESS else unit
            continue
        value = float(results.outputs[output.name][0])
        if output.categories:
            yield output.name, output.categories[round(value)].label, ""
        else:
            shown = f"{scale(unit).from_si(value):.10g}"
            yield output.name, shown, "" if unit == DIMENSIONLESS else unit


def _field_text(output: Output, values: FloatArray) -> str:
    """Return the range of a field and its dimensions."""
    import numpy as np

    from uqpen.core.units import scale

    lowest, highest = scale(output.preferred_unit).from_si(
        np.array([np.nanmin(values), np.nanmax(values)])
    )
    ends = f"{lowest:.10g} to {highest:.10g}"
    along = ", ".join(f"{each.name} ({len(each.values)})" for each in output.dims)
    return f"{ends} along {along}"


def _parse_inputs(model: Model, pairs: Iterable[str]) -> dict[str, float]:
    """Parse the command line's ``name=value`` pairs; values in SI units."""
    from uqpen.core.errors import ModelError, QuantityError
    from uqpen.core.quantities import parse_quantity

    values = {}
    for text in pairs:
        name, equals, written = text.partition("=")
        if not equals:
            raise ModelError(f'--set {text}: expected the form name="value unit"')
        variable = model.input(name.strip())
        try:
            values[variable.name] = parse_quantity(written, variable.unit).value
        except QuantityError as error:
            raise ModelError(f"--set {variable.name}: {error}") from None
    return values
