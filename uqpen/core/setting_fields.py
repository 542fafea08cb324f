"""Fields of a dataclass that are settings: their declarations, and the values of an instance."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from pathlib import Path
from typing import Any, NamedTuple

from uqpen.core.errors import Problem, QuantityError, SettingsError
from uqpen.core.list_reading import as_float, read_each
from uqpen.core.quantities import parse_any_dimension

__all__ = [
    "NUMBERS",
    "QUANTITY_LIST",
    "SETTING",
    "Context",
    "Setting",
    "convert_quantities",
    "declared_settings",
    "written_settings",
]

# Key of the declaration in the metadata of a field.
SETTING = "uqpen.setting"

# Kinds of settings whose values are tuples; the Python constructor takes any sequence.
QUANTITY_LIST, NUMBERS = "list of quantities", "list of numbers"

# Attribute with the texts of the quantities that an instance was made from.
_WRITTEN = "_written_quantities"


class Context(NamedTuple):
    """Context of the values in a table: a unit of their dimension, and the folder of its files.

    Without `allow_offset`, the quantities are differences, in a unit without a zero of its own.
    """

    like: str = ""
    folder: Path = Path()
    allow_offset: bool = True


@dataclasses.dataclass(frozen=True)
class Setting:
    """Accepted values of a field, and how a study file gives them.

    Parameters
    ----------
    kind : str
        The kind of its values, such as ``"quantity"``.
    expected : str
        The accepted values in words, for a message.
    accepts : callable
        Whether a value is accepted.
    read : callable
        Converts a value of a study file in its `Context`; raises a SettingsError or a
        QuantityError where `expected` does not say enough.
    key : str
        The key in a study file, if it is not the name of the field.
    """

    kind: str
    expected: str
    accepts: Callable[[Any], bool]
    read: Callable[[Any, Context], Any]
    key: str = ""

    @property
    def has_dimension(self) -> bool:
        """True if its values have the dimension of their context."""
        return self.kind in ("quantity", "difference")

    @property
    def is_quantity(self) -> bool:
        """True if its values are quantities, which text can give."""
        return self.kind.startswith(("quantity", "difference", "share"))


def declared_settings(owner: Any) -> Iterator[tuple[dataclasses.Field[Any], Setting]]:
    """Yield the fields of a dataclass that are settings, each with its `Setting`.

    A class that is no dataclass has none.
    """
    for field in getattr(owner, "__dataclass_fields__", {}).values():
        if SETTING in field.metadata:
            yield field, field.metadata[SETTING]


def written_settings(owner: Any) -> dict[str, Any]:
    """Return the settings of an instance as a study file states them, without the defaults.

    Returns
    -------
    dict
        By key; quantities as they were written.
    """
    found = {}
    written = getattr(owner, _WRITTEN, {})
    for field, declared in declared_settings(owner):
        value, default = getattr(owner, field.name), field.default
        if callable(field.default_factory):
            default = field.default_factory()
        if value != default:
            found[declared.key or field.name] = written.get(field.name, value)
    return found


def convert_quantities(owner: Any) -> Iterator[Problem]:
    """Convert the quantities given as text to SI units; yield a problem for each unreadable one."""
    written: dict[str, Any] = {}
    for field, declared in declared_settings(owner):
        given = getattr(owner, field.name)
        is_sequence = declared.kind in (QUANTITY_LIST, NUMBERS)
        if not is_sequence and not (isinstance(given, str) and declared.is_quantity):
            continue
        try:
            value = (_convert_each if is_sequence else _convert)(given, declared)
        except (SettingsError, QuantityError) as error:
            yield from (each.within(declared.key or field.name) for each in error.problems)
            continue
        if value is given:  # it is no sequence, so it will not be accepted
            continue
        written[field.name] = list(given) if is_sequence else given
        object.__setattr__(owner, field.name, value)
    if written:
        object.__setattr__(owner, _WRITTEN, written)


def _convert_each(sequence: Any, declared: Setting) -> Any:
    """Convert a sequence to a tuple of floats, quantities given as text to SI units."""
    # A mapping would lose its values, and a set has no order.
    if isinstance(sequence, str | Mapping | Set) or not isinstance(sequence, Iterable):
        return sequence

    def convert(value: Any) -> Any:
        if isinstance(value, str) and declared.kind == QUANTITY_LIST:
            return parse_any_dimension(value).value
        return value.item() if hasattr(value, "item") else value

    return tuple(map(as_float, read_each(list(sequence), convert)))


def _convert(text: str, declared: Setting) -> float:
    if declared.has_dimension:  # of a context that is not known here
        return parse_any_dimension(text, difference=declared.kind == "difference").value
    return float(declared.read(text, Context()))
