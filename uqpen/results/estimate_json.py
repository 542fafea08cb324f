"""One figure as JSON."""

from __future__ import annotations

import math
from typing import Any

import xarray as xr

from uqpen.archive.estimates import interval_text
from uqpen.core.labels import BOUND, INTERVAL, INTERVAL_LABEL, NOTE

__all__ = ["estimate_json"]


def estimate_json(array: xr.DataArray) -> dict[str, Any]:
    """An estimate, its bounds, and how they were made."""
    bounds = zip(array[BOUND].values.tolist(), array.values.tolist(), strict=True)
    content: dict[str, Any] = {str(k): v if math.isfinite(v) else None for k, v in bounds}
    content |= {what: interval_text(array, what) for what in (INTERVAL, INTERVAL_LABEL)}
    if note := interval_text(array, NOTE):
        content[NOTE] = note
    return content
