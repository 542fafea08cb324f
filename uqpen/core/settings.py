"""Settings: the fields of a frozen dataclass that a study file may give.

A design, a distribution or a model is a frozen dataclass; each of its fields says here what it
accepts. The same declaration serves the Python constructor, which refuses a wrong value, and the
study file, whose reader knows from it how to read each key and what to say of a mistake.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from uqpen.core.arrays import is_finite_number
from uqpen.core.errors import Problem, QuantityError, SettingsError, toml_text
from uqpen.core.labels import NAME
from uqpen.core.quantities import parse_any_dimension, parse_quantity
from uqpen.core.units import DIMENSIONLESS, are_convertible

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
    """Accepted values of a field, and how a study file gives them."""

    kind: str  # the kind of its values, such as ``"quantity"``
    expected: str  # the accepted values in words, for a message
    accepts: Callable[[Any], bool]  # whether a value is accepted
    # Converts a value of a study file in its `Context`; raises a SettingsError or a QuantityError
    # where `expected` does not say enough.
    read: Callable[[Any, Context], Any]
    key: str = ""  # the key in a study file, if it is not the name of the field

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
    """Return the settings of an instance by key as a study file states them, without the defaults.

    Quantities are as they were written.
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
    """Convert the quantities given as text to SI units; yield a problem for each unreadable one.

    Those whose dimension is that of their context, which is not known here, have one dimension.
    """
    written: dict[str, Any] = {}
    first: tuple[str, str] | None = None  # setting and unit that the others have to agree with
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
        for text in filter(_is_text, given if is_sequence else [given]):
            if not declared.has_dimension and declared.kind != QUANTITY_LIST:
                continue
            key = declared.key or field.name
            unit = parse_any_dimension(text, difference=declared.kind == "difference").unit
            first = first or (key, unit)
            if not are_convertible(first[1], unit):
                as_first = (
                    f"a quantity convertible to {toml_text(first[1])}, the unit of {first[0]}"
                )
                yield Problem((key,), toml_text(text), as_first)
        written[field.name] = list(given) if is_sequence else given
        object.__setattr__(owner, field.name, value)
    if written:
        object.__setattr__(owner, _WRITTEN, written)


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


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


T = TypeVar("T")


def read_list(written: Any, read_one: Callable[[Any], T]) -> list[T]:
    """Read each entry of a list in a study file; see `read_each`."""
    if not isinstance(written, list):
        example = f": [{toml_text(written)}]" if isinstance(written, str | int | float) else ""
        raise QuantityError(toml_text(written), f"a list in square brackets{example}")
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


def as_float(written: Any) -> Any:
    """Convert an integer to a float; one too large becomes infinite, which nothing accepts."""
    if not isinstance(written, int) or isinstance(written, bool):
        return written
    return float(written) if abs(written) < 1e300 else math.inf


# Largest number of a setting that names no other.
_MOST = 100_000_000


