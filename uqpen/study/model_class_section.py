"""``use`` and ``object`` in ``[model]``: a class of the user's, or a Python object."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from uqpen.core.arrays import is_finite_number
from uqpen.core.errors import ModelError, QuantityError, toml_text
from uqpen.core.labels import NAME, RESERVED
from uqpen.core.limits import Limits
from uqpen.core.lookup import choices
from uqpen.core.model import Bounds, Category, Dimension, Input, Model, Output, Variable
from uqpen.core.settings import flag, text
from uqpen.core.units import are_convertible, si_unit
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
from uqpen.study.named_object import OBJECT
from uqpen.study.table_reader import TableReader
from uqpen.study.user_defined_members import MODEL, installed_names, is_reference, read_instance
from uqpen.study.variables_section import read_variables

__all__ = ["find_variable_faults", "read_model_class", "read_object"]

Faults = Iterator[tuple[str, str]]


def find_variable_faults(model: Model) -> Faults:
    """Yield what is wrong with the attributes of a model, and what is expected."""
    if not isinstance(getattr(model, "name", None), str):
        yield "no name", 'an attribute such as name = "my-model"'
    if not _is(model.enforced_limits, Limits):
        yield (
            f"enforced_limits = {model.enforced_limits!r}",
            "an object of uqpen.core.limits.Limits",
        )
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
    yield from _alternative_faults(model, known)
    yield from _dimension_faults(model, known)


def _variable_faults(variable: Input | Output, known: set[str]) -> Faults:
    if not NAME.match(variable.name) or variable.name in RESERVED or variable.name in known:
        others = ", ".join(sorted(RESERVED))
        expected = f"a name of letters, digits and _, at most 100, used once, none of {others}"
        yield _text(variable), expected
    yield from _unit_faults(variable)
    if isinstance(variable, Input):
        yield from _value_faults(variable)
    elif not _are(variable.categories, Category):
        yield f"{_text(variable)} with other categories", "categories, a tuple of Category"


def _unit_faults(variable: Variable) -> Faults:
    what = _text(variable)
    try:
        if (coherent := si_unit(variable.unit)) != variable.unit:
            yield what, f"its coherent SI unit, {coherent}; display_unit can be another"
        elif not are_convertible(variable.preferred_unit, variable.unit):
            yield f"{what} with display_unit={variable.display_unit!r}", f"a unit like {coherent}"
    except QuantityError as error:
        yield f"{what}: {error}", "its coherent SI unit"


def _value_faults(variable: Input) -> Faults:
    """Yield what is wrong with the default value and the bounds of an input."""
    what = _text(variable)
    if not _is(variable.bounds, Bounds):
        yield f"{what} with bounds={variable.bounds!r}", "an object of uqpen.core.model.Bounds"
    if variable.default is not None and not is_finite_number(variable.default):
        yield (
            f"{what} with default={variable.default!r}",
            f"a number in its SI unit, {variable.unit}",
        )


def _alternative_faults(model: Model, known: set[str]) -> Faults:
    groups = model.alternatives
    is_valid = _are(groups, tuple) and all(name in known for group in groups for name in group)
    if not is_valid:
        yield f"alternatives = {groups!r}", "a tuple of tuples with names of inputs"


def _dimension_faults(model: Model, known: set[str]) -> Faults:
    """Yield what is wrong with dimensions of outputs; each is the same in all outputs."""
    seen: dict[str, Dimension] = {}
    for output in model.outputs if _are(getattr(model, "outputs", None), Output) else ():
        if not _are(output.dims, Dimension):
            yield f"{_text(output)} with other dims", "dims, a tuple of Dimension"
            continue
        for dimension in output.dims:
            if dimension.name in known:
                yield f"{_text(dimension)} with the name of a variable", "names that differ"
            elif dimension.name not in seen:
                yield from _unit_faults(dimension)
            elif seen[dimension.name] != dimension:
                found = f"{_text(dimension)} with other coordinates in {output.name}"
                yield found, "the same in all outputs along it"
            seen.setdefault(dimension.name, dimension)


def _is(value: object, kind: type) -> bool:
    """Check the class of an attribute: a user's class can have anything in its place."""
    return isinstance(value, kind)


def _are(values: object, kind: type) -> bool:
    return isinstance(values, tuple) and all(isinstance(each, kind) for each in values)


def _text(variable: Variable) -> str:
    return f"{type(variable).__name__}({variable.name!r}, {variable.unit!r})"


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
