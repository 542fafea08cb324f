"""Lines and shades behind the marks of a chart, as Plotly's shapes.

Their colours are those of marks.
"""

from __future__ import annotations

from typing import Any

from uqpen.report.marks import escape_text

__all__ = ["Shape", "horizontal_line", "labelled_line", "shaded_interval", "vertical_line"]

Shape = dict[str, Any]

_FULL_HEIGHT = {"yref": "paper", "y0": 0, "y1": 1}
_FULL_WIDTH = {"xref": "paper", "x0": 0, "x1": 1}


def vertical_line(x: float, series: int | str, dash: str = "solid") -> Shape:
    """A line from the foot of a chart to its top."""
    line = {"color": series, "dash": dash, "width": 1.5}
    return {"type": "line", "x0": x, "x1": x, **_FULL_HEIGHT, "line": line}


def labelled_line(
    x: float, series: int | str, dash: str, text: str, *, at_foot: bool, is_before: bool
) -> Shape:
    """A line from the foot of a chart to its top, with an upright text at one of its ends.

    Parameters
    ----------
    text : str
        A plain text.
    at_foot : bool
        True for a text at the foot, False for one at the top.
    is_before : bool
        Whether it stands on the left of the line.
    """
    label = {
        "text": escape_text(text, 20),
        "font": {"color": series, "size": 11},
        "textangle": -90,
        "textposition": "start" if at_foot else "end",
        "xanchor": "left" if at_foot else "right",
        "yanchor": "bottom" if is_before else "top",
        "padding": 0,  # it would move an upright text along its line
    }
    return vertical_line(x, series, dash) | {"label": label}


def horizontal_line(y: float, series: int | str, dash: str = "solid") -> Shape:
    """A thin line from the left of a chart to its right."""
    line = {"color": series, "dash": dash, "width": 1}
    return {"type": "line", **_FULL_WIDTH, "y0": y, "y1": y, "line": line, "layer": "below"}


def shaded_interval(lower: float, upper: float, series: int | str) -> Shape:
    """Return the shaded area between two vertical lines."""
    fill = {"fillcolor": series, "opacity": 0.25, "line": {"width": 0}, "layer": "below"}
    return {"type": "rect", "x0": lower, "x1": upper, **_FULL_HEIGHT, **fill}
