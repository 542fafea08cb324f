"""Name, inputs and outputs of a model class of the user's, checked before any run."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.core.errors import QuantityError
from uqpen.core.labels import NAME, RESERVED
from uqpen.core.model import Input, Model, Output
from uqpen.core.units import si_unit

__all__ = ["find_variable_faults"]


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
