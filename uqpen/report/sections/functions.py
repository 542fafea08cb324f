"""A distribution function as traces of a chart."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.figures.curves import Curve
from uqpen.report.marks import Trace, band, line, written
from uqpen.units import DIMENSIONLESS

__all__ = ["band_of", "function_of"]


def band_of(curve: Curve, series: int) -> Iterator[Trace]:
    """Its simultaneous band; nothing where it has none."""
    if curve.has_band:
        lower, upper = curve.band[:, 1], curve.band[:, 2]
        yield from band(curve.values, lower, upper, series, is_stepped=curve.is_stepped)


def function_of(
    curve: Curve, unit: str, series: int, dash: str, *, width: float = 2, has_band: bool = True
) -> Trace:
    """The function, which a pointer reads off, with its band where that is shown."""
    shown = "" if unit == DIMENSIONLESS else f" {written(unit)}"
    hover = f"{written(curve.name, 40)}<br>P(at most %{{x:.4~g}}{shown}) = %{{y:.4~f}}"
    has_band = has_band and curve.has_band
    if has_band:
        hover += "<br>band %{customdata[0]:.4~f} … %{customdata[1]:.4~f}"
    return line(
        curve.values,
        curve.band[:, 0],
        series,
        hover=hover,
        name=curve.name,
        beside=[curve.band[:, 1], curve.band[:, 2]] if has_band else (),
        dash=dash,
        width=width,
        is_stepped=curve.is_stepped,
    )
