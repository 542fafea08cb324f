"""Lines and shades behind the marks of a chart, as Plotly's shapes.

Their colours are those of marks.
"""

from __future__ import annotations

from typing import Any

__all__ = ["Shape", "horizontal_line", "shaded_interval", "vertical_line"]

Shape = dict[str, Any]


def vertical_line(x: float, series: int | str, dash: str = "solid") -> Shape:
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


def horizontal_line(y: float, series: int | str, dash: str = "solid") -> Shape:
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


def shaded_interval(lower: float, upper: float, series: int | str) -> Shape:
    """Return the shaded area between two vertical lines."""
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
