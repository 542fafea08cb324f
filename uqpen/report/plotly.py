"""Charts as the JSON from which the page's script draws them by Plotly."""

from __future__ import annotations

import base64
import json
import re
import struct
import textwrap
import zlib
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from uqpen.charts.chart import Axis, Chart, PlaceReadout, PlaceSlices
from uqpen.charts.marks import (
    Band,
    Bars,
    Dots,
    HeatMap,
    Line,
    Mark,
    Numbers,
    Points,
    Rule,
    Shade,
    escape_text,
    has_interval,
)
from uqpen.core.arrays import evenly_spread
from uqpen.report.blocks import RunColumn, RunExplorer
from uqpen.results.digits import estimate_text, number_text
from uqpen.results.texts import plain_text

# A mark in Plotly's form: a trace, or a shape behind the traces.
Trace = dict[str, Any]

# Frequent characters of estimates (… ± − –), which take less room as they are; and a backslash.
_FREQUENT = re.compile(r"\\\\|\\u(2026|00b1|2212|2013)")
# A list that is longer is written once.
_SHORT = 12
# Characters of a row's name in one line.
_WIDEST_ROW = 28
# Digits of points: the runs of an explorer are the same lists.
_RUN_DIGITS = 5
# Digits of estimates with an interval, which may be narrow.
_EXACT = 9
# Pixels of a map along an axis, and places that a pointer finds along one, at the most.
_MOST_PIXELS, _MOST_POINTS = 240, 40


