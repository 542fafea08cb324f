"""Charts as the JSON that the page's script draws them from."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Sequence
from typing import Any

from uqpen.report.blocks import Axis, Chart, RunColumn, RunExplorer, ThresholdReadout
from uqpen.report.marks import escape_text
from uqpen.results.texts import plain_text

__all__ = ["charts_json"]

# A list that is longer is written once.
_SHORT = 50
# Characters of a row's name in one line.
_WIDEST_ROW = 28


def charts_json(charts: Sequence[Chart], explorers: Sequence[RunExplorer] = ()) -> str:
    """All charts and all drawn runs of a page, as a text that cannot end a script."""
    drawn = [_chart_content(chart) for chart in charts]
    drawn += [_explorer_content(explorer) for explorer in explorers]
    every = _deduplicate_lists(drawn)
    content = {"charts": every[: len(charts)], "runs": every[len(charts) :]}
    text = json.dumps(content, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("-->", "--\\u003e")


def _deduplicate_lists(charts: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return charts with each long list of the traces once; later ones refer to it.

    Charts side by side have the same runs along an axis. The page's script puts the lists back.
    """
    places: dict[str, tuple[int, int, str]] = {}

    def kept(key: str, value: Any, chart: int, trace: int) -> Any:
        if not isinstance(value, list) or len(value) <= _SHORT:
            return value
        own = chart, trace, key
        first = places.setdefault(json.dumps(value), own)
        return value if first == own else {"same": first}

    return [
        chart
        | {
            "traces": [
                {key: kept(key, value, number, position) for key, value in trace.items()}
                for position, trace in enumerate(chart["traces"])
            ]
        }
        for number, chart in enumerate(charts)
    ]


def _chart_content(chart: Chart) -> dict[str, Any]:
    drawn: dict[str, Any] = {
        "traces": chart.traces,
        "shapes": chart.shapes,
        "x": _axis_content(chart.x),
        "y": _axis_content(chart.y),
        "height": chart.height,
        "hovermode": "x unified" if chart.is_compared else "closest",
    }
    if chart.reading is not None:
        drawn["reading"] = _reading_content(chart.reading)
    if chart.images:
        drawn["images"] = chart.images
    if chart.place is not None:
        read = chart.place
        drawn["place"] = {"values": read.values, "texts": read.texts, "start": read.start}
    if chart.slices is not None:
        at = chart.slices
        drawn["slices"] = {"of": at.dimension, "values": at.values, "traces": at.traces}
    if chart.runs_of is not None:
        drawn["runs"] = chart.runs_of
    return drawn


def _reading_content(reading: ThresholdReadout) -> dict[str, Any]:
    content: dict[str, Any] = {
        "first": reading.first,
        "step": reading.step,
        "decimals": reading.decimals,
        "start": reading.start,
        "bounds": reading.bounds,
    }
    return content if reading.beyond is None else content | reading.beyond._asdict()


def _explorer_content(explorer: RunExplorer) -> dict[str, Any]:
    """Return runs with their columns as traces, whose lists those of charts may be."""
    return {
        "model": explorer.model,
        "series": explorer.series,
        "completed": explorer.completed,
        "failed": explorer.failed,
        "traces": [_column_content(column) for column in explorer.columns],
    }


def _column_content(column: RunColumn) -> dict[str, Any]:
    content: dict[str, Any] = {
        "of": column.quantity,
        "label": column.label,
        "unit": column.unit,
        "is_input": column.is_input,
        "values": column.values,
        "failed": column.failed,
    }
    return content | ({"rows": column.rows} if column.rows else {})


def _axis_content(axis: Axis) -> dict[str, Any]:
    content: dict[str, Any] = {"title": {"text": escape_text(axis.title)}}
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
