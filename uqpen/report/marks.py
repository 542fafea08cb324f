"""Marks of a chart, as Plotly's traces.

A colour is the number of a source among an archive's, or the name of one of the page's colours; the
page's script looks it up in the page's style, so that it follows the theme. Texts are escaped for
Plotly, which reads some tags in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.figures.texts import plain
from uqpen.report.legend import OUTLINES, STROKES
from uqpen.report.notes import has_interval

__all__ = [
    "DASHES",
    "MARKERS",
    "Trace",
    "band",
    "bars",
    "crosses",
    "dash_of",
    "dots",
    "line",
    "marker_of",
    "points",
    "rounded",
    "written",
]

# As Plotly takes them; all are made by the functions below.
Trace = dict[str, Any]
Numbers = Sequence[float] | npt.NDArray[np.float64] | npt.NDArray[np.int64]

# By the position of a source; as many as there are colours. A legend has all of them.
MARKERS = tuple(marker for marker in OUTLINES if marker != "x")
DASHES = tuple(STROKES)

# Digits of what has an interval, which may be narrow.
_EXACT = 9

# Plotly reads these in a text; so they are written in the way that it writes them back from.
_READ = str.maketrans({"&": "&#38;", "<": "&#60;", ">": "&#62;", "%": "&#37;"})


def marker_of(series: int) -> str:
    """The marker of a source, by its position."""
    return MARKERS[series % len(MARKERS)]


def dash_of(series: int) -> str:
    """The dashes of a source's line, by its position."""
    return DASHES[series % len(DASHES)]


def written(text: str, longest: int = 80) -> str:
    """A text for Plotly, which shows it as it stands."""
    return plain(text, longest).translate(_READ)


def rounded(values: Numbers, digits: int = 6) -> list[float | None]:
    """Numbers in the digits that a screen can show; None for what is none."""
    return [
        float(f"{value:.{digits}g}") if np.isfinite(value) else None
        for value in np.asarray(values, dtype=np.float64).tolist()
    ]


def line(
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
    x, y : array_like of float
    series : int or str
        Its colour.
    hover : str
        What is shown under a pointer, with Plotly's placeholders; texts in it are `written`. Empty
        for nothing.
    name : str
        What a test or a reader finds it by.
    beside : sequence of array_like
        What the placeholders ``customdata`` stand for.
    dash : str
        Of `DASHES`.
    width : float
        In CSS pixels.
    is_stepped : bool
        Whether it goes on level until the next point.
    """
    trace: Trace = {
        "type": "scatter",
        "mode": "lines",
        "name": written(name),
        "x": rounded(x),
        "y": rounded(y),
        "line": {
            "color": series,
            "dash": dash,
            "width": width,
            "shape": "hv" if is_stepped else "linear",
        },
    } | _under_pointer(hover)
    if beside:
        trace["customdata"] = list(zip(*(rounded(each) for each in beside), strict=True))
    return trace


def band(
    x: Numbers, lower: Numbers, upper: Numbers, series: int | str, *, is_stepped: bool = False
) -> list[Trace]:
    """What lies between two lines."""
    shape = "hv" if is_stepped else "linear"
    edge: Trace = {
        "type": "scatter",
        "mode": "lines",
        "x": rounded(x),
        "line": {"width": 0, "shape": shape},
        "hoverinfo": "skip",
    }
    filled = {"y": rounded(upper), "fill": "tonexty", "fillcolor": series}
    return [edge | {"y": rounded(lower)}, edge | filled]


def points(
    x: Numbers,
    y: Numbers,
    series: int | str,
    *,
    hover: str,
    name: str = "",
    texts: Sequence[str] = (),
    numbers: Sequence[int] = (),
    marker: str = "circle",
    size: float = 4,
    opacity: float = 0.55,
) -> Trace:
    """Points by themselves.

    Parameters
    ----------
    x, y : array_like of float
    series : int or str
        Their colour.
    hover : str
        As of a `line`.
    name : str
    texts : sequence of str
        Plain texts, one for each point: what the placeholder ``text`` stands for.
    numbers : sequence of int
        Likewise ``customdata``, such as the place of a run among all.
    marker : str
        Of `MARKERS`, or with ``-open`` behind it.
    size : float
        In CSS pixels.
    opacity : float
    """
    trace: Trace = {
        "type": "scatter",
        "mode": "markers",
        "name": written(name),
        "x": rounded(x, 5),
        "y": rounded(y, 5),
        "marker": {"color": series, "symbol": marker, "size": size, "opacity": opacity},
    } | _under_pointer(hover)
    if texts:
        trace["text"] = [written(each, 200) for each in texts]
    if numbers:
        trace["customdata"] = list(numbers)
    return trace


def crosses(estimates: Numbers, places: Numbers, name: str) -> Trace:
    """What crosses out `dots` that are refused; a pointer still finds these."""
    trace = points(
        estimates, places, "ink", hover="", name=name, marker="x-thin-open", size=11, opacity=1
    )
    trace["marker"]["line"] = {"color": "ink", "width": 2}
    return trace | {"x": rounded(estimates, _EXACT)}


def dots(
    bounds: npt.NDArray[np.float64],
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
    series : int or str
    hovers : sequence of str
        Plain texts, one for each.
    name : str
    marker : str
        Of `MARKERS`.
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
        "name": written(name),
        along: rounded(estimates, _EXACT),
        across: rounded(places),
        f"error_{along}": {
            "type": "data",
            "symmetric": False,
            "array": _lengths(sides[1]),
            "arrayminus": _lengths(sides[0]),
            "color": series,
            "thickness": 1.6,
            "width": 4,
        },
        "marker": {
            "color": series,
            "size": 8,
            "symbol": [marker if known else f"{marker}-open" for known in has_interval(bounds)],
        },
        "text": [written(each, 200) for each in hovers],
        "hoverinfo": "text",
    }
    if is_joined:
        trace |= {"mode": "lines+markers", "line": {"color": series, "width": 1.3}}
    return trace


def _under_pointer(hover: str) -> Trace:
    return {"hovertemplate": f"{hover}<extra></extra>"} if hover else {"hoverinfo": "skip"}


def _lengths(sides: Numbers) -> list[float | str]:
    # Plotly takes None for 0, and draws the end of a bar there.
    return ["none" if length is None else length for length in rounded(sides)]


def bars(edges: Numbers, counts: Numbers, series: int | str, *, hover: str) -> Trace:
    """Counts of what lies between edges."""
    edges = np.asarray(edges, dtype=np.float64)
    return {
        "type": "bar",
        "x": rounded((edges[1:] + edges[:-1]) / 2),
        "y": rounded(counts),
        "width": rounded(np.diff(edges)),
        "customdata": list(zip(rounded(edges[:-1], 4), rounded(edges[1:], 4), strict=True)),
        "marker": {"color": series, "opacity": 0.55},
        "hovertemplate": f"{hover}<extra></extra>",
    }