def charts_json(charts: Sequence[Chart], explorers: Sequence[RunExplorer] = ()) -> str:
    """All charts and all drawn runs of a page, as a text that cannot end a script."""
    drawn = [_chart_content(chart) for chart in charts]
    drawn += [
        {
            "model": explorer.model,
            "series": explorer.series,
            "completed": explorer.completed,
            "failed": explorer.failed,
            "traces": [_column_content(column) for column in explorer.columns],
        }
        for explorer in explorers
    ]
    known: dict[str, _Place] = {}
    every = [
        chart
        | {
            "traces": [
                {key: _kept(value, known, (number, at, key)) for key, value in trace.items()}
                for at, trace in enumerate(chart["traces"])
            ]
        }
        for number, chart in enumerate(drawn)
    ]
    for chart in every:
        if "place" in chart:
            chart["place"] = _place_read(chart["place"], known)
        if "reading" in chart:
            chart["reading"]["values"] = _kept(chart["reading"]["values"], known)
    content = {"charts": every[: len(charts)], "runs": every[len(charts) :]}
    text = json.dumps(content, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    text = _FREQUENT.sub(lambda found: chr(int(found[1], 16)) if found[1] else found[0], text)
    return text.replace("<", "\\u003c").replace("-->", "--\\u003e")


# Where a list is written: number of the chart or the runs, number of the trace, key.
_Place = tuple[int, int, str]


def _place_read(place: dict[str, Any], known: dict[str, _Place]) -> dict[str, Any]:
    """Return the values to read at each place, with references to the lists of traces."""
    columns = (
        {key: _kept(value, known) for key, value in each.items()} for each in place["columns"]
    )
    return place | {"values": _kept(place["values"], known), "columns": list(columns)}


def _kept(value: Any, known: dict[str, _Place], own: _Place | None = None) -> Any:
    """Return a value, or a reference in place of a long list or of columns that are known."""
    if not isinstance(value, list | tuple) or len(value) <= _SHORT:
        return value
    if isinstance(value[0], list | tuple):
        columns = [known.get(json.dumps(column)) for column in zip(*value, strict=True)]
        return {"columns": columns} if all(columns) else value
    text = json.dumps(value)
    first = known.get(text) if own is None else known.setdefault(text, own)
    return value if first in (None, own) else {"same": first}


def _chart_content(chart: Chart) -> dict[str, Any]:
    drawn: dict[str, Any] = {
        "traces": traces(chart.marks),
        "shapes": shapes(chart.marks),
        "x": _axis_content(chart.x),
        "y": _axis_content(chart.y),
        "height": chart.height,
        "hovermode": "x unified" if chart.is_compared else "closest",
    }
    if chart.reading is not None:
        content: dict[str, Any] = {
            "values": chart.reading.values,
            "limits": chart.reading.limits,
            "start": chart.reading.start,
            "bounds": chart.reading.bounds,
        }
        drawn["reading"] = (
            content if chart.reading.beyond is None else content | chart.reading.beyond._asdict()
        )
    if images := [_image(each) for each in chart.marks if isinstance(each, HeatMap)]:
        drawn["images"] = images
    if chart.place is not None:
        drawn["place"] = _place_content(chart.place)
    if chart.slices is not None:
        drawn["slices"] = _slices_content(chart.slices, chart.marks)
    if chart.runs_of is not None:
        drawn["runs"] = chart.runs_of
    return drawn


def _slices_content(slices: PlaceSlices, shown: Sequence[Mark]) -> dict[str, Any]:
    first = traces(shown)
    differing = [
        [_difference(*pair) for pair in zip(traces(at), first, strict=True)] for at in slices.marks
    ]
    return {"of": slices.dimension, "values": slices.values, "traces": differing}


def _difference(trace: Trace, shown: Trace) -> Trace:
    """Return the members of a trace that are not those of the trace that is shown first."""
    return {
        key: _difference(value, shown[key]) if isinstance(value, dict) else value
        for key, value in trace.items()
        if value != shown[key]
    }


def _place_content(place: PlaceReadout) -> dict[str, Any]:
    columns = [
        {"label": each.label, "unit": each.unit, "texts": each.texts, "reasons": each.reasons}
        for each in place.columns
    ]
    values = _rounded(place.values)
    return {"values": values, "heads": place.heads, "columns": columns, "start": place.start}


def _column_content(column: RunColumn) -> dict[str, Any]:
    content: dict[str, Any] = {
        "of": column.quantity,
        "label": column.label,
        "unit": column.unit,
        "is_input": column.is_input,
        "is_logarithmic": column.is_logarithmic,
        "values": _rounded(column.values, _RUN_DIGITS),
        "failed": _rounded(column.failed, _RUN_DIGITS),
    }
    return content | ({"rows": column.rows} if column.rows else {})


def _axis_content(axis: Axis) -> dict[str, Any]:
    content: dict[str, Any] = {"title": {"text": escape_text(axis.short_title or axis.title)}}
    if axis.quantity is not None:
        content["of"] = axis.quantity
    if axis.is_logarithmic:
        content["type"] = "log"
    if axis.ends is not None:
        content["range"] = axis.ends
    if axis.ticks:
        content["tickvals"] = [place for place, _ in axis.ticks]
        content["ticktext"] = [escape_text(text, 28) for _, text in axis.ticks]
    if axis.rows:
        content["tickvals"] = list(range(len(axis.rows)))
        content["ticktext"] = [_row_text(row) for row in axis.rows]
        content["range"] = (len(axis.rows) - 0.5, -0.5)
        content["showgrid"] = False
    return content


def _row_text(row: str) -> str:
    """Return the name of a row, a long one in two lines."""
    if len(row) <= _WIDEST_ROW:
        return escape_text(row)
    lines = textwrap.wrap(plain_text(row), _WIDEST_ROW, max_lines=2, placeholder="…")
    return "<br>".join(map(escape_text, lines))


def traces(marks: Iterable[Mark]) -> list[Trace]:
    """Return the traces of marks, without rules and shades."""
    return [trace for mark in marks for trace in _mark_traces(mark)]


def shapes(marks: Iterable[Mark]) -> list[Trace]:
    """Return the shapes of rules and shades, which stand behind the traces."""
    return [_shape(mark) for mark in marks if isinstance(mark, Rule | Shade)]


def _mark_traces(mark: Mark) -> Sequence[Trace]:
    match mark:
        case Line():
            return [_line(mark)]
        case Band():
            return _band(mark)
        case Points():
            return [_points(mark)]
        case Dots():
            return [_dots(mark)]
        case Bars():
            edges = np.asarray(mark.edges, dtype=np.float64)
            middles, widths = _rounded((edges[1:] + edges[:-1]) / 2), _rounded(np.diff(edges))
            trace: Trace = {"type": "bar", "y": _rounded(mark.counts)}
            if mark.is_even:
                trace |= {"x0": middles[0], "dx": widths[0], "width": widths[0]}
            else:
                ends = [[*map(number_text, ends)] for ends in pairwise(edges.tolist())]
                trace |= {"x": middles, "width": widths, "customdata": ends}
            return [
                trace | {"marker": {"color": mark.series, "opacity": 0.55}} | _hover(mark.hover)
            ]
        case HeatMap():
            return [_places(mark)]
        case Rule() | Shade():
            return []
    raise TypeError(f"a mark of a chart is of class {type(mark).__name__}")


def _line(line: Line) -> Trace:
    trace: Trace = {
        "type": "scatter",
        "mode": "lines",
        "name": escape_text(line.name),
        "x": _rounded(line.x),
        "y": _rounded(line.y),
        "line": {
            "color": line.series,
            "dash": line.dash,
            "width": line.width,
            "shape": _line_shape(line),
        },
    } | _hover(line.hover)
    if line.beside:
        trace["customdata"] = list(zip(*(_rounded(each) for each in line.beside), strict=True))
    if line.texts:
        trace["text"] = [escape_text(each) for each in line.texts]
    return trace


def _line_shape(mark: Line | Band) -> str:
    return "hv" if mark.is_stepped else "linear"


def _band(band: Band) -> list[Trace]:
    edge: Trace = {
        "type": "scatter",
        "mode": "lines",
        "x": _rounded(band.x),
        "line": {"width": 0, "shape": _line_shape(band)},
        "hoverinfo": "skip",
    }
    filled = {"y": _rounded(band.upper), "fill": "tonexty", "fillcolor": band.series}
    return [edge | {"y": _rounded(band.lower)}, edge | filled]


def _points(points: Points) -> Trace:
    marker: dict[str, Any] = {
        "color": points.series,
        "symbol": points.marker,
        "size": points.size,
        "opacity": points.opacity,
    }
    if isinstance(points.outline, Sequence):
        marker["line"] = {"width": points.outline}
    elif points.outline is not None:
        marker["line"] = {"color": points.series, "width": points.outline}
    trace: Trace = {
        "type": "scatter",
        "mode": "markers",
        "name": escape_text(points.name),
        "x": _rounded(points.x, _RUN_DIGITS),
        "y": _rounded(points.y, _RUN_DIGITS),
        "marker": marker,
    } | _hover(points.hover)
    if points.texts:
        trace["text"] = [escape_text(each, 200) for each in points.texts]
    if points.numbers:
        trace["customdata"] = list(points.numbers)
    return trace


def _dots(dots: Dots) -> Trace:
    across = "y" if dots.along == "x" else "x"
    estimates, marker = dots.bounds[:, 0], dots.marker
    sides = np.maximum([estimates - dots.bounds[:, 1], dots.bounds[:, 2] - estimates], 0.0)
    symbols = [marker if known else f"{marker}-open" for known in has_interval(dots.bounds)]
    trace: Trace = {
        "type": "scatter",
        "mode": "markers",
        "name": escape_text(dots.name),
        dots.along: _rounded(estimates, _EXACT),
        across: _rounded(dots.places),
        f"error_{dots.along}": {
            "type": "data",
            "symmetric": False,
            "array": _bar_lengths(sides[1]),
            "arrayminus": _bar_lengths(sides[0]),
            "color": dots.series,
            "thickness": 1.6,
            "width": 4,
        },
        "marker": {"color": dots.series, "size": 8, "symbol": symbols},
        "text": [escape_text(each, 200) for each in dots.hovers],
        "hoverinfo": "text",
    }
    if dots.is_joined:
        trace |= {"mode": "lines+markers", "line": {"color": dots.series, "width": 1.3}}
    if dots.hover:
        trace |= {"customdata": [escape_text(each) for each in dots.labels]} | _hover(dots.hover)
    return trace


def _bar_lengths(sides: Numbers) -> list[float | str]:
    # Plotly takes None for 0, and draws the end of a bar there.
    return ["none" if length is None else length for length in _rounded(sides)]


def _places(field: HeatMap) -> Trace:
    """Return unseen points, by which a pointer reads off estimates, with the scale of colours."""
    rows, columns = (evenly_spread(each.size, _MOST_POINTS) for each in (field.y, field.x))
    shown = field.bounds[np.ix_(rows, columns)].reshape(-1, 3)
    texts = (f"{estimate_text(*row)}{field.unit}" for row in shown.tolist())
    return {
        "type": "scatter",
        "mode": "markers",
        "x": _rounded(np.tile(field.x[columns], rows.size)),
        "y": _rounded(np.repeat(field.y[rows], columns.size)),
        "text": [escape_text(text) for text in texts],
        "marker": {
            "size": 9,
            "opacity": 0,
            "color": _rounded(shown[:, 0]),
            "colorscale": "Viridis",
            "cmin": field.limits[0],
            "cmax": field.limits[1],
            "showscale": True,
            "colorbar": {"thickness": 12, "outlinewidth": 0},
        },
    } | _hover("%{x}, %{y}: %{text}")


def _image(field: HeatMap) -> Trace:
    """Return the colours of a map as an image behind the traces."""
    (left, right), (low, high) = field.ends
    pixels = _pixels(field)
    height, width, _ = pixels.shape
    lines = b"".join(b"\0" + row.tobytes() for row in pixels)
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(lines, 9)), (b"IEND", b""))
    content = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in parts
    )
    return {
        "source": f"data:image/png;base64,{base64.b64encode(content).decode('ascii')}",
        "xref": "x",
        "yref": "y",
        "sizing": "stretch",
        "layer": "below",
        "x": left,
        "y": high,
        "sizex": right - left,
        "sizey": high - low,
    }


