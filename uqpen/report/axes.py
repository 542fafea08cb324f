"""Limits of axes, and ticks of logarithmic axes: at round numbers that are written out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from uqpen.core.units import DIMENSIONLESS
from uqpen.report.blocks import Axis, PlottedQuantity
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import SUPERSCRIPTS, grouped_number

__all__ = ["logarithmic_axis", "padded_limits", "quantity", "quantity_axis"]

# Room at either end, and how many times the first value the last one is at least, by tenfolds.
_MARGIN, _SHORTEST = 0.08, 0.7
# Ticks at the most, and the steps between powers of ten that are tried.
_MOST = 6
_STEPS = ((1, 2, 5), (1, 3), (1,))


def quantity(view: ArchiveView, name: str) -> PlottedQuantity:
    """Return an input or an output with its unit, as charts have it in common."""
    unit = view.unit(name)
    return PlottedQuantity(name, "" if unit == DIMENSIONLESS else unit)


def quantity_axis(
    view: ArchiveView, name: str, ends: tuple[float, float] | None = None, title: str = ""
) -> Axis:
    """Return the axis of an input or an output, under its label if it has no other title."""
    return Axis(title or view.axis_label(name), ends, quantity=quantity(view, name))


def padded_limits(lower: float, upper: float, share: float = 0.03) -> tuple[float, float]:
    """Return the ends of an axis: two values, extended by a share of their distance."""
    margin = share * (upper - lower) or 0.05 * abs(upper) or 1.0
    return lower - margin, upper + margin


def logarithmic_axis(title: str, values: Iterable[float]) -> Axis:
    """Return a logarithmic axis that includes some values, all of them above zero."""
    powers = [math.log10(value) for value in values]
    lower, upper = min(powers), max(powers)
    margin = max(_MARGIN * (upper - lower), (_SHORTEST - (upper - lower)) / 2, 0.05)
    ends = (round(lower - margin, 6), round(upper + margin, 6))
    return Axis(title, ends, is_logarithmic=True, ticks=tuple(_ticks(*ends)))


def _ticks(lower: float, upper: float) -> Iterator[tuple[float, str]]:
    found = [list(_ticks_between(lower, upper, steps)) for steps in _STEPS]
    chosen = next((each for each in found if len(each) <= _MOST), found[-1])
    for step, power in chosen[:: -(-len(chosen) // _MOST)]:
        yield float(f"{step}e{power}"), _tick_text(step, power)


def _ticks_between(lower: float, upper: float, steps: Sequence[int]) -> Iterator[tuple[int, int]]:
    for power in range(math.floor(lower), math.ceil(upper) + 1):
        for step in steps:
            if lower <= math.log10(step) + power <= upper:
                yield step, power


def _tick_text(step: int, power: int) -> str:
    """Write out a short number; others as a power of ten."""
    if 0 <= power < 6:
        return grouped_number(step * 10**power)
    if -5 < power < 0:
        return f"{step * 10.0**power:.{-power}f}"
    written = f"10{str(power).translate(SUPERSCRIPTS)}"
    return written if step == 1 else f"{step}×{written}"
