"""``scipy = { … }`` and ``chaospy = { … }`` of an input: a distribution of another library."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.core.errors import QuantityError
from uqpen.core.lookup import nearest
from uqpen.core.model import Input
from uqpen.core.units import ANY_DIMENSION, DIMENSIONLESS, are_convertible, describe
from uqpen.distributions.distribution import Distribution, UnloadedDistribution
from uqpen.distributions.frozen import (
    LIBRARIES,
    FrozenDistribution,
    frozen_distribution,
    frozen_names,
)
from uqpen.distributions.joint_distribution import RandomInput
from uqpen.study.named_object import OBJECT, read_named_object
from uqpen.study.table_reader import TableReader

__all__ = ["FROZEN", "SETTINGS", "read_frozen"]

# The keys that stand where the name of a distribution would.
FROZEN = (*LIBRARIES, OBJECT)

# The key with the settings of an object of a user's class, for reading only.
SETTINGS = "settings"


def read_frozen(table: TableReader, variable: Input, library: str) -> RandomInput | None:
    """Read an input with a distribution of another library; None where a mistake was noted.

    The table has the name of the distribution, its parameters as numbers, and the unit of its
    values. In place of them, the text of a study in Python may name an object.
    """
    if library == OBJECT and SETTINGS in table:
        return _read_own_object(table, variable)
    unit = _unit(table, variable)
    if library == OBJECT:
        return _read_object(table, variable, unit)
    noted = len(table.problems)
    name = table.text("name", f"the name of a continuous distribution of {LIBRARIES[library]}")
    parameters = dict(_parameters(table))
    if name is None or len(table.problems) > noted:
        return None
    try:
        distribution = frozen_distribution(library, name, parameters, unit)
    except ImportError:
        table.add_problem((), f"a distribution of {library}", f"{library} to be installed")
    except LookupError:
        close = nearest(name, frozen_names(library))
        hint = f'; did you mean "{close}"?' if close else ""
        expected = f"a continuous distribution of {LIBRARIES[library]}{hint}"
        table.add_wrong("name", name, expected)
    except ValueError as error:
        table.add_problem((), f"{_listing(parameters)}: {error}", f"parameters of {name}")
    else:
        shown = "" if unit == DIMENSIONLESS else f" [{unit}]"
        text = f"{library} {name}: {_listing(parameters)}{shown}"
        return RandomInput(variable, distribution, unit, text)
    return None


def _read_object(table: TableReader, variable: Input, unit: str) -> RandomInput | None:
    """Read an input whose distribution is an object of the Python program."""
    name = table.text(OBJECT, "the text of a distribution")
    table.check_unknown_keys()
    objects = table.document.objects
    if objects is None or table.path not in objects:
        expected = "a distribution that a file can state: a file cannot contain a Python object"
        table.add_wrong(OBJECT, name, expected)
        return None
    distribution = FrozenDistribution(objects[table.path], unit)
    return None if name is None else RandomInput(variable, distribution, unit, name)


def _read_own_object(table: TableReader, variable: Input) -> RandomInput | None:
    """Read an input whose distribution is an object of a user's class; it may be absent."""
    expected = "a distribution that a file can state: a file cannot contain a Python object"
    found = read_named_object(table, "distribution", expected)
    table.take(SETTINGS)
    table.check_unknown_keys()
    if found is None:
        return None
    here = found.value if isinstance(found.value, Distribution) else None
    distribution = here or UnloadedDistribution(found.name)
    return RandomInput(variable, distribution, variable.preferred_unit, found.name)


def _parameters(table: TableReader) -> Iterator[tuple[str, float]]:
    for key in table:
        if key not in ("name", "unit"):
            value = table.take(key)
            if isinstance(value, int | float) and not isinstance(value, bool):
                yield key, float(value)
            else:
                table.add_wrong(key, value, "a number, in the unit of the values")


def _unit(table: TableReader, variable: Input) -> str:
    """Read the unit of the values of a distribution."""
    unit = table.text("unit", "the unit of its values") if "unit" in table else DIMENSIONLESS
    try:
        if unit is None or variable.unit is ANY_DIMENSION or are_convertible(unit, variable.unit):
            return unit or DIMENSIONLESS
        found = unit if "unit" in table else "values without a unit"
        table.add_problem("unit", found, describe(variable.unit))
    except QuantityError as error:
        table.add_problem("unit", error.found, error.expected)
    return DIMENSIONLESS


def _listing(parameters: dict[str, float]) -> str:
    return ", ".join(f"{key} {value:g}" for key, value in parameters.items()) or "no parameters"