def _pixels(field: HeatMap) -> np.ndarray:
    """Return the colours of a map, shape (row from the top, column, channel)."""
    from matplotlib import colormaps

    rows, columns = (
        np.searchsorted((each[1:] + each[:-1]) / 2, np.linspace(each[0], each[-1], _MOST_PIXELS))
        for each in (field.y, field.x)
    )
    low, high = field.limits
    shares = (field.bounds[..., 0][np.ix_(rows[::-1], columns)] - low) / (high - low or 1.0)
    colours = np.asarray(colormaps["viridis"](np.nan_to_num(shares), bytes=True))
    colours[np.isnan(shares)] = 0
    return colours


def _shape(mark: Rule | Shade) -> Trace:
    full_height = {"yref": "paper", "y0": 0, "y1": 1}
    if isinstance(mark, Shade):
        fill = {"fillcolor": mark.series, "opacity": 0.25, "line": {"width": 0}, "layer": "below"}
        return {"type": "rect", "x0": mark.lower, "x1": mark.upper, **full_height, **fill}
    line = {"color": mark.series, "dash": mark.dash}
    if mark.is_horizontal:
        ends = {"xref": "paper", "x0": 0, "x1": 1, "y0": mark.at, "y1": mark.at}
        return {"type": "line", **ends, "line": line | {"width": 1}, "layer": "below"}
    upright: Trace = {"type": "line", "x0": mark.at, "x1": mark.at, **full_height}
    upright["line"] = line | {"width": 1.5}
    if mark.label:
        upright["label"] = {
            "text": escape_text(mark.label, 20),
            "font": {"color": mark.series, "size": 11},
            "textangle": -90,
            "textposition": "start" if mark.at_foot else "end",
            "xanchor": "left" if mark.at_foot else "right",
            "yanchor": "bottom" if mark.is_before else "top",
            "padding": 0,  # it would move an upright text along its line
        }
    return upright


def _hover(template: str) -> Trace:
    return {"hovertemplate": f"{template}<extra></extra>"} if template else {"hoverinfo": "skip"}


def _rounded(values: Numbers, digits: int = 6) -> list[float | None]:
    """Round numbers to the digits that a screen can show; NaN and infinity become None."""
    return [
        float(f"{value:.{digits}g}") if np.isfinite(value) else None
        for value in np.asarray(values, dtype=np.float64).tolist()
    ]
