"""Lines and bands of a statistic along the dimension of a curve."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from uqpen.charts.axes import quantity, quantity_axis
from uqpen.charts.chart import Axis
from uqpen.charts.marks import Band, Line, Mark, escape_text
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.results.curve_estimates import CurveEstimates
from uqpen.results.digits import estimate_text, percent_text
from uqpen.results.texts import unit_suffix

__all__ = [
    "DASHES",
    "MOST_PLACES",
    "band",
    "level_text",
    "line",
    "place_axis",
    "thin_lines",
    "value_axis",
]

# Dashes of lines in turn; the first is that of a median.
DASHES = ("solid", "dot", "dash", "dashdot", "longdash")
# Places of a curve in its charts at the most, of some thousand.
MOST_PLACES = 161
# Characters of a label along the shorter charts.
_LONGEST_LABEL = 28
# Steps that the values of a line are rounded to, of the distance of its ends.
_STEPS = 1000.0


def place_axis(curve: CurveEstimates) -> Axis:
    """Return the axis along the dimension of a curve."""
    ends = (float(curve.places[0]), float(curve.places[-1]))
    return quantity_axis(curve.view, curve.dimension, ends)


def value_axis(curve: CurveEstimates) -> Axis:
    """Return the axis of the values, under the unit alone where the label has no room."""
    label = curve.view.axis_label(curve.output)
    is_short = len(label) <= _LONGEST_LABEL
    return Axis(label if is_short else quantity(curve.view, curve.output).unit)


def band(curve: CurveEstimates, bounds: FloatArray | None, series: int | str) -> list[Mark]:
    """Return the band between the bounds of a statistic at each place; nothing without any."""
    if bounds is None or not np.isfinite(bounds[:, 1:]).any():
        return []
    lower, upper = _drawn(bounds[:, 1:]).T
    return [Band(curve.places, lower, upper, series)]


def line(
    curve: CurveEstimates,
    bounds: FloatArray,
    series: int | str,
    name: str,
    *,
    dash: str = "solid",
    width: float = 2,
    has_unit: bool = True,
) -> Mark:
    """Return the line of a statistic; a pointer reads off its estimates with their intervals."""
    unit = unit_suffix(curve.view.unit(curve.output)) if has_unit else ""
    return Line(
        curve.places,
        _drawn(bounds[:, 0]),
        series,
        hover=f"%{{text}}{escape_text(unit)} {escape_text(name, 40)}",
        name=name,
        texts=[estimate_text(*row) for row in bounds.tolist()],
        dash=dash,
        width=width,
    )


def thin_lines(places: FloatArray, runs: FloatArray, colour: str, width: float) -> Mark:
    """Return lines of single runs, shape (run, place), as one trace with gaps between them."""
    values = np.column_stack([_drawn(runs), np.full(len(runs), np.nan)])
    along = np.tile(np.append(places, places[-1]), len(runs))
    return Line(along, values.ravel(), colour, hover="", width=width)


def _drawn(values: FloatArray) -> FloatArray:
    """Return values rounded to what can be seen of them in a chart."""
    known = values[np.isfinite(values)]
    # Halves, as the difference of large numbers may overflow.
    span = 2 * (float(known.max()) / 2 - float(known.min()) / 2) if known.size else 0.0
    if not 1e-290 < span < 1e290:  # powers of ten beyond are no numbers
        return values
    return np.round(values, math.ceil(math.log10(_STEPS / span)))


def level_text(array: xr.DataArray | None) -> str:
    """Return the confidence level of a statistic's intervals."""
    level = None if array is None else array.attrs.get(INTERVAL_LEVEL)
    return "" if level is None else percent_text(float(level))
