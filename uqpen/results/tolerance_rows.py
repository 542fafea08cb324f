"""The rows of a table of statistics with the tolerance limits of an output."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import xarray as xr

from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.core.statistic_dimensions import CONTENT_LEVEL, INTERVAL_CONTENT, LOWER_CONTENT
from uqpen.core.units import Scale
from uqpen.results.digits import (
    lower_tolerance_limit_text,
    percent_text,
    range_text,
    tolerance_interval_texts,
    tolerance_limit_text,
)
from uqpen.results.source_statistics import SourceStatistics, source_entries
from uqpen.results.table import NOTHING, OutputTable, estimate_remark

__all__ = ["add_tolerance_limits", "tolerance_cell"]


class _Kind(NamedTuple):
    """A kind of tolerance limit: its statistic, its row, and what its bounds are."""

    statistic: str
    dimension: str
    label: str
    text: Callable[[float, float, float], str]
    note: str


_KINDS = (
    _Kind(
        "tolerance_limit",
        CONTENT_LEVEL,
        "not exceeded, {content}",
        lambda estimate, lower, upper: tolerance_limit_text(estimate, upper),
        "at most: one-sided tolerance bound, {level} confidence",
    ),
    _Kind(
        "lower_tolerance_limit",
        LOWER_CONTENT,
        "not below, {content}",
        lambda estimate, lower, upper: lower_tolerance_limit_text(estimate, lower),
        "at least: one-sided tolerance bound, {level} confidence",
    ),
    _Kind(
        "tolerance_interval",
        INTERVAL_CONTENT,
        "tolerance interval, {content}",
        lambda estimate, lower, upper: _interval_text(lower, upper),
        "tolerance interval: contains its share of all cases with {level} confidence",
    ),
)


def add_tolerance_limits(
    table: OutputTable, statistics: SourceStatistics, output: str, shown: Scale
) -> None:
    """Add a row for each tolerance limit of an output that is a number."""
    for kind in _KINDS:
        arrays = statistics.by_source(output, kind.statistic, table.columns)
        for content, found in source_entries(arrays, kind.dimension):
            cells = [_cell(table, kind, found.get(each), shown) for each in table.columns]
            table.rows.append((kind.label.format(content=percent_text(content)), cells))


def tolerance_cell(
    table: OutputTable, statistic: str, array: xr.DataArray | None, shown: Scale
) -> str | None:
    """Return the cell of a tolerance limit, or None for another statistic."""
    kind = next((each for each in _KINDS if each.statistic == statistic), None)
    return None if kind is None else _cell(table, kind, array, shown)


def _cell(table: OutputTable, kind: _Kind, array: xr.DataArray | None, shown: Scale) -> str:
    if array is None:
        return NOTHING
    return kind.text(*shown.from_si(array.values)) + "".join(_marks(table, kind, array))


def _interval_text(lower: float, upper: float) -> str:
    return NOTHING if math.isnan(lower) else range_text(*tolerance_interval_texts(lower, upper))


def _marks(table: OutputTable, kind: _Kind, array: xr.DataArray) -> Iterator[str]:
    yield table.note_mark(estimate_remark(array))
    estimate, lower, upper = array.values.tolist()
    if lower < upper or lower < estimate or upper > estimate:
        yield table.note_mark(kind.note.format(level=percent_text(array.attrs[INTERVAL_LEVEL])))
