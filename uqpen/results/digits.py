"""Form of numbers and units: as many digits as intervals justify, powers, signs and ranges."""

from __future__ import annotations

import math
import re
from decimal import ROUND_CEILING, Decimal, InvalidOperation

from uqpen.core.errors import plural

MINUS = "−"
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLAIN = {superscript: plain for plain, superscript in SUPERSCRIPTS.items()}

# Powers in a unit, and the signs of temperatures.
_POWER = re.compile(r"(?<=[A-Za-z)])\^?(-?\d+)")
_SYMBOLS = {"degC": "°C", "degF": "°F"}
_DEGREES = re.compile(r"\bdeg[CF]\b")

# Digits of an estimate without an interval.
_DIGITS = 4
# From the first power of ten to below the second, numbers are written out.
_WRITTEN_OUT = (-3, 6)
# A side of an interval that is shorter than this part of its estimate is 0 but for rounding.
_ROUNDING = 1e-12
# Digits before the point that are written without thin spaces.
_UNGROUPED = 4
# Digits of each number by itself where an interval spans a tenfold of a logarithmic scale.
_OF_TENFOLDS = 2
# Below it, in per cent, a number is easier to read with its power of ten.
_LEAST_PERCENT = Decimal("0.00001")


def estimate_text(
    estimate: float,
    lower: float,
    upper: float,
    *,
    is_short: bool = False,
    is_logarithmic: bool = False,
) -> str:
    """An estimate in the digits that its interval leaves a meaning.

    Two digits of the longer side, and the estimate to the same place. ± is the half-width of an
    interval whose sides are equal in these digits; of any other, both ends are given. Four digits
    where there is no interval. The end of an interval to one side is rounded outward, so that it
    remains a bound.

    Parameters
    ----------
    estimate, lower, upper : float
        NaN for a bound that does not exist.
    is_short : bool
        Whether a number without an interval ends before zeros, as in a publication.
    is_logarithmic : bool
        Whether an interval over a tenfold or more has two digits of each number by itself.

    Examples
    --------
    >>> estimate_text(0.49274, 0.49004, 0.49544)
    '0.4927 ± 0.0027'
    >>> estimate_text(71.1, 70.6, 72.9)
    '71.1 (70.6 … 72.9)'
    >>> estimate_text(0.4663, 0.4640, 0.4687)
    '0.4663 (0.4640 … 0.4687)'
    >>> estimate_text(436.2, 33.7, 4152.9, is_logarithmic=True)
    '440 (34 … 4200)'
    """
    if is_logarithmic and _spans_tenfolds(lower, upper):
        middle, *between = (
            number_text(each, _OF_TENFOLDS, is_short=False) for each in (estimate, lower, upper)
        )
        return f"{middle} ({range_text(*between)})"
    sides = _sides(estimate, lower, upper)
    half = max(sides, default=math.nan)
    if not 0 < half < math.inf:
        return number_text(estimate, is_short=is_short or half == 0)
    number_format = _NumberFormat(estimate, half)
    if len(sides) == 2 and number_format.is_same(*sides):
        return number_format.write(with_half_width(number_format(estimate), number_format(half)))
    ends = range_text(*number_format.ends(estimate, lower, upper))
    if number_format.exponent:
        return number_format.write(f"{number_format(estimate)}, {ends}")
    return f"{number_format(estimate)} ({ends})"


def tolerance_limit_text(estimate: float, upper: float) -> str:
    """A tolerance limit, with its upper bound in the same digits, rounded up.

    >>> tolerance_limit_text(13.4812, 13.7612)
    '13.48, at most 13.77'
    """
    return _one_sided_text(estimate, math.nan, upper)


def lower_tolerance_limit_text(estimate: float, lower: float) -> str:
    """A tolerance limit, with its lower bound in the same digits, rounded down.

    >>> lower_tolerance_limit_text(13.4812, 13.2087)
    '13.48, at least 13.20'
    """
    return _one_sided_text(estimate, lower, math.nan)


def _one_sided_text(estimate: float, lower: float, upper: float) -> str:
    """Write a limit with its only bound, which is rounded outward."""
    side = max(_sides(estimate, lower, upper), default=math.nan)
    if not 0 < side < math.inf:
        return number_text(estimate, is_short=side == 0)
    number_format = _NumberFormat(estimate, side)
    if math.isnan(upper):
        bound = f"at least {number_format.rounded_down(lower)}"
    else:
        bound = f"at most {number_format.rounded_up(upper)}"
    return number_format.write(f"{number_format(estimate)}, {bound}")


