"""Fields along two dimensions as maps of their statistics."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.fields import coordinate_text, field_dimensions
from uqpen.charts.axes import quantity_axis
from uqpen.charts.chart import Chart
from uqpen.charts.marks import HeatMap
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import number_text
from uqpen.results.table import quantile_label
from uqpen.results.texts import capitalized, unit_suffix

__all__ = ["map_charts"]


def map_charts(view: ArchiveView, field: str, design: str) -> Iterator[Chart]:
    """Yield maps of the mean, the standard deviation and the quantiles of a field.

    The last two dimensions are the axes. Along a third one, the map is at the largest mean.
    """
    mean = view.statistics.get(design, field, "mean")
    if mean is None or not np.isfinite(mean.values[..., 0]).any():
        return
    along = field_dimensions(view.design(design).runs[field])
    largest = np.unravel_index(int(np.nanargmax(mean.values[..., 0])), mean.shape[:-1])
    at = dict(zip(along[:-2], map(int, largest), strict=False))
    place = ", ".join(
        coordinate_text(mean[dim], mean[dim].values[position], 6) for dim, position in at.items()
    )
    for statistic, label in (("mean", "mean"), ("std", "standard deviation")):
        if (array := view.statistics.get(design, field, statistic)) is not None:
            yield _map(view, field, (statistic, label, place), array[at])
    quantiles = view.statistics.get(design, field, "quantile")
    if quantiles is not None:
        for number, p in enumerate(quantiles["probability"].values.tolist()):
            described = ("quantile", quantile_label(p), place)
            yield _map(view, field, described, quantiles[{**at, "probability": number}])


def _map(
    view: ArchiveView, field: str, described: tuple[str, str, str], array: xr.DataArray
) -> Chart:
    """Return the map of a statistic along two dimensions and ``bound``."""
    statistic, label, place = described
    bounds = np.asarray(view.conversion(field, statistic)(array.values), dtype=np.float64)
    across, along = (str(dim) for dim in array.dims[:2])
    x, y = (np.asarray(view.scale(dim).from_si(array[dim].values)) for dim in (along, across))
    unit = unit_suffix(view.unit(field))
    shown = HeatMap(x, y, bounds, unit)
    lowest, highest = map(number_text, shown.limits)
    across_ends, along_ends = shown.ends
    notes = (f"At {place}, the place of the largest mean.",) if place else ()
    title = f"{capitalized(output_title(view, field))}: {label}{f' [{unit.strip()}]' * bool(unit)}"
    return Chart(
        title=title,
        summary=f"From {lowest} to {highest}{unit}.",
        x=quantity_axis(view, along, across_ends),
        y=quantity_axis(view, across, along_ends),
        marks=(shown,),
        notes=notes,
        height=340,
    )
