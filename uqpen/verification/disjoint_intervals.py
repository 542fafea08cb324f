"""Estimates of two archives that lie outside each other's intervals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.fields import coordinate_text
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
        apart = np.flatnonzero(is_apart).tolist()
        # Neighbouring places of a field differ together: one of them speaks for all.
        is_field = any("display_units" in one[dim].attrs for dim in variable.dims[:-1])
        for position in apart[:1] if is_field else apart:
            shown = [estimate_text(*row[position].tolist()) for row in rows]
            entry = f"[{position}]" if len(is_apart) > 1 else ""
            unit = str(variable.attrs.get("units", "1"))
            behind = "" if unit == "1" else f" {unit}"
            if is_field:
                entry = _entry_text(variable, position)
                behind += f"; {len(apart)} of {len(is_apart)} are apart"
            yield f"{name}{entry}: {shown[0]} and {shown[1]}{behind}"


def _entry_text(variable: xr.DataArray, position: int) -> str:
    """Return the coordinates of an entry of a field's statistic, by its position among all."""
    index = np.unravel_index(position, variable.shape[:-1])
    labels = {dim: variable[dim].values[at] for dim, at in zip(variable.dims, index, strict=False)}
    texts = [
        coordinate_text(variable[dim], label)
        if "display_units" in variable[dim].attrs
        else f"{dim} = {label}"
        for dim, label in labels.items()
    ]
    return f" at {', '.join(texts)}"


def _outside(estimates: np.ndarray, intervals: np.ndarray) -> np.ndarray:
    """Mask of the estimates that are outside the other's intervals; a NaN bound excludes none."""
    value, lower, upper = estimates[:, 0], intervals[:, 1], intervals[:, 2]
    outside: np.ndarray = (value < lower) | (value > upper)
    return outside
