"""Estimates of two archives that lie outside each other's intervals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.core.labels import BOUND
from uqpen.results.digits import estimate_text

__all__ = ["disjoint_intervals"]


def disjoint_intervals(one: xr.Dataset, other: xr.Dataset) -> Iterator[str]:
    """Yield the pairs of estimates of two groups that each lie outside the other's interval.

    Statistics that only one group has, and those without an interval in one of them, are left out.
    """
    for name, variable in one.data_vars.items():
        if name not in other.data_vars or variable.dims[-1:] != (BOUND,):
            continue
        pair = variable.values, other[name].values
        if pair[0].shape != pair[1].shape or pair[0].shape[-1] != 3 or pair[0].dtype.kind != "f":
            continue
        rows = [values.reshape(-1, 3) for values in pair]
        is_apart = _outside(rows[0], rows[1]) & _outside(rows[1], rows[0])
        for position in np.flatnonzero(is_apart).tolist():
            shown = [estimate_text(*row[position].tolist()) for row in rows]
            entry = f"[{position}]" if len(is_apart) > 1 else ""
            unit = str(variable.attrs.get("units", "1"))
            behind = "" if unit == "1" else f" {unit}"
            yield f"{name}{entry}: {shown[0]} and {shown[1]}{behind}"


def _outside(estimates: np.ndarray, intervals: np.ndarray) -> np.ndarray:
    """Mask of the estimates that are outside the other's intervals; a NaN bound excludes none."""
    value, lower, upper = estimates[:, 0], intervals[:, 1], intervals[:, 2]
    outside: np.ndarray = (value < lower) | (value > upper)
    return outside
