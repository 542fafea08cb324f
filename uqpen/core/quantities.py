"""Quantities: numbers with units, as people write them.

The number in front of a unit is read here, strictly (a units library that guesses reads ``17,5`` as
175); only the unit itself is given to the library.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from uqpen.core.errors import QuantityError, is_huge, toml_text
from uqpen.core.units import (
    ANY_DIMENSION,
    DIMENSIONLESS,
    NUMBER,
    Scale,
    are_convertible,
    describe,
    scale,
    si_unit,
)

_NUMBER = re.compile(NUMBER)
# The minus of typesetting, as uqpen shows numbers itself, beside the one of the keyboard.
_MINUS = "\N{MINUS SIGN}"
_PLUS_MINUS = re.compile(r"±|\+/-|\+-")
_DECIMAL_COMMA = re.compile(r"\s*([+-]?[0-9]+),([0-9]+)(.*)\Z", re.DOTALL)

# No quantity comes near this number of characters.
_LONGEST = 2000


@dataclass(frozen=True)
class Quantity:
    """A value in the coherent SI unit of `unit`, the unit to show it in."""

    value: float
    unit: str


@dataclass(frozen=True)
class Spread:
    """A mean and a standard deviation, both in SI units, and the unit they were written in."""

    mean: float
    std: float
    unit: str


def parse_quantity(
    text: str | float, like: str, *, difference: bool = False, allow_offset: bool = True
) -> Quantity:
    """Read a quantity such as ``"17.5 g/cm^3"``, in the dimension of a unit.

    A difference of 5 degC, a standard deviation say, is 5 K. Without `allow_offset`, the unit of
    another value may have no zero of its own.

    QuantityError if it is not a finite number with a unit of that dimension.
    """
    if isinstance(text, int | float) and not isinstance(text, bool) and not is_huge(text):
        text = repr(text)
    if not isinstance(text, str):
        raise QuantityError(toml_text(text), describe(like))
    number, unit = _split(text, like)
    measure = _checked_scale(text, unit, like)
    if measure.offset and not (allow_offset or difference):
        found = f"{toml_text(text)}, in a unit with a zero of its own"
        raise QuantityError(found, f'a difference, such as "1 {si_unit(like)}"')
    value = measure.difference_to_si(number) if difference else measure.to_si(number)
    if not math.isfinite(value):
        raise QuantityError(f"{toml_text(text)}, which is not finite", describe(like))
    return Quantity(value, unit)


def parse_any_dimension(text: str, *, difference: bool = False) -> Quantity:
    """Read a finite number with a unit of any dimension, or none; QuantityError for other text."""
    return parse_quantity(text, _split(text, DIMENSIONLESS)[1], difference=difference)


def half_last_digit(text: str, *, difference: bool = False) -> float:
    """Return half a unit of the last digit of a quantity as it is written, in SI units.

    >>> half_last_digit("0.140 m")
    0.0005

    QuantityError as for `parse_any_dimension`.
    """
    quantity = parse_any_dimension(text, difference=difference)
    match = _NUMBER.match(text.strip().replace(_MINUS, "-"))
    assert match is not None  # as the quantity could be read
    digits, _, power = match[0].lower().partition("e")
    last = int(power or 0) - len(digits.partition(".")[2].replace("_", ""))
    return scale(quantity.unit).difference_to_si(float(f"5e{last - 1}"))


def parse_spread(text: str, like: str) -> Spread | None:
    """Read a mean with a standard deviation such as ``"(2.5 ± 0.05) g/cm^3"``.

    Both may have their units, as in ``"10 mm ± 0.5 mm"``, and the deviation may be a share of the
    mean, as in ``"10 kohm ± 5 %"``. Returns None for a text without ``±`` (or ``+/-``).

    QuantityError if it has one but cannot be read.
    """
    _refuse_length(text)
    if not _PLUS_MINUS.search(text):
        return None
    plain = text.replace(_MINUS, "-")
    # The content of brackets, if any, and the unit behind them.
    inner, bracket, unit = plain.strip().rpartition(")")
    is_grouped = bool(bracket) and inner.startswith("(")
    inner, unit = (inner[1:], unit.strip()) if is_grouped else (plain, "")
    parts = [part.strip() for part in _PLUS_MINUS.split(inner)]
    example = _example(like)
    shape = f'a mean and a standard deviation, such as "{example}"'
    if len(parts) != 2:
        raise QuantityError(toml_text(text), shape)
    for part in parts:
        _refuse_comma(part)
    numbers = [_NUMBER.match(part) for part in parts]
    if numbers[0] is None or numbers[1] is None:
        raise QuantityError(toml_text(text), f"{shape}, the unit once and behind the bracket")
    mean, std = (float(match[0]) for match in numbers if match)
    own, other = (
        part[match.end() :].strip() for part, match in zip(parts, numbers, strict=True) if match
    )
    is_relative = other == "%" and unit != "%"
    if own == other == "%":
        meant = f'"({mean:g} ± {std:g}) %", or "({mean:g} ± {mean * std / 100:g}) %"'
        raise QuantityError(toml_text(text), f"{meant} if it is a share of the mean")
    if (is_grouped and (own or (other and not is_relative))) or (
        not is_grouped and not is_relative and bool(own) != bool(other)
    ):
        raise QuantityError(toml_text(text), f"{shape}, the unit once and behind the bracket")
    unit = unit or own
    measure = _checked_scale(text, unit, like)
    if is_relative and measure.offset:
        found = f"{toml_text(text)}, a share of a value with a zero of its own"
        raise QuantityError(found, shape)
    if is_relative:
        found_std = abs(measure.to_si(mean)) * std / 100
    else:
        found_std = _checked_scale(text, other or unit, like).difference_to_si(std)
    return Spread(measure.to_si(mean), found_std, unit or DIMENSIONLESS)


def _example(like: str) -> str:
    """Return an example of a spread in the dimension of `like`, for a message."""
    like = "cm" if like is ANY_DIMENSION else like
    return "2.5 ± 0.5" if si_unit(like) == DIMENSIONLESS else f"(2.5 ± 0.5) {like}"


def _split(text: str, like: str) -> tuple[float, str]:
    """Split the text of a quantity into number and unit."""
    _refuse_length(text)
    _refuse_comma(text)
    plain = text.strip().replace(_MINUS, "-")
    match = _NUMBER.match(plain)
    if match is None:
        raise QuantityError(toml_text(text), describe(like))
    number, unit = match[0], plain[match.end() :].strip()
    if _PLUS_MINUS.search(unit):
        raise QuantityError(f"{toml_text(text)}, with a ±", f"{describe(like)}, without a spread")
    return float(number), unit or DIMENSIONLESS


def _refuse_length(text: str) -> None:
    if len(text) > _LONGEST:
        found = f"a text of {len(text)} characters"
        raise QuantityError(found, f"a quantity of at most {_LONGEST} characters")


def _refuse_comma(text: str) -> None:
    if match := _DECIMAL_COMMA.match(text):
        written = "{}.{}{}".format(*match.groups()).strip()
        found = f"{toml_text(text)}, with a decimal comma"
        raise QuantityError(found, f'a decimal point: "{written}"')


def _checked_scale(text: str, unit: str, like: str) -> Scale:
    """Return the scale of `unit`; check that it has the dimension of `like`."""
    unit = unit or DIMENSIONLESS
    if not are_convertible(unit, like):
        missing = ", a number without a unit" if unit == DIMENSIONLESS else ""
        raise QuantityError(f"{toml_text(text)}{missing}", describe(like))
    return scale(unit)
