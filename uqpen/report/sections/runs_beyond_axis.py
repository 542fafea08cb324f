"""A distribution function beyond the ends of its axis, for thresholds that a reader types."""

from __future__ import annotations

import math

import numpy as np

from uqpen.charts.chart import RunsBeyondAxis
from uqpen.core.arrays import FloatArray, evenly_spread
from uqpen.figures.curves import Curve
from uqpen.results.archive_view import ArchiveView
from uqpen.results.empirical_cdf import empirical_cdf

__all__ = ["listed_bounds", "runs_beyond_axis"]

# Runs on either side at the most, so that a page does not grow with their number.
_MOST = 40


def runs_beyond_axis(view: ArchiveView, output: str, curve: Curve) -> RunsBeyondAxis | None:
    """Return the runs beyond the thresholds of a function; None of one without runs."""
    if curve.name not in view.designs or not view.design(curve.name).keeps_runs:
        return None
    values = np.sort(view.design(curve.name).completed_values(output))
    shown = view.scale(output).from_si(values)
    first, last = float(curve.values[0]), float(curve.values[-1])

    def listed(which: FloatArray) -> list[list[float | None]]:
        places = evenly_spread(which.size, _MOST)
        chosen = np.unique(which[places]) if which.size else which
        bounds = listed_bounds(curve.limits.around(empirical_cdf(values, chosen)))
        return [
            [_exact(value), *row]
            for value, row in zip(view.scale(output).from_si(chosen).tolist(), bounds, strict=True)
        ]

    (nothing,) = listed_bounds(curve.limits.around(np.zeros(1)))
    return RunsBeyondAxis(
        runs=int(values.size),
        smallest=_exact(float(shown[0])),
        largest=_exact(float(shown[-1])),
        nothing=nothing,
        below=listed(values[shown < first]),
        above=listed(values[shown > last]),
    )


def listed_bounds(band: FloatArray) -> list[list[float | None]]:
    """Return a function with its band as rows of numbers; None in place of NaN."""
    return [
        [round(value, 9) if math.isfinite(value) else None for value in row]
        for row in band.tolist()
    ]


def _exact(value: float) -> float:
    """Return a value in more digits than anybody types."""
    return float(f"{value:.12g}")
