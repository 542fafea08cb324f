"""The cells of a table with the tolerance limits of an output."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

import xarray as xr

from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.core.statistic import Statistic
from uqpen.core.units import Scale
from uqpen.results.digits import (
    lower_tolerance_limit_text,
    percent_text,
    range_text,
    tolerance_interval_texts,
    tolerance_limit_text,
)
from uqpen.results.table import NOTHING, OutputTable, estimate_remark

__all__ = ["tolerance_cell"]


# By its ends: how the limit is written from the estimate and its bounds, and what it is.
_KINDS: Mapping[str, tuple[Callable[[float, float, float], str], str]] = {
    "at most": (
        lambda estimate, lower, upper: tolerance_limit_text(estimate, upper),
        "at most: one-sided tolerance bound, {level} confidence",
    ),
    "at least": (
        lambda estimate, lower, upper: lower_tolerance_limit_text(estimate, lower),
        "at least: one-sided tolerance bound, {level} confidence",
    ),
    "between": (
        lambda estimate, lower, upper: _interval_text(lower, upper),
        "tolerance interval: contains its share of all cases with {level} confidence",
    ),
}


def tolerance_cell(
    table: OutputTable, statistic: Statistic, array: xr.DataArray | None, shown: Scale
) -> str:
    """Return the cell of a tolerance limit, a statistic that states an end."""
    if array is None:
        return NOTHING
    text, note = _KINDS[statistic.shown.ends]
    return text(*shown.from_si(array.values)) + "".join(_marks(table, note, array))


def _interval_text(lower: float, upper: float) -> str:
    return NOTHING if math.isnan(lower) else range_text(*tolerance_interval_texts(lower, upper))


def _marks(table: OutputTable, note: str, array: xr.DataArray) -> Iterator[str]:
    yield table.note_mark(estimate_remark(array))
    estimate, lower, upper = array.values.tolist()
    if lower < upper or lower < estimate or upper > estimate:
        yield table.note_mark(note.format(level=percent_text(array.attrs[INTERVAL_LEVEL])))
