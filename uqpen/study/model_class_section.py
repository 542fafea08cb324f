"""``[model] use``: a model class from a file, a module or an installed package."""

from __future__ import annotations

from uqpen.core.errors import toml_text
from uqpen.core.lookup import choices
from uqpen.core.model import Model
from uqpen.models.unloaded_model import UnloadedModel
from uqpen.models.user_defined_model import UserDefinedModel
from uqpen.study.model_variables import find_variable_faults
from uqpen.study.table_reader import TableReader
from uqpen.study.user_defined_members import MODEL, installed_names, is_reference, read_instance

__all__ = ["read_model_class"]


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
    return None if faults else UserDefinedModel(model, name, surroundings)


def _unloaded(table: TableReader, name: str) -> UnloadedModel | None:
    known = (table.document.objects or {}).get(table.path)
    if isinstance(known, UnloadedModel):
        for key in table.content:  # the class alone knows its settings
            table.take(key)
        return known
    expected = "a built-in model: the inputs of others are known by code that is not executed"
    table.add_wrong("use", name, expected)
    return None
