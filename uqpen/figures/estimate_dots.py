"""Estimates as dots with their intervals, a row for each name."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.charts.marks import HOLLOW
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.figures.painter import error_bar_lengths
from uqpen.figures.panel import Axes
from uqpen.results.digits import percent_text
from uqpen.results.source_style import SourceStyle
from uqpen.results.table import Conversion

__all__ = ["EstimateDot", "draw_dots"]


@dataclass(frozen=True)
class EstimateDot:
    """An estimate at a place along the other axis.

    Parameters
    ----------
    bounds : ndarray
        Estimate, lower, upper, in the unit that is shown; NaN for a missing bound.
    place : float
        The row, or a place near it.
    look : SourceStyle
        Colour and marker.
    label : str
        Its legend; empty for none.
    level : float
        Of its interval.
    """

    bounds: FloatArray
    place: float
    look: SourceStyle
    label: str = ""
    level: float = math.nan

    @classmethod
    def from_array(
        cls,
        array: xr.DataArray,
        convert: Conversion,
        place: float,
        look: SourceStyle,
        label: str = "",
    ) -> EstimateDot:
        """Take an estimate of an archive, along ``bound``, and convert it."""
        return cls(
            np.asarray(convert(array.values), dtype=np.float64),
            place,
            look,
            label,
            float(array.attrs.get(INTERVAL_LEVEL, math.nan)),
        )

    @property
    def error_bar(self) -> FloatArray | None:
        """The lengths of its error bar; None without an interval."""
        return error_bar_lengths(self.bounds)


def draw_dots(axes: Axes, dots: list[EstimateDot]) -> Iterator[str]:
    """Draw estimates along the horizontal axis, and yield notes on their markers."""
    barred = [dot for dot in dots if dot.error_bar is not None]
    for dot in dots:
        axes.errorbar(
            dot.bounds[:1],
            [dot.place],
            xerr=dot.error_bar,
            fmt=dot.look.marker,
            color=dot.look.colour,
            markerfacecolor="white" if dot.error_bar is None else dot.look.colour,
            elinewidth=1.2,
            capsize=2,
            label=dot.label or None,
        )
    for level in sorted({dot.level for dot in barred if dot.level > 0}):
        yield f"bars: {percent_text(level)} intervals"
    if len(barred) < len(dots):
        yield HOLLOW
