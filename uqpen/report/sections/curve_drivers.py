"""The inputs' part in the variance along the dimension of a curve, as stacked areas."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from uqpen.charts.chart import Axis, Chart, LegendKey
from uqpen.charts.marks import Band, Mark
from uqpen.core.labels import INPUT
from uqpen.report.sections.curve_lines import band, level_text, line, place_axis
from uqpen.report.sections.drivers import input_label
from uqpen.results.curve_estimates import CurveEstimates
from uqpen.results.index_titles import index_titles
from uqpen.results.measure_labels import INDICES
from uqpen.results.source_statistics import best_sources

__all__ = ["driver_areas", "driver_lines", "measures_along"]

# Inputs with an area of their own, at the most; the colours of sources are ten.
_MOST_INPUTS = 8


def measures_along(curve: CurveEstimates) -> list[tuple[str, str, xr.DataArray]]:
    """Return the indices along the places: label, source and array of each that is known."""
    found = []
    for measure in index_titles(curve.view.tree).ordered(INDICES):
        arrays = {
            source: array
            for source in curve.view.sources
            if (array := curve.array(measure.statistic, source)) is not None
        }
        best = best_sources(curve.view.tree, arrays.items())[:1]
        known = (source for source in best if np.isfinite(arrays[source].values[..., 0]).any())
        found += [(measure.label, source, arrays[source]) for source in known]
    return found


def driver_areas(
    curve: CurveEstimates, indices: Sequence[tuple[str, str, xr.DataArray]]
) -> Iterator[Chart]:
    """Yield a chart of the inputs' shares of the variance, stacked, and of the remainder."""
    if not indices:
        return
    label, source, array = indices[0]
    known = np.isfinite(array.values[..., 0]).all(axis=1)
    shares = np.clip(array.values[known, :, 0], 0.0, None)
    shown = curve.places[known]
    names = [str(name) for name in array[INPUT].values]
    order = np.argsort(-shares.mean(axis=0), kind="stable")[:_MOST_INPUTS]
    traces: list[Mark] = []
    keys: list[LegendKey] = []
    below = np.zeros(len(shares))
    for series, position in enumerate(order.tolist()):
        above = below + shares[:, position]
        traces.append(Band(shown, below, above, series))
        keys.append(LegendKey(input_label(curve.view, names[position]), series, "band"))
        below = above
    rest = "others and interactions" if len(names) > len(order) else "interactions"
    traces.append(Band(shown, below, np.maximum(below, 1.0), "quiet"))
    keys.append(LegendKey(rest, "quiet", "band"))
    largest = input_label(curve.view, names[int(order[0])])
    yield Chart(
        title=f"Shares of the variance, {label} by {source}",
        summary=f"The largest share over all places is that of {largest}.",
        x=place_axis(curve),
        y=Axis("share of the variance", (0.0, max(1.0, float(below.max(initial=1.0))))),
        marks=tuple(traces),
        keys=tuple(keys),
        height=320,
    )


def driver_lines(
    curve: CurveEstimates, indices: Sequence[tuple[str, str, xr.DataArray]]
) -> Iterator[Chart]:
    """Yield a chart for each measure, with a line and its band for each input."""
    for label, source, array in indices:
        mean = np.nanmean(np.where(np.isfinite(array.values), array.values, np.nan)[..., 0], axis=0)
        order = np.argsort(-np.nan_to_num(mean), kind="stable")[:_MOST_INPUTS].tolist()
        names = [input_label(curve.view, str(array[INPUT].values[each])) for each in order]
        rows = list(enumerate(order))
        yield Chart(
            title=f"{label.capitalize()} by {source}, pointwise {level_text(array)} intervals",
            summary=f"The largest is that of {names[0]}.",
            x=place_axis(curve),
            y=Axis("share of the variance", (-0.1, 1.1)),
            marks=(
                *(each for n, at in rows for each in band(curve, array.values[:, at], n)),
                *(line(curve, array.values[:, at], n, names[n], has_unit=False) for n, at in rows),
            ),
            keys=tuple(LegendKey(name, number, "line") for number, name in enumerate(names)),
            is_compared=True,
        )
