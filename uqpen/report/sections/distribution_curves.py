"""Distribution functions at common values, so that a pointer reads them all off at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from uqpen.charts.marks import Band, Line, Mark, escape_text
from uqpen.core.arrays import FloatArray
from uqpen.figures.curves import Curve
from uqpen.figures.distributions import StudyLimit
from uqpen.results.archive_view import ArchiveView
from uqpen.results.empirical_cdf import empirical_cdf

__all__ = ["curve_at", "curve_quantile", "curve_traces"]


def curve_at(
    view: ArchiveView,
    output: str,
    curve: Curve,
    values: FloatArray,
    limits: Sequence[StudyLimit] = (),
) -> Curve:
    """A function at other values: from its runs or, without all of them, between its ranks.

    Parameters
    ----------
    values : ndarray
        In the unit that is shown.
    limits : sequence of StudyLimit
        Those among the values, which are taken as the study states them, to the last bit.
    """
    if curve.name in view.designs and view.design(curve.name).shows_all_runs:
        exact = {limit.value: limit.in_si for limit in limits}
        convert = view.scale(output).to_si
        in_si = np.array([exact.get(each, convert(each)) for each in values.tolist()])
        share = empirical_cdf(view.design(curve.name).completed_values(output), in_si)
        return replace(curve, values=values, band=curve.limits.around(share))
    estimate = np.interp(values, curve.values, curve.band[:, 0], left=0.0, right=1.0)
    if curve.name in view.designs:
        return replace(curve, values=values, band=curve.limits.around(estimate))
    none = np.full_like(estimate, np.nan)
    return replace(curve, values=values, band=np.stack([estimate, none, none], axis=-1))


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
) -> Iterator[Mark]:
    """The function, which a pointer reads off, above its simultaneous band if that is shown."""
    estimate, lower, upper = curve.band.T
    has_band = has_band and curve.has_band
    if has_band:
        yield Band(curve.values, lower, upper, series, is_stepped=is_stepped)
    bounds = " (%{customdata[0]:.4f} … %{customdata[1]:.4f})"
    yield Line(
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
