"""Units: UDUNITS strings, their dimensions, and their coherent SI units.

Inside uqpen every value is in coherent SI units; the unit that a person wrote is kept for showing
it back.
"""

from __future__ import annotations

import functools
import locale
import math
import re
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np

from uqpen.core.errors import QuantityError, toml_text

DIMENSIONLESS = "1"


class _AnyDimension(str):
    """Type of a text that differs from any text of a user."""

    __slots__ = ()


# Stands for an unknown unit; it is recognised by its identity.
ANY_DIMENSION = _AnyDimension("any dimension")

# A decimal number, as a regular expression. Its possessive quantifiers give no digit back, so the
# time that a match takes is proportional to the length of the text, also where it fails.
NUMBER = r"[+-]?(?:[0-9]++(?:_[0-9]++)*+(?:\.[0-9]*+)?+|\.[0-9]++)(?:[eE][+-]?[0-9]++)?+"
# Powers of ten that are floating-point numbers, so that a whole number by one is rounded once.
_POWERS = np.array([float(10**digits) for digits in range(23)])

# Typeset powers; the library reads only a few of them.
_TYPESET = str.maketrans("⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "+-0123456789")

# No unit comes near this number of characters; the units library is not given longer ones.
_LONGEST = 500

# Tokens of a unit, for `_is_product_of_names`.
_POWER = r"(?:(?:\^|\*\*)?[+-]?[0-9]+)"
_OPERAND = re.compile(rf"\(|(?!(?:nmi|mph)\b)[A-Za-z_%°µμΩΩÅ℃℉′″'\"]+{_POWER}?|1(?![0-9])")
_OPERATOR = re.compile(rf"\){_POWER}?|\s*[*/·.]\s*|\s+")

# Coherent units, preferred to their base units; for messages, the quantity and an example.
_KNOWN = {
    "1": ("a plain number", "0.5"),
    "m": ("a length", "16 cm"),
    "m2": ("an area", "4 cm^2"),
    "m3": ("a volume", "2 l"),
    "kg": ("a mass", "5 kg"),
    "s": ("a time", "10 s"),
    "K": ("a temperature", "293 K"),
    "A": ("an electric current", "2 A"),
    "mol": ("an amount of substance", "1 mol"),
    "cd": ("a luminous intensity", "1 cd"),
    "rad": ("an angle", "30 degree"),
    "m s-1": ("a velocity", "1400 m/s"),
    "m s-2": ("an acceleration", "9.81 m/s^2"),
    "kg m-3": ("a density", "17.5 g/cm^3"),
    "Pa": ("a pressure or stress", "400 MPa"),
    "N": ("a force", "5 kN"),
    "J": ("an energy", "3 kJ"),
    "W": ("a power", "2 kW"),
    "V": ("a voltage", "230 V"),
    "ohm": ("a resistance", "50 ohm"),
    "s-1": ("a rate or frequency", "50 Hz"),
    "Pa s": ("a dynamic viscosity", "1 mPa s"),
    "m2 s-1": ("a diffusivity or kinematic viscosity", "1 mm^2/s"),
    "m3 s-1": ("a flow rate", "2 l/s"),
    "W m-1 K-1": ("a thermal conductivity", "0.5 W/(m K)"),
    "W m-2 K-1": ("a heat transfer coefficient", "10 W/(m^2 K)"),
    "J kg-1 K-1": ("a specific heat capacity", "900 J/(kg K)"),
}

# Further dimensions that messages describe; these base units stand in archives as they are.
_DESCRIBED = _KNOWN | {
    "m4": ("a second moment of area", "800 cm^4"),
    "m-1": ("a reciprocal length", "2 m-1"),
    "kg m-1": ("a mass per length", "3 kg/m"),
    "kg s-2": ("a force per length, or a surface tension", "5 kN/m"),
    "kg m-2 s-2": ("a force per volume", "25 kN/m^3"),
}

# Usual names, by what their authors may have typed, without regard to capitals.
_NAMES = ("kg", "kN", "MN", "kPa", "MPa", "GPa", "Hz", "kHz", "MHz", "GHz", "kJ", "MJ", "kW", "MW")
_SPELLINGS = {name.casefold(): name for name in _NAMES} | {
    "knm": "kN m",
    "kwh": "kW h",
    "wh": "W h",
    "ah": "A h",
    "mah": "mA h",
    "pct": "%",
    "deg": "degree",
    "none": DIMENSIONLESS,
    "unitless": DIMENSIONLESS,
}


@dataclass(frozen=True)
class Scale:
    """Conversion of a unit to its coherent SI unit: ``SI value = factor * value + offset``."""

    factor: float
    offset: float
    _exact: tuple[Decimal, Decimal] | None = None

    def to_si(self, value: float) -> float:
        """Convert a value to SI units; correctly rounded where the scale is a short decimal."""
        if self._exact is not None and math.isfinite(value):
            factor, offset = self._exact
            return float(Decimal(repr(float(value))) * factor + offset)
        return value * self.factor + self.offset

    def array_to_si(self, values: Any) -> Any:
        """Convert values of a program to SI units, in binary arithmetic."""
        return values * self.factor + self.offset

    def difference_to_si(self, value: float) -> float:
        """Convert a difference of two values to SI units: 5 degC is 5 K, not 278.15 K."""
        return Scale(self.factor, 0.0, self._exact and (self._exact[0], Decimal(0))).to_si(value)

    def from_si(self, value: Any) -> Any:
        """Convert a value, or an array of values, from SI units.

        A number that was written with up to 12 significant digits, and 22 decimals, is restored to
        the last bit: 0.007 m are 7 mm, where the quotient is 7.000000000000001.
        """
        quotient = (value - self.offset) / self.factor
        is_identity = self.factor == 1.0 and self.offset == 0.0
        if is_identity or not isinstance(value, float | int | np.ndarray):
            return quotient
        resolved = np.spacing(np.maximum(np.abs(value), abs(self.offset))) / abs(self.factor)
        found = _short_decimals(quotient, resolved)
        return found if isinstance(value, np.ndarray | np.generic) else float(found)

    def difference_from_si(self, value: Any) -> Any:
        """Convert a difference, or an array of differences, from SI units."""
        return value / self.factor


def _short_decimals(values: Any, resolved: Any) -> Any:
    """Return numbers with few decimals in place of those that are as good as equal to one.

    `resolved` are the smallest differences that the numbers resolve. Three digits before them are
    looked at, so one in a thousand of arbitrary numbers changes, by three of them at the most.
    """
    with np.errstate(all="ignore"):  # NaN and infinite values stay what they are
        digits = (-np.frexp(resolved)[1] * math.log10(2.0)).astype(int) - 3
        powers = _POWERS[np.clip(digits, 0, len(_POWERS) - 1)]
        short = np.rint(values * powers) / powers
        return np.where(np.abs(short - values) <= 3 * resolved, short, values)[()]


def _unit(text: str) -> Any:
    """Make the object of the units library."""
    if len(text) > _LONGEST:
        raise QuantityError(f"a unit of {len(text)} characters", f"one of at most {_LONGEST}")
    plain = text.translate(_TYPESET) or DIMENSIONLESS
    unit = _known_unit(plain)
    if unit is not None:
        return unit
    expected = 'a unit such as "g/cm^3", with whole powers'
    usual = re.sub(r"[A-Za-z]+", _usual_spelling, plain)
    if usual != plain and _known_unit(usual) is not None:
        expected += f'; did you mean "{usual}"?'
    raise QuantityError(f"{toml_text(text)}, which is not a known unit", expected)


def _known_unit(plain: str) -> Any:
    """Make the object of the units library, or return None if the text is no unit."""
    try:
        return _cf_units().Unit(plain) if _is_product_of_names(plain) else None
    except ValueError:
        return None


@functools.cache
def _cf_units() -> Any:
    """Import the units library, which not every command needs.

    While it is imported it restores the locale by the name that Python gives it, and the one of
    C.UTF-8 need not exist.
    """
    usual = locale.setlocale(locale.LC_NUMERIC)
    try:
        locale.setlocale(locale.LC_NUMERIC, "C")
        import cf_units
    finally:
        locale.setlocale(locale.LC_NUMERIC, usual)
    return cf_units


def _usual_spelling(name: re.Match[str]) -> str:
    """Return the usual spelling of a name that is no unit, where one is known."""
    usual = _SPELLINGS.get(name[0].casefold(), name[0])
    return name[0] if _known_unit(name[0]) is not None else usual


def _is_product_of_names(text: str) -> bool:
    """Check that a text consists of names with whole powers, multiplied and divided.

    The library takes far more, and misreads some of it: the ``.5`` of ``m^0.5`` as a factor of 5,
    ``nmi`` as a thousand millionth of a mile, ``mph`` as a thousandth of a phot. It ignores the
    text after a bracket too many.
    """
    position, depth, wants_operand = 0, 0, True
    while position < len(text):
        match = (_OPERAND if wants_operand else _OPERATOR).match(text, position)
        if match is None:
            return False
        depth += match[0].count("(") - match[0].count(")")
        if depth < 0:
            return False
        wants_operand = "(" in match[0] if wants_operand else ")" not in match[0]
        position = match.end()
    return depth == 0 and not wants_operand


@functools.cache
def _base(text: str) -> tuple[str, Decimal, Decimal]:
    """Return the base units of `text`, with the factor and offset that its definition prints."""
    definition = str(_unit(text).definition).strip()
    definition, _, offset = definition.partition(" @ ")
    definition = definition.strip("() ")
    match = re.match(rf"({NUMBER})\s*(.*)\Z", definition)
    number, base = match.groups() if match else ("1", definition)
    base = " ".join((base or DIMENSIONLESS).split("."))
    factor = Decimal(number)
    return base, factor, Decimal(offset.strip() or 0) * factor


def si_unit(text: str) -> str:
    """Return the coherent SI unit of the same dimension as a UDUNITS string.

    It is a named unit where there is a usual one (``"Pa"``), else the product of base units.

    QuantityError if `text` is not a unit.
    """
    return text if text is ANY_DIMENSION else _si_unit(text)


@functools.cache
def _si_unit(text: str) -> str:
    base = _base(text)[0]
    return next((known for known in _KNOWN if _base(known)[0] == base), base)


@functools.cache
def scale(text: str) -> Scale:
    """Return the conversion between a unit and its coherent SI unit."""
    base, factor, offset = _base(text)
    unit, si = _unit(text), _unit(base)
    zero = float(unit.convert(0.0, si)) if offset else 0.0
    binary = float(unit.convert(1.0, si)) - zero
    # The definition prints fifteen digits. A factor that needs fewer is the exact one (1000 for
    # g/cm^3, where the binary conversion gives 999.9999999999998); a longer one has been cut.
    digits = len(factor.normalize().as_tuple().digits)
    if digits < 14 and math.isclose(float(factor), binary, rel_tol=1e-13):
        return Scale(float(factor), float(offset), (factor, offset))
    return Scale(binary, zero)


def are_convertible(one: str, other: str) -> bool:
    """Check that two units have the same dimension, so that one converts into the other."""
    first, *others = [_unit(unit) for unit in (one, other) if unit is not ANY_DIMENSION] or [None]
    return all(first.is_convertible(unit) for unit in others)


def product(one: str, other: str) -> str:
    """Return the coherent SI unit of a product of quantities in two units."""
    return _combined(one, other, ".")


def ratio(one: str, other: str) -> str:
    """Return the coherent SI unit of a quotient of quantities in two units."""
    return _combined(one, other, "/")


def square_root(unit: str) -> str:
    """Return the coherent SI unit of the square root of a quantity; QuantityError without one."""
    if unit is ANY_DIMENSION:
        return unit
    try:
        with _cf_units().suppress_errors():  # which it would print
            return si_unit(str(_unit(si_unit(unit)).root(2).definition))
    except ValueError:
        raise QuantityError(toml_text(unit), "a unit with a square root") from None


def _combined(one: str, other: str, sign: str) -> str:
    if one is ANY_DIMENSION or other is ANY_DIMENSION:
        return ANY_DIMENSION
    return si_unit(f"({si_unit(one)}){sign}({si_unit(other)})")


def describe(unit: str) -> str:
    """Describe the quantity of a unit, with an example of its notation, for messages.

    >>> describe("kg m-3")
    'a density, such as "17.5 g/cm^3"'
    """
    if unit is ANY_DIMENSION:
        return 'a number with its unit, such as "16 cm"'
    si = si_unit(unit)
    if si in _DESCRIBED:
        what, example = _DESCRIBED[si]
        return f'{what}, such as "{example}"'
    return f'a quantity in {unit}, such as "1 {unit}"'
