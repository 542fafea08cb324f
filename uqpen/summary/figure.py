"""One figure as JSON."""

from __future__ import annotations

import math
from typing import Any

import xarray as xr

from uqpen.archive.told import told
from uqpen.labels import BOUND, INTERVAL, INTERVAL_LABEL, NOTE

__all__ = ["figure"]


def figure(array: xr.DataArray) -> dict[str, Any]:
    """An estimate, its bounds, and how they were made."""
    bounds = zip(array[BOUND].values.tolist(), array.values.tolist(), strict=True)
    figure: dict[str, Any] = {str(k): v if math.isfinite(v) else None for k, v in bounds}
    figure |= {what: told(array, what) for what in (INTERVAL, INTERVAL_LABEL)}
    if note := told(array, NOTE):
        figure[NOTE] = note
    return figure
