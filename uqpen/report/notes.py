"""Notes that several charts have in common."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.figures.estimate_dots import HOLLOW
from uqpen.results.digits import percent_text
from uqpen.results.texts import capitalized

__all__ = ["all_bounded", "has_interval", "hollow_note", "interval_notes"]


def has_interval(bounds: FloatArray) -> BoolArray:
    """Return whether an estimate has an interval, which may have one end alone.

    Parameters
    ----------
    bounds : ndarray of shape (..., bound)
        Estimate, lower, upper; NaN for a bound that is none.
    """
    return np.asarray(np.isfinite(bounds[..., 1:]).any(axis=-1))


def all_bounded(bounds: FloatArray) -> bool:
    """Return whether each estimate has an interval; a missing estimate does not count."""
    return bool(has_interval(bounds)[np.isfinite(bounds[..., 0])].all())


def hollow_note(bounds: FloatArray) -> Iterator[str]:
    """A note on estimates without an interval, if there are any, for a chart that has a table."""
    if not all_bounded(bounds):
        yield f"{capitalized(HOLLOW)}; the table gives the reason."


def interval_notes(estimates: Iterable[xr.DataArray], each: str = "") -> Iterator[str]:
    """Yield a note for each level of the intervals drawn as bars, followed by a text."""
    levels = {
        float(estimate.attrs[INTERVAL_LEVEL])
        for estimate in estimates
        if INTERVAL_LEVEL in estimate.attrs and has_interval(estimate.values).any()
    }
    yield from (f"Bars: {percent_text(level)} intervals{each}." for level in sorted(levels))