def tolerance_interval_texts(lower: float, upper: float) -> tuple[str, str]:
    """The ends of a tolerance interval, rounded outward to three digits of its width.

    >>> tolerance_interval_texts(9.8134, 14.2187)
    ('9.81', '14.22')
    """
    if not 0 < max(_sides(upper, lower, math.nan), default=math.nan) < math.inf:
        return number_text(lower), number_text(upper)
    number_format = _NumberFormat(max(abs(lower), abs(upper)), (upper - lower) / 10)
    ends = number_format.rounded_down(lower), number_format.rounded_up(upper)
    return number_format.with_power(ends[0]), number_format.with_power(ends[1])


def estimate_texts(
    estimate: float,
    lower: float,
    upper: float,
    *others: float,
    is_logarithmic: bool = False,
    longest: float = math.inf,
) -> tuple[str, ...]:
    """An estimate, the ends of its interval, and other values, in the digits of `estimate_text`.

    Each stands by itself, as in a sentence. A side longer than `longest` has the digits of that.

    >>> estimate_texts(0.49274, 0.49004, 0.49544, 0.5)
    ('0.4927', '0.4900', '0.4954', '0.5000')
    """
    values = (estimate, lower, upper, *others)
    if is_logarithmic and _spans_tenfolds(lower, upper):
        return tuple(number_text(each, _OF_TENFOLDS, is_short=False) for each in values)
    half = min(max(_sides(estimate, lower, upper), default=math.nan), longest)
    if not 0 < half < math.inf:
        return tuple(map(number_text, values))
    number_format = _NumberFormat(estimate, half)
    texts = (
        number_format(estimate),
        *number_format.ends(estimate, lower, upper),
        *map(number_format, others),
    )
    return tuple(
        "0" if each == 0 else number_format.with_power(text)
        for each, text in zip(values, texts, strict=True)
    )


def number_text(value: float, digits: int = _DIGITS, *, is_short: bool = True) -> str:
    """A number without an interval; a short one ends before zeros behind the point.

    >>> number_text(8892.0), number_text(-2.5731), number_text(6.559e6), number_text(0.0001)
    ('8892', '−2.573', '6.559×10⁶', '1×10⁻⁴')
    """
    if not math.isfinite(value):
        return "–" if math.isnan(value) else f"{value:g}"
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    exponent = int(power)
    first, end = _WRITTEN_OUT
    if first <= exponent < end or not value:
        rounded = Decimal(mantissa).scaleb(exponent)
        text = f"{rounded:.{max(0, digits - 1 - exponent)}f}"
        return _typeset(_shortened(text) if is_short or not value else text)
    mantissa = _shortened(mantissa) if is_short else mantissa
    return typeset_minus(f"{mantissa}×10{str(exponent).translate(SUPERSCRIPTS)}")


def grouped_number(number: int) -> str:
    """A whole number with thin spaces between thousands."""
    return f"{number:,}".replace(",", "\u202f")


def count_text(number: int, noun: str) -> str:
    """Return a number and its noun, which is in the singular for one.

    >>> count_text(1, "run"), count_text(20, "run")
    ('1 run', '20 runs')
    """
    return f"{grouped_number(number)} {plural(noun, number)}"


def percent_text(probability: float) -> str:
    """A probability in per cent, in as many digits as it has."""
    return f"{100 * probability:.10g} %"


def percent_texts(*values: float, longest: float = math.inf) -> tuple[str, ...]:
    """A probability, the ends of its interval, and others, in the same digits as the tables.

    A hundred times the number would be rounded anew, and differ where it ends in a five.

    >>> percent_texts(0.2075, 0.1825, 0.2325)
    ('20.7 %', '18.2 %', '23.3 %')
    """
    texts = estimate_texts(*values, longest=longest)
    return tuple(f"{_times_hundred(text)} %" for text in texts)


def with_half_width(estimate: str, half: str) -> str:
    """A number with the half-width of its interval."""
    return f"{estimate} ± {half}"


def range_text(lower: str, upper: str) -> str:
    """The ends of an interval or of a range."""
    return f"{lower} … {upper}"


def typeset_unit(unit: str) -> str:
    """Return a unit with raised powers, and with the signs of temperatures.

    >>> typeset_unit("kg m-3"), typeset_unit("g/cm^3"), typeset_unit("degC")
    ('kg m⁻³', 'g/cm³', '°C')
    """
    symbols = _DEGREES.sub(lambda match: _SYMBOLS[match[0]], unit)
    return _POWER.sub(lambda match: match[1].translate(SUPERSCRIPTS), symbols)


