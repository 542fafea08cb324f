"""Marks of a chart, as Plotly's traces.

A colour is the number of a source among an archive's, or the name of one of the page's colours; the
page's script looks it up in the page's style, so that it follows the theme. Texts are escaped for
Plotly, which reads some tags in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.report.legend import CROSS, END, OUTLINES, STROKES
from uqpen.report.notes import has_interval
from uqpen.results.digits import number_text
from uqpen.results.texts import plain_text

__all__ = [
    "DASHES",
    "MARKERS",
    "PointStyle",
    "Trace",
    "band_traces",
    "bar_trace",
    "dot_trace",
    "end_trace",
    "escape_text",
    "even_bar_trace",
    "key_marker",
    "line_trace",
    "point_trace",
    "rounded_numbers",
    "series_dash",
    "series_marker",
]

# Traces in Plotly's form, made by the functions below.
Trace = dict[str, Any]
Numbers = Sequence[float] | FloatArray | IntArray

# By the position of a source, one for each colour. A legend can draw all of them.
MARKERS = tuple(marker for marker in OUTLINES if marker not in (CROSS, END))
DASHES = tuple(STROKES)

# Digits of estimates with an interval, which may be narrow.
_EXACT = 9

# Plotly reads these in a text; so they are written in the way that it writes them back from.
_READ = str.maketrans({"&": "&#38;", "<": "&#60;", ">": "&#62;", "%": "&#37;"})


def series_marker(series: int) -> str:
    """The marker of a source, by its position."""
    return MARKERS[series % len(MARKERS)]


def series_dash(series: int) -> str:
    """The dashes of a source's line, by its position."""
    return DASHES[series % len(DASHES)]


def escape_text(text: str, longest: int = 80) -> str:
    """A text for Plotly, which shows it as it stands."""
    return plain_text(text, longest).translate(_READ)


def rounded_numbers(values: Numbers, digits: int = 6) -> list[float | None]:
    """Round numbers to the digits that a screen can show; NaN and infinity become None."""
    return [
        float(f"{value:.{digits}g}") if np.isfinite(value) else None
        for value in np.asarray(values, dtype=np.float64).tolist()
    ]


def line_trace(
    x: Numbers,
    y: Numbers,
    series: int | str,
    *,
    hover: str,
    name: str = "",
    beside: Sequence[Numbers] = (),
    dash: str = "solid",
    width: float = 2,
    is_stepped: bool = False,
) -> Trace:
    """A line.

    Parameters
    ----------
    hover : str
        Text under a pointer, with Plotly's placeholders; texts in it are `escape_text`.
    name : str
        What a test or a reader finds it by.
    beside : sequence of array_like
        Values of the placeholders ``customdata``.
    width : float
        In CSS pixels.
    is_stepped : bool
        Whether it goes on level until the next point.
    """
    shape = "hv" if is_stepped else "linear"
    trace: Trace = {
        "type": "scatter",
        "mode": "lines",
        "name": escape_text(name),
        "x": rounded_numbers(x),
        "y": rounded_numbers(y),
        "line": {"color": series, "dash": dash, "width": width, "shape": shape},
    } | _hover_attributes(hover)
    if beside:
        trace["customdata"] = list(zip(*(rounded_numbers(each) for each in beside), strict=True))
    return trace


def band_traces(
    x: Numbers, lower: Numbers, upper: Numbers, series: int | str, *, is_stepped: bool = False
) -> list[Trace]:
    """Return the traces of a band between two lines."""
    edge: Trace = {
        "type": "scatter",
        "mode": "lines",
        "x": rounded_numbers(x),
        "line": {"width": 0, "shape": "hv" if is_stepped else "linear"},
        "hoverinfo": "skip",
    }
    filled = {"y": rounded_numbers(upper), "fill": "tonexty", "fillcolor": series}
    return [edge | {"y": rounded_numbers(lower)}, edge | filled]


class PointStyle(NamedTuple):
    """Looks of points.

    Attributes
    ----------
    marker : str
        Of `MARKERS`, or with ``-open`` behind it.
    size : float
        In CSS pixels.
    opacity : float
    """

    marker: str = "circle"
    size: float = 4
    opacity: float = 0.55


