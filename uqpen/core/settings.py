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
from typing import Any, NamedTuple, TypeVar

from uqpen.core.errors import Problem, QuantityError, SettingsError, toml_text
from uqpen.core.labels import NAME
from uqpen.core.quantities import parse_quantity
from uqpen.core.units import DIMENSIONLESS

__all__ = [
    "Context",
    "Setting",
    "as_float",
    "choice",
    "choices",
    "count",
    "declared_settings",
    "difference",
    "file",
    "flag",
    "name",
    "number",
    "probabilities",
    "quantities",
    "quantity",
    "read_each",
    "read_list",
    "setting",
    "share",
    "text",
    "validate",
]

T = TypeVar("T")

_KEY = "uqpen.setting"
_REQUIRED: Any = dataclasses.MISSING

# More runs than this fit no machine's memory.
_MOST = 100_000_000


class Context(NamedTuple):
    """Surroundings of a value in a study file.

    Attributes
    ----------
    like : str
        A unit of the dimension that its quantities have.
    folder : Path
        What the paths of files are relative to.
    """

    like: str = ""
    folder: Path = Path()


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


def setting(
    kind: str,
    expected: str,
    accepts: Callable[[Any], bool],
    *,
    read: Callable[[Any, Context], Any] = lambda written, context: written,
    default: Any = _REQUIRED,
    key: str = "",
) -> Any:
    """Declare a setting; see `Setting`. One with the default None may be None."""
    optional = (lambda value: value is None or accepts(value)) if default is None else accepts
    metadata = {_KEY: Setting(kind, expected, optional, read, key)}
    if isinstance(default, dict):
        return dataclasses.field(default_factory=dict, hash=False, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def count(
    *,
    minimum: float = 1,
    maximum: float = _MOST,
    default: Any = _REQUIRED,
    expected: str = "",
) -> Any:
    """Declare an integer, at least `minimum` and at most `maximum`; `expected` is for messages."""

    def accepts(value: Any) -> bool:
        is_whole = isinstance(value, int) and not isinstance(value, bool)
        return is_whole and minimum <= value <= maximum

    expected = expected or f"a whole number, at least {minimum} and at most {maximum:_}"
    return setting("count", expected, accepts, default=default)


def number(
    *,
    above: float = -math.inf,
    below: float = math.inf,
    at_most: float = math.inf,
    default: Any = _REQUIRED,
    expected: str = "",
) -> Any:
    """Declare a plain number strictly between two others, and at most a third."""
    is_within = _is_within(above, below)
    limit = f" and at most {at_most:g}" if at_most < math.inf else ""
    return setting(
        "number",
        expected or _range_text(above, below) + limit,
        lambda value: is_within(value) and value <= at_most,
        read=lambda written, context: as_float(written),
        default=default,
    )


def quantity(
    *,
    above: float = -math.inf,
    default: Any = _REQUIRED,
    unit: str = "",
    expected: str = "",
    key: str = "",
) -> Any:
    """Declare a value in SI units, which a study file gives with a unit.

    Its dimension is that of its context, or of `unit`, if that is given.
    """
    return setting(
        "quantity with a unit of its own" if unit else "quantity",
        expected or _range_text(above, math.inf, "a quantity"),
        _is_within(above, math.inf),
        read=lambda written, context: parse_quantity(written, unit or context.like).value,
        default=default,
        key=key,
    )


def difference(*, above: float = -math.inf, default: Any = _REQUIRED) -> Any:
    """Declare a difference of two values, such as a standard deviation; see `quantity`."""
    return setting(
        "difference",
        _range_text(above, math.inf, "a quantity"),
        _is_within(above, math.inf),
        read=lambda written, context: parse_quantity(written, context.like, difference=True).value,
        default=default,
    )


def share(*, expected: str, default: Any = _REQUIRED) -> Any:
    """Declare a part of a whole, from 0 to 1, which a study file may give in per cent."""
    is_number = _is_within(-math.inf, math.inf)
    return setting(
        "share",
        expected,
        lambda value: is_number(value) and 0 <= value <= 1,
        read=lambda written, context: parse_quantity(written, DIMENSIONLESS).value,
        default=default,
    )


def quantities(*, unit: str) -> Any:
    """Declare a table of names, each with a quantity in the dimension of `unit`."""

    def read(written: Any, context: Context) -> Any:
        if not isinstance(written, dict):
            return written
        values = read_each(written, lambda value: parse_quantity(value, unit).value)
        return dict(zip(written, values, strict=True))

    is_number = _is_within(-math.inf, math.inf)
    return setting(
        "quantities",
        "a table",
        lambda value: isinstance(value, Mapping) and all(map(is_number, value.values())),
        read=read,
        default={},
    )


def probabilities(
    *, key: str = "", default: tuple[float, ...] = (), always: tuple[float, ...] = ()
) -> Any:
    """Declare numbers strictly between 0 and 1, ascending; those of a study join `always`."""
    is_within = _is_within(0, 1)

    def read_one(written: Any) -> float:
        if not is_within(written):
            raise QuantityError(toml_text(written), "a probability between 0 and 1")
        return float(written)

    return setting(
        "probabilities",
        "probabilities between 0 and 1",
        lambda values: all(map(is_within, values)),
        read=lambda written, _: tuple(sorted({*always, *read_list(written, read_one)})),
        default=default,
        key=key,
    )


def choice(*names: str, default: Any = _REQUIRED, expected: str = "", key: str = "") -> Any:
    """Declare a setting that is one of `names`."""
    expected = expected or f"one of {_listing(names)}"
    return setting("choice", expected, names.__contains__, default=default, key=key)


def choices(*names: str) -> Any:
    """Declare a table that gives some names one of `names` each; empty by default."""
    expected = f"a table of names, each with one of {_listing(names)}"

    def accepts(value: Any) -> bool:
        return isinstance(value, Mapping) and all(
            isinstance(key, str) and chosen in names for key, chosen in value.items()
        )

    def read_one(written: Any) -> Any:
        if written not in names:
            raise QuantityError(toml_text(written), expected)

    def read(written: Any, context: Context) -> Any:
        if isinstance(written, dict):
            read_each(written, read_one)
        return written

    return setting("choices", expected, accepts, read=read, default={})


def flag(*, default: Any = _REQUIRED) -> Any:
    """Declare a boolean."""
    accepts = lambda value: isinstance(value, bool)  # noqa: E731 - a predicate among its like
    return setting("flag", "true or false", accepts, default=default)


def text(*, expected: str, default: Any = _REQUIRED, key: str = "") -> Any:
    """Declare a text that is not empty."""
    accepts = lambda value: isinstance(value, str) and bool(value.strip())  # noqa: E731 - as above
    return setting("text", expected, accepts, default=default, key=key)


def name(*, default: Any = _REQUIRED) -> Any:
    """Declare the name of another part of the study."""
    accepts = lambda value: isinstance(value, str) and bool(NAME.match(value))  # noqa: E731
    return setting("name", "a name in quotes", accepts, default=default)


def file(*, default: Any = _REQUIRED) -> Any:
    """Declare a path; in a study file, it is relative to the folder of that file."""

    def read(written: Any, context: Context) -> Any:
        is_name = isinstance(written, str) and written and "\0" not in written
        return context.folder / written if is_name else written

    accepts = lambda value: isinstance(value, Path)  # noqa: E731 - a predicate among its like
    return setting("file", "the path of a file", accepts, read=read, default=default)


def as_float(written: Any) -> Any:
    """Convert an integer to a float; one too large becomes infinite, which nothing accepts."""
    if not isinstance(written, int) or isinstance(written, bool):
        return written
    return float(written) if abs(written) < 1e300 else math.inf


def read_list(written: Any, read_one: Callable[[Any], T]) -> list[T]:
    """Read each entry of a list in a study file; see `read_each`."""
    if not isinstance(written, list):
        raise QuantityError(toml_text(written), "a list in square brackets")
    return read_each(written, read_one)


def read_each(written: list[Any] | dict[str, Any], read_one: Callable[[Any], T]) -> list[T]:
    """Read each value of a list or a table; raise one SettingsError for all that are wrong."""
    found, problems = [], []
    for place, value in written.items() if isinstance(written, dict) else enumerate(written):
        try:
            found.append(read_one(value))
        except (SettingsError, QuantityError) as error:
            problems += [problem.within(place) for problem in error.problems]
    if problems:
        raise SettingsError(problems)
    return found


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
        Problem((declared.key or field.name,), toml_text(value), declared.expected)
        for field, declared in declared_settings(owner)
        if not declared.accepts(value := getattr(owner, field.name))
    ]
    problems = problems or list(further)
    if problems:
        raise SettingsError(problems)


def _is_within(above: float, below: float) -> Callable[[Any], bool]:
    def accepts(value: Any) -> bool:
        return (
            isinstance(value, int | float)
            and not isinstance(value, bool)
            and above < value < below
            and math.isfinite(value)
        )

    return accepts


def _listing(names: tuple[str, ...]) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _range_text(above: float, below: float, what: str = "a number") -> str:
    limits = [f"above {above:g}"] if above > -math.inf else []
    limits += [f"below {below:g}"] if below < math.inf else []
    return " ".join([what, *[" and ".join(limits)] * bool(limits)])
