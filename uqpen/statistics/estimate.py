"""An estimate: a figure with its bounds, how they were made, or why there are none."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from uqpen.archive.interval_metadata import metadata_coordinates
from uqpen.core.labels import BOUND, BOUNDS, INTERVAL, INTERVAL_LABEL, INTERVAL_LEVEL, NOTE

__all__ = ["LEVEL", "Estimate"]

# The probability with which an interval covers, and the confidence of a one-sided bound.
LEVEL = 0.95


@dataclass(frozen=True)
class Estimate:
    """A figure with its bounds.

    Parameters
    ----------
    value, lower, upper : float
        NaN for what there is not.
    method : str
        The formula of the bounds, in words.
    label : str
        ``"nominal"``: they cover as often as `LEVEL` says. ``"discrete"``: at least as often, for
        counts are whole numbers. ``"conservative"``: at least as often. ``"none"``: there are none.
    note : str
        What a reader must know: why there are none, or when they may cover less.
    """

    value: float
    lower: float
    upper: float
    method: str
    label: str
    note: str = ""

    @classmethod
    def without_bounds(cls, value: float, reason: str) -> Estimate:
        """A figure that has no bounds, and why."""
        return cls(value, math.nan, math.nan, "none", "none", reason)

    def with_note(self, note: str) -> Estimate:
        """The same estimate with another note."""
        return replace(self, note=note)

    @property
    def bounds(self) -> tuple[float, float, float]:
        """Value, lower and upper bound."""
        return self.value, self.lower, self.upper

    def to_array(self, *, units: str, long_name: str) -> xr.DataArray:
        """The estimate along ``bound``; its attributes say how the bounds were made."""
        attributes: dict[str, str | float] = {
            "units": units,
            "long_name": long_name,
            INTERVAL: self.method,
            INTERVAL_LABEL: self.label,
        }
        if self.label != "none":
            attributes[INTERVAL_LEVEL] = LEVEL
        if self.note:
            attributes[NOTE] = self.note
        return xr.DataArray(list(self.bounds), {BOUND: list(BOUNDS)}, (BOUND,), attrs=attributes)

    @staticmethod
    def stack(
        estimates: Sequence[Estimate],
        dimension: str,
        *,
        units: str,
        long_name: str,
        name: str = "",
    ) -> xr.DataArray:
        """Several estimates along a dimension and ``bound``.

        How the bounds of each were made stands in coordinates along the dimension, as what was
        asked beside it must not change what is said of a figure. Where several variables share the
        dimension, `name`, the variable's own, tells their coordinates apart.
        """
        prefix = name or dimension
        return _estimate_array(estimates, {dimension: len(estimates)}, prefix, units, long_name)

    @staticmethod
    def table(
        rows: Sequence[Sequence[Estimate]],
        dimensions: tuple[str, str],
        *,
        units: str,
        long_name: str,
        name: str,
    ) -> xr.DataArray:
        """Estimates along two dimensions and ``bound``; like `stack` otherwise."""
        shape = dict(zip(dimensions, (len(rows), len(rows[0])), strict=True))
        estimates = [estimate for row in rows for estimate in row]
        return _estimate_array(estimates, shape, name, units, long_name)


def _estimate_array(
    estimates: Sequence[Estimate],
    shape: Mapping[str, int],
    name: str,
    units: str,
    long_name: str,
) -> xr.DataArray:
    """Estimates along dimensions, with what each says of its own interval beside it."""
    bounds = np.array([estimate.bounds for estimate in estimates])
    texts = {
        INTERVAL: [estimate.method for estimate in estimates],
        INTERVAL_LABEL: [estimate.label for estimate in estimates],
        NOTE: [estimate.note for estimate in estimates],
    }
    return xr.DataArray(
        bounds.reshape(*shape.values(), len(BOUNDS)),
        {BOUND: list(BOUNDS), **metadata_coordinates(name, shape, texts)},
        (*shape, BOUND),
        attrs={"units": units, "long_name": long_name, INTERVAL_LEVEL: LEVEL},
    )
