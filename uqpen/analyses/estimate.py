"""An estimate with its bounds, as every analysis gives it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.analyses.sample import Plan, Sample
from uqpen.labels import BOUND, BOUNDS

__all__ = ["LEVEL", "Interval", "bounded", "reason_for_none"]

LEVEL = 0.95


@dataclass(frozen=True)
class Interval:
    """How an interval was made, for whoever reads it.

    Parameters
    ----------
    method : str
        The formula in words; ``"none"`` where there is no interval.
    label : str
        ``"nominal"``: it covers as often as its level says. ``"discrete"``, ``"conservative"``: at
        least as often. ``"none"``: there is none.
    note : str
        What a reader must know: why there is none, or when it may cover less.
    level : float
        The probability it covers with.
    """

    method: str
    label: str = "nominal"
    note: str = ""
    level: float = LEVEL

    @classmethod
    def none(cls, reason: str) -> Interval:
        """No interval, and why."""
        return cls("none", "none", reason)


def bounded(
    estimate: npt.ArrayLike,
    lower: npt.ArrayLike,
    upper: npt.ArrayLike,
    interval: Interval,
    *,
    dims: tuple[str, ...] = (),
    units: str,
    long_name: str,
) -> xr.DataArray:
    """An estimate with its bounds, along a last dimension ``bound``.

    Bounds are NaN where there are none; the attributes say how they were made, or why not.
    """
    stacked = np.stack(np.broadcast_arrays(estimate, lower, upper), axis=-1).astype(np.float64)
    attributes: dict[str, str | float] = {
        "units": units,
        "long_name": long_name,
        "interval": interval.method,
        "interval_label": interval.label,
    }
    if interval.label != "none":
        attributes["interval_level"] = interval.level
    if interval.note:
        attributes["note"] = interval.note
    return xr.DataArray(stacked, {BOUND: list(BOUNDS)}, (*dims, BOUND), attrs=attributes)


def reason_for_none(sample: Sample) -> str:
    """Why no interval at all can be told for a sample; empty where one can."""
    if sample.plan is Plan.UNKNOWN:
        return "the table does not say that its points are independent (independent = true)"
    if sample.size == 0:
        return "no run came back"
    if sample.size == 1:
        return "a single run has no scatter"
    return ""