def _sides(estimate: float, lower: float, upper: float) -> list[float]:
    """Return the lengths of an interval below and above its estimate, where there are bounds."""
    sides = [side for side in (estimate - lower, upper - estimate) if not math.isnan(side)]
    return [0.0 if abs(side) <= _ROUNDING * abs(estimate) else side for side in sides]


def _spans_tenfolds(lower: float, upper: float) -> bool:
    return 0 < 10 * lower <= upper < math.inf


def _shortened(decimal: str) -> str:
    return decimal.rstrip("0").rstrip(".") if "." in decimal else decimal


def typeset_minus(text: str) -> str:
    """Return a number with a minus sign in place of a hyphen, and without one if it is zero.

    >>> typeset_minus("-0.518"), typeset_minus("-0.000")
    ('−0.518', '0.000')
    """
    if text.startswith("-") and not text.strip("-0."):
        return text[1:]
    return text.replace("-", MINUS)


def _typeset(text: str) -> str:
    """Return a number with a minus sign, and in groups if it has more than four digits."""
    whole, point, part = typeset_minus(text).partition(".")
    digits = whole.lstrip(MINUS)
    if len(digits) > _UNGROUPED:
        whole = whole.replace(digits, grouped_number(int(digits)))
    return f"{whole}{point}{part}"


def _times_hundred(text: str) -> str:
    """Move the point of a number two places, in its text."""
    plain = text.replace(MINUS, "-").replace("\u202f", "")
    mantissa, times, power = plain.partition("×10")
    exponent = int(power.translate(_PLAIN)) if times else 0
    try:
        moved = Decimal(mantissa).scaleb(exponent + 2)
    except InvalidOperation:  # a dash or a question mark stands for no number
        return text
    if 0 < moved < _LEAST_PERCENT and times:
        return f"{mantissa}×10{str(exponent + 2).translate(SUPERSCRIPTS)}"
    return typeset_minus(f"{moved:f}")


class _NumberFormat:
    """Writes numbers to one place, given by the uncertainty, with one power of ten."""

    def __init__(self, estimate: float, half: float) -> None:
        # Below 1e-300, ten to the exponent would be 0.
        exponent = max(-300, math.floor(math.log10(max(abs(estimate), half))))
        first, end = _WRITTEN_OUT
        self.exponent = 0 if first <= exponent < end else exponent
        self._power = 10.0**self.exponent
        superscript = str(self.exponent).translate(SUPERSCRIPTS)
        self._power_text = f"×10{superscript}" if self.exponent else ""
        self._places = max(0, 1 - math.floor(math.log10(half / self._power)))

    def __call__(self, value: float) -> str:
        if math.isnan(value):
            return "?"
        return _typeset(f"{value / self._power:.{self._places}f}")

    def is_same(self, one: float, other: float) -> bool:
        """Return whether two lengths differ by at most half of the last place."""
        return abs(one - other) <= 0.5 * self._power * 10.0**-self._places

    def rounded_up(self, value: float) -> str:
        """Write a bound from above, which may not become less."""
        # Twelve digits: 13.77 in binary is a little more or less.
        digits = Decimal(f"{value / self._power:.12g}")
        return _typeset(f"{digits.quantize(Decimal(1).scaleb(-self._places), ROUND_CEILING):f}")

    def rounded_down(self, value: float) -> str:
        """Write a bound from below, which may not become more."""
        mirrored = self.rounded_up(-value)
        return mirrored[1:] if mirrored.startswith(MINUS) else typeset_minus(f"-{mirrored}")

    def ends(self, estimate: float, lower: float, upper: float) -> tuple[str, str]:
        """Write the ends of an interval; the only end that differs is rounded outward."""
        has_lower, has_upper = lower < estimate, upper > estimate
        if has_upper and not has_lower:
            return self(lower), self.rounded_up(upper)
        if has_lower and not has_upper:
            return self.rounded_down(lower), self(upper)
        return self(lower), self(upper)

    def with_power(self, text: str) -> str:
        """Return a number with its power of ten."""
        return f"{text}{self._power_text}"

    def write(self, body: str) -> str:
        """The body with the power of ten that its numbers leave out."""
        return f"({body}){self._power_text}" if self.exponent else body
