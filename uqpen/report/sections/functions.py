"""Distribution functions at common values, so that a pointer reads them all off at once."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from uqpen.analyses.cdfs import cdf_at
from uqpen.figures.curves import Curve
from uqpen.figures.part import Part
from uqpen.labels import INTERVAL_LEVEL, NOTE
from uqpen.report.marks import Trace, band, line, written
from uqpen.report.sections.evidence import sample_of

__all__ = ["Grid", "band_of", "function_of", "reached", "read_at"]

FloatArray = npt.NDArray[np.float64]

# Values between the ends of an axis, at the least.
_FEWEST = 250


class Grid(NamedTuple):
    """Round values from one end of an axis to the other.

    Attributes
    ----------
    values : ndarray, shape (value,)
        Ascending, in the unit that is shown.
    step : float
        How far they are apart.
    decimals : int
        To write them with.
    """

    values: FloatArray
    step: float
    decimals: int

    @classmethod
    def between(cls, lower: float, upper: float) -> Grid:
        """As few as there can be with a step of 1, 2 or 5 times a power of ten."""
        widest = (upper - lower) / _FEWEST
        power = 10.0 ** math.floor(math.log10(widest))
        step = next(factor * power for factor in (5, 2, 1) if factor * power <= widest)
        decimals = max(0, -math.floor(math.log10(step) + 1e-9))
        places = np.arange(math.ceil(lower / step), math.floor(upper / step) + 1)
        return cls(np.round(step * places, decimals), float(f"{step:.12g}"), decimals)


def read_at(part: Part, output: str, curve: Curve, grid: Grid) -> Curve:
    """A function at other values: from its runs or, without any, between its ranks."""
    if curve.name in part.designs:
        measure = part.measure(output)
        in_si = np.array([measure.to_si(value) for value in grid.values.tolist()])
        told = cdf_at(sample_of(part, curve.name, output), in_si)
        level, note = told.attrs.get(INTERVAL_LEVEL, math.nan), told.attrs.get(NOTE, "")
        return replace(curve, values=grid.values, band=told.values, level=level, note=note)
    estimate = np.interp(grid.values, curve.values, curve.band[:, 0], left=0.0, right=1.0)
    none = np.full_like(estimate, np.nan)
    return replace(curve, values=grid.values, band=np.stack([estimate, none, none], axis=-1))


def reached(curve: Curve, p: float) -> float:
    """A quantile as the archive's ranks have it, which are equally spaced."""
    return float(curve.values[round(p * (curve.values.size - 1))])


def band_of(curve: Curve, series: int, *, is_stepped: bool) -> Iterator[Trace]:
    """Its simultaneous band; nothing where it has none."""
    if curve.has_band:
        lower, upper = curve.band[:, 1], curve.band[:, 2]
        yield from band(curve.values, lower, upper, series, is_stepped=is_stepped)


def function_of(
    curve: Curve,
    series: int,
    dash: str,
    *,
    is_stepped: bool,
    width: float = 2,
    has_band: bool = True,
) -> Trace:
    """The function, which a pointer reads off, with its band where that is shown."""
    bounds = " (%{customdata[0]:.4f} … %{customdata[1]:.4f})"
    has_band = has_band and curve.has_band
    return line(
        curve.values,
        curve.band[:, 0],
        series,
        hover=f"%{{y:.4f}}{bounds * has_band} {written(curve.name, 40)}",
        name=curve.name,
        beside=[curve.band[:, 1], curve.band[:, 2]] if has_band else (),
        dash=dash,
        width=width,
        is_stepped=is_stepped,
    )
