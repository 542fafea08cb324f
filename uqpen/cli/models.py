"""``uqpen models``: the built-in models, and what one of them takes and gives."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from uqpen.core.model import Model, Variable

__all__ = ["models"]


@click.command(short_help="List the built-in models, or describe one.")
@click.argument("name", required=False)
def models(name: str | None) -> None:
    """List the built-in models; with NAME, that model's inputs, outputs, units and defaults."""
    from uqpen.core.lookup import resolve, resolve_name
    from uqpen.models import MODELS

    if name is not None:
        _show_model(resolve_name(MODELS, name, "model")())
        return
    from uqpen.cli.screen import plain_table, standard_output

    rows = [(known, _paragraphs(resolve(reference))[0]) for known, reference in MODELS.items()]
    standard_output().print(plain_table(["model", "what it is"], rows))


def _paragraphs(model: type[Model]) -> list[str]:
    """What a model's documentation says before its first section, a line for each paragraph."""
    import inspect

    text = inspect.cleandoc(model.__doc__ or "").partition("\nParameters\n")[0]
    text = text.partition("\nReferences\n")[0]
    return [" ".join(paragraph.split()) for paragraph in text.strip().split("\n\n")]


def _show_model(model: Model) -> None:
    from uqpen.cli.screen import plain_table, standard_output

    console = standard_output()
    console.print(model.name, style="bold")
    for paragraph in _paragraphs(type(model)):
        console.print(paragraph, markup=False)
    for header, rows in (
        (["input", "unit", "values", ""], _inputs(model)),
        (["output", "unit", "values", ""], _outputs(model)),
        (["setting", "default", "values", ""], _settings(model)),
    ):
        if rows:
            console.print()
            console.print(plain_table(header, rows))
    for group in model.alternatives:
        console.print(f"\none is enough: {' or '.join(group)}", markup=False)


def _inputs(model: Model) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for variable in model.inputs:
        default = "" if variable.default is None else f"; default {variable.default:g}"
        values = f"{variable.bounds}{default}"
        rows.append((variable.name, variable.unit, values, _variable_remark(variable)))
    return rows


def _outputs(model: Model) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for variable in model.outputs:
        values = ", ".join(category.label for category in variable.categories) or "a number"
        rows.append((variable.name, variable.unit, values, _variable_remark(variable)))
    return rows


def _settings(model: Model) -> list[tuple[str, ...]]:
    """What a study may set in ``[model]`` beside the name."""
    from uqpen.core.settings import declared_settings

    return [
        (field.name, str(field.default), kind.expected, "")
        for field, kind in declared_settings(model)
    ]


def _variable_remark(variable: Variable) -> str:
    """What a variable is, where its name does not say it all."""
    return "" if variable.title == variable.name.replace("_", " ") else variable.title
