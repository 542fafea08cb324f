"""Limits of axes, and ticks of logarithmic axes: at round numbers that are written out."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from uqpen.core.units import DIMENSIONLESS
from uqpen.figures.value_axis import ValueAxis, logarithmic_ticks
from uqpen.report.blocks import Axis, PlottedQuantity
from uqpen.results.archive_view import ArchiveView

__all__ = ["logarithmic_axis", "output_axis", "padded_limits", "quantity", "quantity_axis"]

# Room at either end, and how many times the first value the last one is at least, by tenfolds.
_MARGIN, _SHORTEST = 0.08, 0.7


def quantity(view: ArchiveView, name: str) -> PlottedQuantity:
    """Return an input or an output with its unit, as charts have it in common."""
    unit = view.unit(name)
    return PlottedQuantity(name, "" if unit == DIMENSIONLESS else unit)


def quantity_axis(
    view: ArchiveView, name: str, ends: tuple[float, float] | None = None, title: str = ""
) -> Axis:
    """Return the axis of an input or an output, under its label if it has no other title."""
    return Axis(title or view.axis_label(name), ends, quantity=quantity(view, name))


def output_axis(view: ArchiveView, name: str, span: ValueAxis, title: str = "") -> Axis:
    """Return the axis of an output between two ends, with ticks of its own if logarithmic."""
    axis = quantity_axis(view, name, span.ends, title)
    if not span.is_logarithmic:
        return axis
    return replace(axis, ends=span.powers, is_logarithmic=True, ticks=tuple(span.ticks()))


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
    return Axis(title, ends, is_logarithmic=True, ticks=tuple(logarithmic_ticks(*ends)))
