"""Attributes of a model class of the user's, checked before any run."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.core.arrays import is_finite_number
from uqpen.core.errors import QuantityError
from uqpen.core.labels import NAME, RESERVED
from uqpen.core.limits import Limits
from uqpen.core.model import Bounds, Category, Dimension, Input, Model, Output, Variable
from uqpen.core.units import are_convertible, si_unit

__all__ = ["find_variable_faults"]

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
