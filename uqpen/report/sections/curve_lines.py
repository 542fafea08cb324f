"""Lines and bands of a statistic along the dimension of a curve."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.report.axes import quantity_axis
from uqpen.report.blocks import Axis
from uqpen.report.marks import Trace, band_traces, escape_text, line_trace
from uqpen.results.curve_estimates import CurveEstimates
from uqpen.results.digits import estimate_text, percent_text
from uqpen.results.texts import unit_suffix

__all__ = ["DASHES", "MOST_PLACES", "band", "level_text", "line", "place_axis"]

# Dashes of lines in turn; the first is that of a median.
DASHES = ("solid", "dot", "dash", "dashdot", "longdash")
# Places of a curve in its charts at the most, of some thousand.
MOST_PLACES = 161


def place_axis(curve: CurveEstimates) -> Axis:
    """Return the axis along the dimension of a curve."""
    ends = (float(curve.places[0]), float(curve.places[-1]))
    return quantity_axis(curve.view, curve.dimension, ends)


def band(curve: CurveEstimates, bounds: FloatArray | None, series: int | str) -> list[Trace]:
    """Return the band between the bounds of a statistic at each place; nothing without any."""
    if bounds is None or not np.isfinite(bounds[:, 1:]).any():
        return []
    return band_traces(curve.places, bounds[:, 1], bounds[:, 2], series)


def line(
    curve: CurveEstimates,
    bounds: FloatArray,
    series: int | str,
    name: str,
    *,
    dash: str = "solid",
    width: float = 2,
    has_unit: bool = True,
) -> Trace:
    """Return the line of a statistic; a pointer reads off its estimates with their intervals."""
    unit = unit_suffix(curve.view.unit(curve.output)) if has_unit else ""
    trace = line_trace(
        curve.places,
        bounds[:, 0],
        series,
        hover=f"%{{text}} {escape_text(name, 40)}",
        name=name,
        dash=dash,
        width=width,
    )
    texts = (f"{estimate_text(*row)}{unit}" for row in bounds.tolist())
    return trace | {"text": [escape_text(text) for text in texts]}


def level_text(array: xr.DataArray | None) -> str:
    """Return the confidence level of a statistic's intervals."""
    level = None if array is None else array.attrs.get(INTERVAL_LEVEL)
    return "" if level is None else percent_text(float(level))
