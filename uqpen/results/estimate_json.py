"""Estimates as JSON."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import xarray as xr

from uqpen.archive.estimates import interval_text
from uqpen.core.labels import BOUND, INTERVAL, INTERVAL_LABEL, NOTE

__all__ = ["entries_json", "estimate_json", "json_value"]


def estimate_json(array: xr.DataArray) -> dict[str, Any]:
    """Return an estimate, its bounds, and how they were made."""
    bounds = zip(array[BOUND].values.tolist(), array.values.tolist(), strict=True)
    content: dict[str, Any] = {str(bound): json_value(value) for bound, value in bounds}
    content |= {what: interval_text(array, what) for what in (INTERVAL, INTERVAL_LABEL)}
    if note := interval_text(array, NOTE):
        content[NOTE] = note
    return content


def entries_json(
    array: xr.DataArray, entry_json: Callable[[xr.DataArray], Any] = estimate_json
) -> dict[str, Any]:
    """Return the entries of an estimate array, by the coordinate along each of its dimensions.

    A single entry lies along ``bound`` alone.
    """
    if array.dims == (BOUND,):
        return entry_json(array)
    labels = array[array.dims[0]].values
    return {
        str(label): entries_json(each, entry_json)
        for label, each in zip(labels, array, strict=True)
    }


def json_value(value: Any) -> Any:
    """Return a value as JSON knows it, which has no NaN and no infinity."""
    plain = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(plain, list):
        return [json_value(each) for each in plain]
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain
