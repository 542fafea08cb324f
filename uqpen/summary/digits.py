"""Figures in the digits that their intervals leave a meaning."""

from __future__ import annotations

import math

__all__ = ["SUPERSCRIPTS", "alike", "grouped", "held", "percent", "sensible"]

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

# The sides of an interval may differ by this factor before both ends are shown.
_UNEVEN = 1.5


def sensible(estimate: float, lower: float, upper: float) -> str:
    """An estimate in the digits that its interval leaves a meaning.

    Two digits of the half-width, and the estimate to the same place; both ends where they lie
    unevenly; four digits where there is no interval.

    Parameters
    ----------
    estimate, lower, upper : float
        NaN for a bound that does not exist.

    Examples
    --------
    >>> sensible(0.49274, 0.49004, 0.49544)
    '0.4927 ± 0.0027'
    >>> sensible(71.1, 70.6, 72.9)
    '71.1 (70.6 … 72.9)'
    """
    sides = [side for side in (estimate - lower, upper - estimate) if not math.isnan(side)]
    half = max(sides, default=math.nan)
    if not half > 0 or math.isinf(half):
        return _alone(estimate)
    figures = _Figures(estimate, half)
    if len(sides) == 2 and half < _UNEVEN * min(sides):
        return figures.write(f"{figures(estimate)} ± {figures(half)}")
    ends = f"{figures(lower)} … {figures(upper)}"
    if figures.exponent:
        return figures.write(f"{figures(estimate)}, {ends}")
    return f"{figures(estimate)} ({ends})"


def held(estimate: float, upper: float) -> str:
    """A value that holds, with its upper bound in the same digits.

    >>> held(13.4812, 13.7699)
    '13.48, at most 13.77'
    """
    if not 0 < upper - estimate < math.inf:
        return _alone(estimate)
    figures = _Figures(estimate, upper - estimate)
    return figures.write(f"{figures(estimate)}, at most {figures(upper)}")


def alike(estimate: float, lower: float, upper: float, *others: float) -> tuple[str, ...]:
    """An estimate, the ends of its interval, and other values, in the digits of `sensible`.

    Each stands by itself, as in a sentence.

    >>> alike(0.49274, 0.49004, 0.49544, 0.5)
    ('0.4927', '0.4900', '0.4954', '0.5000')
    """
    values = (estimate, lower, upper, *others)
    sides = (side for side in (estimate - lower, upper - estimate) if not math.isnan(side))
    half = max(sides, default=math.nan)
    if not 0 < half < math.inf:
        return tuple(map(_alone, values))
    figures = _Figures(estimate, half)
    return tuple(_alone(each) if each == 0 else figures.whole(each) for each in values)


def grouped(number: int) -> str:
    """A whole number with thin spaces between thousands."""
    return f"{number:,}".replace(",", "\u202f")


def percent(probability: float) -> str:
    """A probability in per cent, in as many digits as it has."""
    return f"{100 * probability:.10g} %"


def _alone(estimate: float) -> str:
    """An estimate without an interval."""
    return "–" if math.isnan(estimate) else f"{estimate:.4g}"


class _Figures:
    """Writes figures to one place, given by the uncertainty, and out of one power of ten."""

    def __init__(self, estimate: float, half: float) -> None:
        # Of the least numbers of all, the power of ten would be 0.
        exponent = max(-300, math.floor(math.log10(max(abs(estimate), half))))
        self.exponent = 0 if -3 <= exponent < 6 else exponent
        self._power = 10.0**self.exponent
        self._places = max(0, 1 - math.floor(math.log10(half / self._power)))

    def __call__(self, value: float) -> str:
        return "?" if math.isnan(value) else f"{value / self._power:.{self._places}f}"

    def whole(self, value: float) -> str:
        """A value with its power of ten."""
        power = f"×10{str(self.exponent).translate(SUPERSCRIPTS)}" if self.exponent else ""
        return f"{self(value)}{power}"

    def write(self, body: str) -> str:
        """The body with the power of ten that its figures leave out."""
        if not self.exponent:
            return body
        return f"({body})×10{str(self.exponent).translate(SUPERSCRIPTS)}"
