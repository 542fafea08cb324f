"""Numbers in sentences: counts with their noun, and per cent."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation

from uqpen.results.digits import (
    MINUS,
    SUPERSCRIPTS,
    estimate_texts,
    grouped_number,
    typeset_minus,
)

__all__ = ["count_text", "percent_texts"]

_PLAIN = {superscript: plain for plain, superscript in SUPERSCRIPTS.items()}

# Below it, in per cent, a number is easier to read with its power of ten.
_LEAST = Decimal("0.00001")


def count_text(number: int, noun: str) -> str:
    """Return a number and its noun, which is in the singular for one.

    >>> count_text(1, "run"), count_text(20, "run")
    ('1 run', '20 runs')
    """
    return f"{grouped_number(number)} {noun}{'s' * (number != 1)}"


def percent_texts(estimate: float, lower: float, upper: float, *others: float) -> tuple[str, ...]:
    """A probability, the ends of its interval, and others, in the same digits as the tables.

    A hundred times the number would be rounded anew, and differ where it ends in a five.

    >>> percent_texts(0.2075, 0.1825, 0.2325)
    ('20.7 %', '18.2 %', '23.3 %')
    """
    return tuple(
        f"{_times_hundred(text)} %" for text in estimate_texts(estimate, lower, upper, *others)
    )


def _times_hundred(text: str) -> str:
    """Move the point of a number two places, in its text."""
    plain = text.replace(MINUS, "-").replace("\u202f", "")
    mantissa, times, power = plain.partition("×10")
    exponent = int(power.translate(_PLAIN)) if times else 0
    try:
        moved = Decimal(mantissa).scaleb(exponent + 2)
    except InvalidOperation:  # a dash or a question mark stands for no number
        return text
    if 0 < moved < _LEAST and times:
        return f"{mantissa}×10{str(exponent + 2).translate(SUPERSCRIPTS)}"
    return typeset_minus(f"{moved:f}")