def setting(
    kind: str,
    expected: str,
    accepts: Callable[[Any], bool],
    read: Callable[[Any, Context], Any] = lambda written, context: written,
    *,
    default: Any = dataclasses.MISSING,
    key: str = "",
) -> Any:
    """Declare a setting; see `Setting`. One with the default None may be None.

    The functions below declare the usual kinds; `options` are `default` and `key`.
    """
    optional = (lambda value: value is None or accepts(value)) if default is None else accepts
    metadata = {SETTING: Setting(kind, expected, optional, read, key)}
    if isinstance(default, dict):
        return dataclasses.field(default_factory=dict, hash=False, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def count(*, minimum: float = 1, maximum: float = _MOST, expected: str = "", **options: Any) -> Any:
    """Declare an integer, at least `minimum` and at most `maximum`; `expected` is for messages."""

    def accepts(value: Any) -> bool:
        is_whole = isinstance(value, int) and not isinstance(value, bool)
        return is_whole and minimum <= value <= maximum

    expected = expected or f"a whole number, at least {minimum} and at most {maximum:_}"
    return setting("count", expected, accepts, **options)


def number(
    *,
    above: float = -math.inf,
    below: float = math.inf,
    at_most: float = math.inf,
    expected: str = "",
    **options: Any,
) -> Any:
    """Declare a plain number strictly between two others, and at most a third."""
    accepts = lambda value: _is_within(value, above, below) and value <= at_most  # noqa: E731
    limit = f" and at most {at_most:g}" if at_most < math.inf else ""
    expected = expected or _range_text(above, below) + limit
    return setting("number", expected, accepts, lambda written, _: as_float(written), **options)


def quantity(
    kind: str = "quantity",
    *,
    above: float = -math.inf,
    unit: str = "",
    expected: str = "",
    **options: Any,
) -> Any:
    """Declare a value in SI units, which a study file gives with a unit.

    Its dimension is that of its context, or of `unit`, if that is given.
    """

    def read(written: Any, context: Context) -> float:
        return parse_quantity(
            written,
            unit or context.like,
            difference=kind == "difference",
            allow_offset=context.allow_offset,
        ).value

    expected = expected or _range_text(above, math.inf, "a quantity")
    kind = f"{kind} with a unit of its own" if unit else kind
    return setting(kind, expected, lambda value: _is_within(value, above), read, **options)


def limit(*, default: float) -> Any:
    """Declare an end of an interval in the dimension of its context, infinite for an open end."""
    accepts = lambda value: isinstance(value, int | float) and abs(value) <= math.inf  # noqa: E731
    return setting("quantity", "a quantity", accepts, default=default)


def difference(*, above: float = -math.inf, **options: Any) -> Any:
    """Declare a difference of two values, such as a standard deviation; see `quantity`."""
    return quantity("difference", above=above, **options)


def share(*, expected: str, **options: Any) -> Any:
    """Declare a part of a whole, from 0 to 1, which a study file may give in per cent."""
    read = lambda written, _: parse_quantity(written, DIMENSIONLESS).value  # noqa: E731
    accepts = lambda value: _is_within(value) and 0 <= value <= 1  # noqa: E731
    return setting("share", expected, accepts, read, **options)


def probabilities(*, always: tuple[float, ...] = (), **options: Any) -> Any:
    """Declare numbers strictly between 0 and 1, ascending; those of a study join `always`."""
    each = "a probability between 0 and 1"
    return _number_set(
        "probabilities", "probabilities between 0 and 1", each, 0, 1, always, options
    )


def periods(**options: Any) -> Any:
    """Declare numbers of cases above 1, ascending; none by default."""
    each = "a number of cases above 1, such as 10_000"
    return _number_set("return periods", "numbers of cases above 1", each, 1, math.inf, (), options)


def choice(*names: str, expected: str = "", **options: Any) -> Any:
    """Declare a setting that is one of `names`."""
    return setting("choice", expected or f"one of {_listing(names)}", names.__contains__, **options)


def choices(*names: str) -> Any:
    """Declare a table that gives some names one of `names` each; empty by default."""
    expected = f"a table of names, each with one of {_listing(names)}"

    def read_one(written: Any) -> Any:
        if written not in names:
            raise QuantityError(toml_text(written), expected)
        return written

    return _table("choices", expected, names.__contains__, read_one)


def probability_lists() -> Any:
    """Declare a table that gives some names probabilities between 0 and 1 each."""
    expected = "a list of probabilities between 0 and 1, such as [0.05, 0.95]"

    def accepts(values: Any) -> bool:
        is_list = isinstance(values, list | tuple) and bool(values)
        return is_list and all(_is_within(value, 0, 1) for value in values)

    def read_one(written: Any) -> Any:
        if not accepts(written):
            raise QuantityError(toml_text(written), expected)
        return [*map(float, written)]

    return _table("probability lists", f"a table of names, each with {expected}", accepts, read_one)


def quantities(*, unit: str) -> Any:
    """Declare a table of names, each with a quantity in the dimension of `unit`."""
    return _table(
        "quantities", "a table", _is_within, lambda written: parse_quantity(written, unit).value
    )


def quantity_list(**options: Any) -> Any:
    """Declare values in SI units, which a study file gives as a list of quantities."""

    def read(written: Any, context: Context) -> Any:
        return tuple(read_list(written, lambda each: parse_quantity(each, context.like).value))

    return setting(QUANTITY_LIST, "a list of quantities", _are_within, read, **options)


def numbers(*, minimum: float = -math.inf, **options: Any) -> Any:
    """Declare plain numbers, none below a minimum, which a study file gives as a list."""
    accepts = lambda values: _are_within(values) and min(values, default=0) >= minimum  # noqa: E731

    def read(written: Any, context: Context) -> Any:
        return tuple(map(as_float, written)) if isinstance(written, list) else written

    expected = "a list of numbers" + f", {minimum:g} or more" * (minimum > -math.inf)
    return setting(NUMBERS, expected, accepts, read, **options)


def flag(**options: Any) -> Any:
    """Declare a boolean."""
    return setting("flag", "true or false", lambda value: isinstance(value, bool), **options)


def text(*, expected: str, **options: Any) -> Any:
    """Declare a text that is not empty."""
    accepts = lambda value: isinstance(value, str) and bool(value.strip())  # noqa: E731
    return setting("text", expected, accepts, **options)


def name(**options: Any) -> Any:
    """Declare the name of another part of the study."""
    accepts = lambda value: isinstance(value, str) and bool(NAME.match(value))  # noqa: E731
    return setting("name", "a name in quotes", accepts, **options)


def names(*, expected: str, **options: Any) -> Any:
    """Declare different names of other parts of the study, which a study file lists."""

    def accepts(value: Any) -> bool:
        are_names = isinstance(value, tuple) and all(isinstance(each, str) for each in value)
        is_set = are_names and 0 < len(value) == len(set(value))
        return is_set and all(map(NAME.match, value))

    def read(written: Any, context: Context) -> Any:
        return tuple(written) if isinstance(written, list) else written

    return setting("names", expected, accepts, read, **options)


def file(**options: Any) -> Any:
    """Declare a path; in a study file, it is relative to the folder of that file."""

    def read(written: Any, context: Context) -> Any:
        is_name = isinstance(written, str) and written and "\0" not in written
        return context.folder / written if is_name else written

    accepts = lambda value: isinstance(value, Path)  # noqa: E731
    return setting("file", "the path of a file", accepts, read, **options)


def validate(owner: Any, further: Iterable[Problem] = ()) -> None:
    """Check the settings of an instance, usually in its ``__post_init__``.

    A quantity that is given as text, such as ``"2.5 m"``, is converted to SI units first. Further
    problems, between settings, are used only where each setting is valid by itself. The
    SettingsError names every setting that is wrong.
    """
    problems = list(convert_quantities(owner))
    if problems:
        raise SettingsError(problems)
    problems = [
        Problem((declared.key or field.name,), toml_text(value), declared.expected)
        for field, declared in declared_settings(owner)
        if not declared.accepts(value := getattr(owner, field.name))
    ]
    problems = problems or list(further)
    if problems:
        raise SettingsError(problems)


def _table(
    kind: str, expected: str, accepts: Callable[[Any], bool], read_one: Callable[[Any], Any]
) -> Any:
    """Declare a table of names, each with a value; empty by default."""

    def read(written: Any, context: Context) -> Any:
        if not isinstance(written, dict):
            return written
        return dict(zip(written, read_each(written, read_one), strict=True))

    def accepts_all(value: Any) -> bool:
        is_table = isinstance(value, Mapping) and all(isinstance(key, str) for key in value)
        return is_table and all(map(accepts, value.values()))

    return setting(kind, expected, accepts_all, read, default={})


def _number_set(
    kind: str,
    expected: str,
    expected_one: str,
    above: float,
    below: float,
    always: tuple[float, ...],
    options: Mapping[str, Any],
) -> Any:
    """Declare numbers strictly between two others, ascending; those of a study join `always`."""

    def read_one(written: Any) -> float:
        if not _is_within(written, above, below):
            raise QuantityError(toml_text(written), expected_one)
        return float(written)

    return setting(
        kind,
        expected,
        lambda values: all(_is_within(value, above, below) for value in values),
        lambda written, _: tuple(sorted({*always, *read_list(written, read_one)})),
        default=always,
        **options,
    )


def _is_within(value: Any, above: float = -math.inf, below: float = math.inf) -> bool:
    is_number = isinstance(value, int | float) and is_finite_number(value)
    return is_number and above < value < below


def _are_within(values: Any) -> bool:
    return isinstance(values, tuple) and all(map(_is_within, values))


def _listing(names: tuple[str, ...]) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _range_text(above: float, below: float, what: str = "a number") -> str:
    limits = [f"above {above:g}"] if above > -math.inf else []
    limits += [f"below {below:g}"] if below < math.inf else []
    return " ".join([what, *[" and ".join(limits)] * bool(limits)])
