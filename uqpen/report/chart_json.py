"""Charts as the JSON that the page's script draws them from."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Sequence
from typing import Any

from uqpen.report.blocks import Axis, Chart, RunColumn, RunExplorer, ThresholdReadout
from uqpen.report.marks import escape_text
from uqpen.report.place_selection import PlaceReadout
from uqpen.results.texts import plain_text

__all__ = ["charts_json"]

# Frequent characters of estimates (… ± − –), which take less room as they are; and a backslash.
_FREQUENT = re.compile(r"\\\\|\\u(2026|00b1|2212|2013)")
# A list that is longer is written once.
_SHORT = 12
# Characters of a row's name in one line.
_WIDEST_ROW = 28


def charts_json(charts: Sequence[Chart], explorers: Sequence[RunExplorer] = ()) -> str:
    """All charts and all drawn runs of a page, as a text that cannot end a script."""
    drawn = [_chart_content(chart) for chart in charts]
    drawn += [_explorer_content(explorer) for explorer in explorers]
    every = _deduplicate_lists(drawn)
    content = {"charts": every[: len(charts)], "runs": every[len(charts) :]}
    text = json.dumps(content, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    text = _FREQUENT.sub(lambda found: chr(int(found[1], 16)) if found[1] else found[0], text)
    return text.replace("<", "\\u003c").replace("-->", "--\\u003e")


# Where a list is written: number of the chart or the runs, number of the trace, key.
_Place = tuple[int, int, str]


def _deduplicate_lists(charts: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return charts with each long list of the traces once; later ones refer to it.

    Charts side by side have the same runs along an axis. The page's script puts the lists back.
    """
    known: dict[str, _Place] = {}
    every = [
        chart
        | {
            "traces": [
                {key: _kept(value, known, (number, at, key)) for key, value in trace.items()}
                for at, trace in enumerate(chart["traces"])
            ]
        }
        for number, chart in enumerate(charts)
    ]
    for chart in every:
        if "place" in chart:
            chart["place"] = _place_read(chart["place"], known)
        if "reading" in chart:
            chart["reading"]["values"] = _kept(chart["reading"]["values"], known)
    return every


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
        drawn["place"] = _place_content(chart.place)
    if chart.slices is not None:
        at = chart.slices
        drawn["slices"] = {"of": at.dimension, "values": at.values, "traces": at.traces}
    if chart.runs_of is not None:
        drawn["runs"] = chart.runs_of
    return drawn


def _reading_content(reading: ThresholdReadout) -> dict[str, Any]:
    content: dict[str, Any] = {
        "values": reading.values,
        "limits": reading.limits,
        "start": reading.start,
        "bounds": reading.bounds,
    }
    return content if reading.beyond is None else content | reading.beyond._asdict()


def _place_content(place: PlaceReadout) -> dict[str, Any]:
    columns = [
        {"label": each.label, "unit": each.unit, "texts": each.texts, "reasons": each.reasons}
        for each in place.columns
    ]
    return {"values": place.values, "heads": place.heads, "columns": columns, "start": place.start}


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
        "is_logarithmic": column.is_logarithmic,
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