def point_trace(
    x: Numbers,
    y: Numbers,
    series: int | str,
    *,
    hover: str,
    name: str = "",
    texts: Sequence[str] = (),
    numbers: Sequence[int] = (),
    style: PointStyle | None = None,
) -> Trace:
    """Points by themselves.

    Parameters
    ----------
    texts : sequence of str
        Plain texts, one for each point: values of the placeholder ``text``.
    numbers : sequence of int
        Likewise ``customdata``, such as the place of a run among all.
    style : PointStyle, optional
        Their looks; by default, those of one of many runs.
    """
    style = style or PointStyle()
    trace: Trace = {
        "type": "scatter",
        "mode": "markers",
        "name": escape_text(name),
        "x": rounded_numbers(x, 5),
        "y": rounded_numbers(y, 5),
        "marker": {
            "color": series,
            "symbol": style.marker,
            "size": style.size,
            "opacity": style.opacity,
        },
    } | _hover_attributes(hover)
    if texts:
        trace["text"] = [escape_text(each, 200) for each in texts]
    if numbers:
        trace["customdata"] = list(numbers)
    return trace


def end_trace(x: Numbers, y: Numbers, series: int | str, *, name: str) -> Trace:
    """Return the upright tick at the end of a line; a pointer finds its name."""
    style = PointStyle(f"{END}-open", size=14, opacity=1)
    trace = point_trace(x, y, series, hover=escape_text(name), name=name, style=style)
    trace["marker"]["line"] = {"color": series, "width": 2.5}
    return trace


def dot_trace(
    bounds: FloatArray,
    places: Numbers,
    series: int | str,
    *,
    hovers: Sequence[str],
    name: str = "",
    marker: str = "circle",
    along: str = "x",
    is_joined: bool = False,
) -> Trace:
    """Estimates with their intervals; hollow where there is none.

    Parameters
    ----------
    bounds : ndarray of shape (estimate, bound)
        Estimate, lower, upper; NaN for a bound that is none.
    places : array_like of float
        Along the other axis.
    hovers : sequence of str
        Plain texts, one for each.
    along : str
        Which axis the estimates lie along.
    is_joined : bool
        Whether a line goes through them.
    """
    across = "y" if along == "x" else "x"
    estimates = bounds[:, 0]
    sides = np.maximum([estimates - bounds[:, 1], bounds[:, 2] - estimates], 0.0)
    trace: Trace = {
        "type": "scatter",
        "mode": "markers",
        "name": escape_text(name),
        along: rounded_numbers(estimates, _EXACT),
        across: rounded_numbers(places),
        f"error_{along}": {
            "type": "data",
            "symmetric": False,
            "array": _bar_lengths(sides[1]),
            "arrayminus": _bar_lengths(sides[0]),
            "color": series,
            "thickness": 1.6,
            "width": 4,
        },
        "marker": {
            "color": series,
            "size": 8,
            "symbol": [marker if known else f"{marker}-open" for known in has_interval(bounds)],
        },
        "text": [escape_text(each, 200) for each in hovers],
        "hoverinfo": "text",
    }
    if is_joined:
        trace |= {"mode": "lines+markers", "line": {"color": series, "width": 1.3}}
    return trace


def key_marker(marker: str, bounds: FloatArray) -> str:
    """Return the marker of a legend for estimates: hollow where none of them has an interval.

    Parameters
    ----------
    bounds : ndarray of shape (estimate, bound)
        As of `dot_trace`.
    """
    return marker if has_interval(bounds).any() else f"{marker}-open"


def _hover_attributes(hover: str) -> Trace:
    return {"hovertemplate": f"{hover}<extra></extra>"} if hover else {"hoverinfo": "skip"}


def _bar_lengths(sides: Numbers) -> list[float | str]:
    # Plotly takes None for 0, and draws the end of a bar there.
    return ["none" if length is None else length for length in rounded_numbers(sides)]


def bar_trace(edges: Numbers, counts: Numbers, series: int | str, *, hover: str) -> Trace:
    """Counts between the edges."""
    edges = np.asarray(edges, dtype=np.float64)
    return {
        "type": "bar",
        "x": rounded_numbers((edges[1:] + edges[:-1]) / 2),
        "y": rounded_numbers(counts),
        "width": rounded_numbers(np.diff(edges)),
        "customdata": [[*map(number_text, ends)] for ends in pairwise(edges.tolist())],
        "marker": {"color": series, "opacity": 0.55},
        "hovertemplate": f"{hover}<extra></extra>",
    }


def even_bar_trace(edges: FloatArray, counts: Numbers, series: int | str, *, hover: str) -> Trace:
    """Counts in bins of equal width, which stand as the first one and the width."""
    first, width = rounded_numbers([(edges[0] + edges[1]) / 2, edges[1] - edges[0]])
    trace = bar_trace(edges, counts, series, hover=hover)
    del trace["x"], trace["customdata"]
    return trace | {"x0": first, "dx": width, "width": width}
