"""Estimates as JSON."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.labels import (
    BOUND,
    EQUIVALENT_RUNS,
    INTERVAL,
    INTERVAL_LABEL,
    NOTE,
    SURROGATE_ESTIMATE,
)

__all__ = ["entries_json", "estimate_json", "json_value"]


def estimate_json(array: xr.DataArray) -> dict[str, Any]:
    """Return an estimate, its bounds, and how they were made.

    Those of a field are lists along its dimensions.
    """
    bounds = zip(array[BOUND].values.tolist(), np.moveaxis(array.values, -1, 0), strict=True)
    content: dict[str, Any] = {str(bound): json_value(value) for bound, value in bounds}
    content |= {what: _texts_json(array, what) for what in (INTERVAL, INTERVAL_LABEL)}
    if note := _texts_json(array, NOTE):
        content[NOTE] = note
    corrections = (name for name in (SURROGATE_ESTIMATE, EQUIVALENT_RUNS) if name in array.coords)
    return content | {name: json_value(array.coords[name].values) for name in corrections}


def _texts_json(array: xr.DataArray, name: str) -> Any:
    """Return a text on an interval; a list along the dimensions of a field where it differs."""
    if name not in array.coords:
        return ""
    texts = array.coords[name].values
    found = set(np.ravel(texts).tolist())
    return str(found.pop()) if len(found) == 1 else texts.tolist()


def entries_json(
    array: xr.DataArray, entry_json: Callable[[xr.DataArray], Any] = estimate_json
) -> dict[str, Any]:
    """Return the entries of an estimate array, by the coordinate along each of its dimensions.

    A single entry lies along ``bound`` alone, behind the dimensions of its field if it has one.
    """
    for dim in array.dims:
        # Only the coordinates of a field have a unit for display.
        if dim != BOUND and "display_units" not in array[dim].attrs:
            return {
                str(label): entries_json(array[{dim: position}], entry_json)
                for position, label in enumerate(array[dim].values)
            }
    return entry_json(array)


def json_value(value: Any) -> Any:
    """Return a value as JSON knows it, which has no NaN and no infinity."""
    plain = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(plain, list):
        return [json_value(each) for each in plain]
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain
