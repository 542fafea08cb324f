"""Marks of a chart, as Plotly's traces and shapes.

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

__all__ = ["DASHES", "MARKERS", "Shape", "Trace", "band", "bars", "dots", "level", "line"]
__all__ += ["points", "rounded", "shade", "upright", "written"]

Trace = dict[str, Any]
Shape = dict[str, Any]
Numbers = Sequence[float] | npt.NDArray[np.float64] | npt.NDArray[np.int64]

# By the position of a source; as many as there are colours.
MARKERS = (
    "circle",
    "square",
    "triangle-up",
    "diamond",
    "triangle-down",
    "pentagon",
    "hexagon",
    "star-diamond",
    "triangle-left",
    "triangle-right",
)
DASHES = (
    "solid",
    "dash",
    "dot",
    "dashdot",
    "6px,3px",
    "longdashdot",
    "4px,4px",
    "longdash",
    "2px,5px",
    "8px,2px,2px,2px",
)

# Plotly reads these in a text; so they are written in the way that it writes them back from.
_READ = str.maketrans({"&": "&#38;", "<": "&#60;", ">": "&#62;", "%": "&#37;"})


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
        What is shown under a pointer, with Plotly's placeholders; texts in it are `written`.
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
        "hovertemplate": f"{hover}<extra></extra>",
    }
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
    marker: str = "circle",
    size: float = 4,
    opacity: float = 0.55,
) -> Trace:
    """Points by themselves."""
    return {
        "type": "scatter",
        "mode": "markers",
        "name": written(name),
        "x": rounded(x, 5),
        "y": rounded(y, 5),
        "marker": {"color": series, "symbol": marker, "size": size, "opacity": opacity},
        "hovertemplate": f"{hover}<extra></extra>",
    }


def dots(
    bounds: npt.NDArray[np.float64],
    places: Numbers,
    series: int | str,
    *,
    hovers: Sequence[str],
    name: str = "",
    marker: str = "circle",
    along: str = "x",
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
    """
    across = "y" if along == "x" else "x"
    estimates = bounds[:, 0]
    sides = np.maximum([estimates - bounds[:, 1], bounds[:, 2] - estimates], 0.0)
    has_any = [bool(np.isfinite(each).any()) for each in bounds[:, 1:]]
    return {
        "type": "scatter",
        "mode": "markers",
        "name": written(name),
        along: rounded(estimates, 9),
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
            "symbol": [marker if known else f"{marker}-open" for known in has_any],
        },
        "text": [written(each, 200) for each in hovers],
        "hoverinfo": "text",
    }


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


def upright(x: float, series: int | str, dash: str = "solid") -> Shape:
    """A line from the foot of a chart to its top."""
    return {
        "type": "line",
        "x0": x,
        "x1": x,
        "yref": "paper",
        "y0": 0,
        "y1": 1,
        "line": {"color": series, "dash": dash, "width": 1.5},
    }


def level(y: float, series: int | str, dash: str = "solid") -> Shape:
    """A thin line from the left of a chart to its right."""
    return {
        "type": "line",
        "xref": "paper",
        "x0": 0,
        "x1": 1,
        "y0": y,
        "y1": y,
        "line": {"color": series, "dash": dash, "width": 1},
        "layer": "below",
    }


def shade(lower: float, upper: float, series: int | str) -> Shape:
    """What lies between two such lines."""
    return {
        "type": "rect",
        "x0": lower,
        "x1": upper,
        "yref": "paper",
        "y0": 0,
        "y1": 1,
        "fillcolor": series,
        "opacity": 0.25,
        "line": {"width": 0},
        "layer": "below",
    }
