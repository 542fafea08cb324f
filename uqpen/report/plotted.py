"""Charts as the JSON that the page's script draws them from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from uqpen.report.blocks import Axis, Chart
from uqpen.report.marks import written

__all__ = ["as_json"]


def as_json(charts: Sequence[Chart]) -> str:
    """All charts of a page; a text that ends no script, whatever it holds."""
    content = [_plotted(chart) for chart in charts]
    text = json.dumps(content, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("-->", "--\\u003e")


def _plotted(chart: Chart) -> dict[str, Any]:
    """What the page's script draws a chart from."""
    drawn: dict[str, Any] = {
        "traces": chart.traces,
        "shapes": chart.shapes,
        "x": _axis(chart.x),
        "y": _axis(chart.y),
        "height": chart.height,
    }
    if chart.reading is not None:
        drawn["bounds"] = chart.reading.bounds
    return drawn


def _axis(axis: Axis) -> dict[str, Any]:
    told: dict[str, Any] = {"title": {"text": written(axis.title)}}
    if axis.is_logarithmic:
        told["type"] = "log"
    if axis.ends is not None:
        told["range"] = axis.ends
    if axis.rows:
        told["tickvals"] = list(range(len(axis.rows)))
        told["ticktext"] = [written(row, 28) for row in axis.rows]
        told["range"] = (len(axis.rows) - 0.5, -0.5)
    return told
