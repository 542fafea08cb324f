"""Fields along two dimensions as maps of their statistics."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.fields import coordinate_text, field_dimensions
from uqpen.core.arrays import FloatArray, evenly_spread
from uqpen.report.axes import quantity_axis
from uqpen.report.blocks import Chart
from uqpen.report.marks import Trace, escape_text, rounded_numbers
from uqpen.report.sections.leading_design import output_title
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text, number_text
from uqpen.results.table import quantile_label
from uqpen.results.texts import capitalized, unit_suffix

__all__ = ["map_charts"]

# Pixels of a map along an axis, and places that a pointer finds along one, at the most.
_MOST_PIXELS, _MOST_POINTS = 240, 40


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
    values = bounds[..., 0]
    limits = float(np.nanmin(values)), float(np.nanmax(values))
    unit = unit_suffix(view.unit(field))
    (left, right), (low, high) = _edges(x)[[0, -1]], _edges(y)[[0, -1]]
    image = {
        "source": _data_address(_pixels(values, x, y, limits)),
        "xref": "x",
        "yref": "y",
        "sizing": "stretch",
        "layer": "below",
        "x": left,
        "y": high,
        "sizex": right - left,
        "sizey": high - low,
    }
    notes = (f"At {place}, the place of the largest mean.",) if place else ()
    title = f"{capitalized(output_title(view, field))}: {label}{f' [{unit.strip()}]' * bool(unit)}"
    return Chart(
        title=title,
        summary=f"From {number_text(limits[0])} to {number_text(limits[1])}{unit}.",
        x=quantity_axis(view, along, (float(left), float(right))),
        y=quantity_axis(view, across, (float(low), float(high))),
        traces=(_points(bounds, x, y, limits, unit),),
        notes=notes,
        height=340,
        images=(image,),
    )


def _points(
    bounds: FloatArray, x: FloatArray, y: FloatArray, limits: tuple[float, float], unit: str
) -> Trace:
    """Return unseen points, by which a pointer reads off estimates, with the scale of colours."""
    rows, columns = (evenly_spread(each.size, _MOST_POINTS) for each in (y, x))
    shown = bounds[np.ix_(rows, columns)].reshape(-1, 3)
    return {
        "type": "scatter",
        "mode": "markers",
        "x": rounded_numbers(np.tile(x[columns], rows.size)),
        "y": rounded_numbers(np.repeat(y[rows], columns.size)),
        "text": [escape_text(f"{estimate_text(*row)}{unit}") for row in shown.tolist()],
        "hovertemplate": "%{x}, %{y}: %{text}<extra></extra>",
        "marker": {
            "size": 9,
            "opacity": 0,
            "color": rounded_numbers(shown[:, 0]),
            "colorscale": "Viridis",
            "cmin": limits[0],
            "cmax": limits[1],
            "showscale": True,
            "colorbar": {"thickness": 12, "outlinewidth": 0},
        },
    }


def _edges(places: FloatArray) -> FloatArray:
    """Return the edges of cells around places: half-way between them."""
    if places.size == 1:
        return np.array([places[0] - 0.5, places[0] + 0.5])
    middle = (places[1:] + places[:-1]) / 2
    found: FloatArray = np.concatenate([[places[0]], middle, [places[-1]]])
    return found


def _pixels(
    values: FloatArray, x: FloatArray, y: FloatArray, limits: tuple[float, float]
) -> np.ndarray:
    """Return the colours of a map, shape (row from the top, column, channel)."""
    from matplotlib import colormaps

    rows, columns = (
        np.searchsorted(_edges(each)[1:-1], np.linspace(each[0], each[-1], _MOST_PIXELS))
        for each in (y, x)
    )
    span = limits[1] - limits[0] or 1.0
    shares = (values[np.ix_(rows[::-1], columns)] - limits[0]) / span
    colours = np.asarray(colormaps["viridis"](np.nan_to_num(shares), bytes=True))
    colours[np.isnan(shares)] = 0
    return colours


def _data_address(pixels: np.ndarray) -> str:
    """Return an image of 8-bit colours with opacity as the address of its PNG."""
    height, width, _ = pixels.shape
    lines = b"".join(b"\0" + row.tobytes() for row in pixels)
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(lines, 9)), (b"IEND", b""))
    content = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in parts
    )
    return f"data:image/png;base64,{base64.b64encode(content).decode('ascii')}"
