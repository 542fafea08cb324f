"""``use`` and ``object`` in ``[model]``: a class of the user's, or a Python object."""

from __future__ import annotations

from dataclasses import dataclass

from uqpen.core.errors import ModelError, toml_text
from uqpen.core.lookup import choices
from uqpen.core.model import Model
from uqpen.core.settings import flag, text
from uqpen.models.dependencies import Dependencies
from uqpen.models.function_source import FunctionSource, function_source
from uqpen.models.python_function import PythonFunction, check_inputs
from uqpen.models.unloaded_model import UnloadedModel
from uqpen.models.user_defined_model import UserDefinedModel
from uqpen.study.model_section import (
    check_function_grids,
    read_function_limits,
    unloaded_function,
)
from uqpen.study.model_variables import find_variable_faults
from uqpen.study.named_object import OBJECT
from uqpen.study.table_reader import TableReader
from uqpen.study.user_defined_members import MODEL, installed_names, is_reference, read_instance
from uqpen.study.variables_section import read_variables

__all__ = ["read_model_class", "read_object"]


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


@dataclass(frozen=True)
class _ObjectSettings:
    """Settings of a function or a model that is an object; its source is for display only."""

    object: str = text(expected="the name of a function")
    source: str = text(expected="the source of a function", default="")
    vectorized: bool = flag(default=False)
    is_class: bool = flag(default=False, key="class")


def read_object(table: TableReader) -> Model | None:
    """Read a function or a model that is an object; None where a mistake was noted.

    The text of the table is never executed. It names the object, and shows its source to a
    reader. Where the object is not here, the model cannot be run.
    """
    noted = len(table.problems)
    settings = table.settings(_ObjectSettings)
    objects = table.document.objects
    if objects is None:
        named = table.content[OBJECT]
        expected = f'python = "my_model.py:{named}": a file cannot contain a Python object'
        table.add_wrong(OBJECT, named, expected)
    function = (objects or {}).get(table.path)
    is_vectorized = settings is not None and settings.vectorized
    limits = read_function_limits(table, is_vectorized=is_vectorized)
    variables = read_variables(table)
    check_function_grids(table, variables, is_vectorized=is_vectorized)
    inputs, outputs, units, fields = variables
    if settings is None or len(table.problems) > noted:
        return None
    name = settings.object
    observed = Dependencies(table.folder)
    if isinstance(function, UnloadedModel):
        return function
    if isinstance(function, Model):
        source = function_source(type(function))
        return UserDefinedModel(function, name, source=source, observed=observed)
    if function is None:
        function, _ = unloaded_function(name)
        source = FunctionSource.absent(name, settings.source)
    else:
        source = function_source(function)
        try:
            check_inputs(function, inputs)
        except ModelError as error:
            expected = "a function that can be called with the model's inputs"
            table.add_problem((), str(error), expected)
            return None
    declared = (name, inputs, outputs, units, settings.vectorized, None, limits, source, fields)
    return PythonFunction(function, *declared, observed=observed)
