"""``uqpen models``: built-in and installed models, and what one of them takes and gives."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from uqpen.core.model import Model, Output, Variable


@click.command(short_help="List the models, or describe one.")
@click.argument("name", required=False)
def models(name: str | None) -> None:
    """List the built-in and installed models; with NAME, what that model takes and gives.

    Of a model, these are its inputs, outputs, units, settings and defaults.
    """
    from uqpen.cli.console import plain_table, standard_output
    from uqpen.core.lookup import choices, installed_packages, resolve
    from uqpen.models import MODELS
    from uqpen.study.user_defined_members import MODEL, load_class

    if name in MODELS:
        _show_model(resolve(MODELS[name])())
        return
    installed = installed_packages(MODEL.group)
    if name is not None:
        from uqpen.core.errors import ModelError, UnknownNameError
        from uqpen.models.user_code import error_text
        from uqpen.study.model_section import find_variable_faults

        if name not in installed:
            raise UnknownNameError(f'no model "{name}"; {choices(name, [*MODELS, *installed])}')
        cls, _ = load_class(name, Path(), MODEL)
        try:
            model: Model = cls()
            faults = list(find_variable_faults(model))
        except (Exception, SystemExit) as error:  # a user-defined class can raise anything
            raise ModelError(f'"{name}" without settings: {error_text(error)}') from None
        if faults:
            found, expected = faults[0]
            raise ModelError(f'"{name}" has {found}; expected {expected}')
        _show_model(model)
        return
    rows = [(known, _paragraphs(resolve(reference))[0]) for known, reference in MODELS.items()]
    # They are not imported: that can take long, or fail.
    rows += [
        (known, f"of the installed package {package}")
        for known, package in installed.items()
        if known not in MODELS
    ]
    standard_output().print(plain_table(["model", "what it is"], rows))


def _paragraphs(model: type[Model]) -> list[str]:
    """Return a model's documentation before its first section, a line for each paragraph."""
    text = inspect.cleandoc(model.__doc__ or "").partition("\nParameters\n")[0]
    text = text.partition("\nReferences\n")[0]
    return [" ".join(paragraph.split()) for paragraph in text.strip().split("\n\n")]


def _show_model(model: Model) -> None:
    from uqpen.cli.console import show_plain_tables, standard_output
    from uqpen.core.settings import declared_settings

    console = standard_output()
    console.print(model.name, style="bold", markup=False)
    for paragraph in _paragraphs(type(model)):
        console.print(paragraph, markup=False)
    inputs = []
    for variable in model.inputs:
        default = "" if variable.default is None else f"; default {variable.default:g}"
        inputs.append(_row(variable, f"{variable.bounds}{default}"))
    outputs = [_row(output, _describe_values(output)) for output in model.outputs]
    settings = [
        (field.name, str(field.default), setting.expected, "")
        for field, setting in declared_settings(model)
    ]
    show_plain_tables(
        console,
        (["input", "unit", "values", ""], inputs),
        (["output", "unit", "values", ""], outputs),
        (["setting", "default", "values", ""], settings),
    )
    for group in model.alternatives:
        console.print(f"\none is enough: {' or '.join(group)}", markup=False)


def _describe_values(output: Output) -> str:
    """Return what one run gives of an output."""
    if output.dims:
        return f"numbers along {', '.join(each.name for each in output.dims)}"
    return ", ".join(category.label for category in output.categories) or "a number"


def _row(variable: Variable, values: str) -> tuple[str, ...]:
    """Return a row of a variable, with its title where that says more than its name."""
    title = "" if variable.title == variable.name.replace("_", " ") else variable.title
    return variable.name, variable.unit, values, title
