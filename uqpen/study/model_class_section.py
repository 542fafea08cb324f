"""``[model] use``: a model class from a file, a module or an installed package."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.core.errors import QuantityError, toml_text
from uqpen.core.labels import NAME, RESERVED
from uqpen.core.lookup import choices
from uqpen.core.model import Input, Model, Output
from uqpen.core.units import si_unit
from uqpen.models.outside_model import OutsideModel
from uqpen.models.unloaded_model import UnloadedModel
from uqpen.study.outside_members import MODEL, installed_names, is_reference, read_instance
from uqpen.study.table_reader import TableReader

__all__ = ["find_variable_faults", "read_model_class"]


def read_model_class(table: TableReader) -> Model | None:
    """Read a model whose class is not built in; None where a mistake was noted.

    Without trust, a class of a file or a module is not loaded. The model then has the variables
    that the caller knows from an archive, and cannot be run.
    """
    name = table.text("use", "the name of a model")
    if name is None:
        return None
    installed = [] if is_reference(name) else installed_names(MODEL, name)
    if not is_reference(name) and name not in installed:
        expected = f"a built-in model; {choices(name, [*MODEL.family, *installed])}"
        table.add_wrong("use", name, expected)
        return None
    if is_reference(name) and not table.trust:
        return _unloaded(table, name)
    model, surroundings = read_instance(table, "use", name, MODEL)
    if model is None:
        return None
    faults = list(find_variable_faults(model))
    for found, expected in faults:
        table.add_problem("use", f"{toml_text(name)}, which has {found}", expected)
    return None if faults else OutsideModel(model, name, surroundings)


def _unloaded(table: TableReader, name: str) -> UnloadedModel | None:
    known = (table.document.objects or {}).get(table.path)
    if isinstance(known, UnloadedModel):
        for key in table.content:  # the class alone knows its settings
            table.take(key)
        return known
    expected = "a built-in model: the inputs of others are known by code that is not executed"
    table.add_wrong("use", name, expected)
    return None


def find_variable_faults(model: Model) -> Iterator[tuple[str, str]]:
    """Yield what is wrong with the name, inputs and outputs of a model, and what is expected."""
    if not isinstance(getattr(model, "name", None), str):
        yield "no name", 'an attribute such as name = "my-model"'
    known: set[str] = set()
    for key, kind in (("inputs", Input), ("outputs", Output)):
        variables = getattr(model, key, None)
        if not (isinstance(variables, tuple) and variables) or not all(
            isinstance(each, kind) for each in variables
        ):
            yield f"no {key}", f"an attribute {key}, a tuple of {kind.__name__}"
            continue
        for variable in variables:
            yield from _variable_faults(variable, known)
            known.add(variable.name)


def _variable_faults(variable: Input | Output, known: set[str]) -> Iterator[tuple[str, str]]:
    what = f"{type(variable).__name__}({variable.name!r}, {variable.unit!r})"
    if not NAME.match(variable.name) or variable.name in RESERVED or variable.name in known:
        others = ", ".join(sorted(RESERVED))
        expected = f"a name of letters, digits and _, at most 100, used once, none of {others}"
        yield what, expected
    try:
        if (coherent := si_unit(variable.unit)) != variable.unit:
            yield what, f"its coherent SI unit, {coherent}; display_unit can be another"
    except QuantityError as error:
        yield f"{what}: {error}", "its coherent SI unit"
