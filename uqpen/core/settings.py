"""Settings: the fields of a frozen dataclass that a study file may give.

A design, a distribution or a model is a frozen dataclass; each of its fields says here what it
accepts. The same declaration serves the Python constructor, which refuses a wrong value, and the
study file, whose reader knows from it how to read each key and what to say of a mistake.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from uqpen.core.errors import Problem, SettingsError, toml_text
from uqpen.core.labels import NAME

__all__ = [
    "Setting",
    "choice",
    "choices",
    "count",
    "declared_settings",
    "difference",
    "file",
    "flag",
    "name",
    "number",
    "quantity",
    "share",
    "validate",
]

_KEY = "uqpen.setting"

# More runs than this fit no machine's memory.
_MOST = 100_000_000


@dataclasses.dataclass(frozen=True)
class Setting:
    """Accepted values of a field.

    Parameters
    ----------
    kind : str
        ``"count"``, ``"number"``, ``"quantity"``, ``"difference"``, ``"choice"``, ``"choices"``,
        ``"flag"``, ``"file"`` or ``"name"``.
    expected : str
        The accepted values in words, for a message.
    accepts : callable
        Whether a value, of the right type already, is in range.
    """

    kind: str
    expected: str
    accepts: Callable[[Any], bool]


def count(
    *,
    minimum: int = 1,
    maximum: int = _MOST,
    default: Any = dataclasses.MISSING,
    expected: str = "",
) -> Any:
    """Declare an integer, at least `minimum` and at most `maximum`; `expected` is for messages."""

    def accepts(value: Any) -> bool:
        is_whole = isinstance(value, int) and not isinstance(value, bool)
        return is_whole and minimum <= value <= maximum

    expected = expected or f"a whole number, at least {minimum} and at most {maximum:_}"
    return _field(Setting("count", expected, accepts), default)


def number(
    *,
    above: float = -math.inf,
    below: float = math.inf,
    at_most: float = math.inf,
    default: Any = dataclasses.MISSING,
) -> Any:
    """Declare a plain number strictly between two others, and at most a third."""
    is_within = _is_within(above, below)
    limit = f" and at most {at_most:g}" if at_most < math.inf else ""
    accepts = lambda value: is_within(value) and value <= at_most  # noqa: E731 - as in `file`
    return _field(Setting("number", range_text(above, below) + limit, accepts), default)


def quantity(*, above: float = -math.inf, default: Any = dataclasses.MISSING) -> Any:
    """Declare a value in the dimension of its context: SI here, with a unit in a study file."""
    expected = range_text(above, math.inf, "a quantity")
    return _field(Setting("quantity", expected, _is_within(above, math.inf)), default)


def share(*, expected: str, default: Any = dataclasses.MISSING) -> Any:
    """Declare a part of a whole, from 0 to 1, which a study file may give in per cent."""
    is_number = _is_within(-math.inf, math.inf)
    accepts = lambda value: is_number(value) and 0 <= value <= 1  # noqa: E731 - as in `file`
    return _field(Setting("quantity", expected, accepts), default)


def difference(*, above: float = -math.inf, default: Any = dataclasses.MISSING) -> Any:
    """Declare a difference of two values, such as a standard deviation; see `quantity`."""
    expected = range_text(above, math.inf, "a quantity")
    return _field(Setting("difference", expected, _is_within(above, math.inf)), default)


def choice(*names: str, default: Any = dataclasses.MISSING) -> Any:
    """Declare a setting that is one of `names`."""
    listing = ", ".join(f'"{name}"' for name in names)
    return _field(Setting("choice", f"one of {listing}", names.__contains__), default)


def choices(*names: str) -> Any:
    """Declare a table that gives some names one of `names` each; empty by default."""
    listing = ", ".join(f'"{name}"' for name in names)

    def accepts(value: Any) -> bool:
        return isinstance(value, Mapping) and all(
            isinstance(key, str) and chosen in names for key, chosen in value.items()
        )

    setting = Setting("choices", f"a table of names, each with one of {listing}", accepts)
    return dataclasses.field(default_factory=dict, hash=False, metadata={_KEY: setting})


def flag(*, default: Any = dataclasses.MISSING) -> Any:
    """Declare a boolean."""
    return _field(Setting("flag", "true or false", lambda value: isinstance(value, bool)), default)


def file(*, default: Any = dataclasses.MISSING) -> Any:
    """Declare a path; in a study file, it is relative to the folder of that file."""
    accepts = lambda value: isinstance(value, Path)  # noqa: E731 - a predicate among its like
    return _field(Setting("file", "the path of a file", accepts), default)


def name(*, default: Any = dataclasses.MISSING) -> Any:
    """Declare the name of another part of the study."""
    accepts = lambda value: isinstance(value, str) and bool(NAME.match(value))  # noqa: E731
    return _field(Setting("name", "a name in quotes", accepts), default)


def declared_settings(owner: Any) -> Iterator[tuple[dataclasses.Field[Any], Setting]]:
    """Yield the fields of a dataclass that are settings, each with its `Setting`.

    A class that is no dataclass has none.
    """
    for field in getattr(owner, "__dataclass_fields__", {}).values():
        if _KEY in field.metadata:
            yield field, field.metadata[_KEY]


def validate(owner: Any, further: Iterable[Problem] = ()) -> None:
    """Check the settings of an instance; raise an error if one is out of range.

    Parameters
    ----------
    owner : dataclass instance
        Usually ``self``, in ``__post_init__``.
    further : iterable of Problem
        Problems between settings; used only where each setting is valid by itself.

    Raises
    ------
    SettingsError
        Naming every setting that is wrong.
    """
    problems = [
        Problem((field.name,), toml_text(getattr(owner, field.name)), setting.expected)
        for field, setting in declared_settings(owner)
        if not setting.accepts(getattr(owner, field.name))
    ]
    problems = problems or list(further)
    if problems:
        raise SettingsError(problems)


def _field(setting: Setting, default: Any) -> Any:
    """Make a field with its setting; a field with the default None may be None."""
    if default is None:
        accepts = setting.accepts
        setting = dataclasses.replace(
            setting, accepts=lambda value: value is None or accepts(value)
        )
    return dataclasses.field(default=default, metadata={_KEY: setting})


def _is_within(above: float, below: float) -> Callable[[Any], bool]:
    def accepts(value: Any) -> bool:
        return (
            isinstance(value, int | float)
            and not isinstance(value, bool)
            and math.isfinite(value)
            and above < value < below
        )

    return accepts


def range_text(above: float, below: float, what: str = "a number") -> str:
    limits = [f"above {above:g}"] if above > -math.inf else []
    limits += [f"below {below:g}"] if below < math.inf else []
    return " ".join([what, *[" and ".join(limits)] * bool(limits)])
