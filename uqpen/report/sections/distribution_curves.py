"""Distribution functions at common values, so that a pointer reads them all off at once."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.figures.curves import Curve
from uqpen.report.marks import Trace, band_traces, escape_text, line_trace
from uqpen.results.archive_view import ArchiveView
from uqpen.results.empirical_cdf import empirical_cdf

__all__ = ["Grid", "curve_at", "curve_quantile", "curve_traces"]


# Values between the ends of an axis, at the least.
_FEWEST = 250


class Grid(NamedTuple):
    """Round values from one end of an axis to the other, in the unit that is shown."""

    values: FloatArray
    step: float
    decimals: int

    @classmethod
    def between(cls, lower: float, upper: float) -> Grid:
        """Return the coarsest suitable grid with a step of 1, 2 or 5 times a power of ten."""
        widest = (upper - lower) / _FEWEST
        power = 10.0 ** math.floor(math.log10(widest))
        step = next(factor * power for factor in (5, 2, 1) if factor * power <= widest)
        decimals = max(0, -math.floor(math.log10(step) + 1e-9))
        places = np.arange(math.ceil(lower / step), math.floor(upper / step) + 1)
        return cls(np.round(step * places, decimals), float(f"{step:.12g}"), decimals)


def curve_at(view: ArchiveView, output: str, curve: Curve, grid: Grid) -> Curve:
    """A function at other values: from its runs or, without all of them, between its ranks."""
    if curve.name in view.designs and view.design(curve.name).shows_all_runs:
        measure = view.scale(output)
        in_si = np.array([measure.to_si(value) for value in grid.values.tolist()])
        share = empirical_cdf(view.design(curve.name).completed_values(output), in_si)
        return replace(curve, values=grid.values, band=curve.limits.around(share))
    estimate = np.interp(grid.values, curve.values, curve.band[:, 0], left=0.0, right=1.0)
    if curve.name in view.designs:
        return replace(curve, values=grid.values, band=curve.limits.around(estimate))
    none = np.full_like(estimate, np.nan)
    return replace(curve, values=grid.values, band=np.stack([estimate, none, none], axis=-1))


def curve_quantile(curve: Curve, p: float) -> float:
    """A quantile by the equally spaced ranks of the archive."""
    return float(curve.values[round(p * (curve.values.size - 1))])


def curve_traces(
    curve: Curve,
    series: int,
    dash: str,
    *,
    is_stepped: bool,
    width: float = 2,
    has_band: bool = True,
) -> Iterator[Trace]:
    """The function, which a pointer reads off, above its simultaneous band if that is shown."""
    estimate, lower, upper = curve.band.T
    has_band = has_band and curve.has_band
    if has_band:
        yield from band_traces(curve.values, lower, upper, series, is_stepped=is_stepped)
    bounds = " (%{customdata[0]:.4f} … %{customdata[1]:.4f})"
    yield line_trace(
        curve.values,
        estimate,
        series,
        hover=f"%{{y:.4f}}{bounds * has_band} {escape_text(curve.name, 40)}",
        name=curve.name,
        beside=[lower, upper] if has_band else (),
        dash=dash,
        width=width,
        is_stepped=is_stepped,
    )
