"""Notes that stand below several charts, in the same words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.figures.estimates import HOLLOW
from uqpen.figures.texts import capitalized
from uqpen.labels import INTERVAL_LEVEL
from uqpen.summary.digits import percent

__all__ = ["all_bounded", "bars_of", "has_interval", "hollow_of"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


def has_interval(bounds: FloatArray) -> BoolArray:
    """Whether an estimate has an interval, which may have one end alone.

    Parameters
    ----------
    bounds : ndarray of shape (..., bound)
        Estimate, lower, upper; NaN for a bound that is none.

    Returns
    -------
    ndarray of bool, shape (...)
    """
    return np.asarray(np.isfinite(bounds[..., 1:]).any(axis=-1))


def all_bounded(bounds: FloatArray) -> bool:
    """Whether each of some estimates has an interval; what is no estimate does not count.

    Parameters
    ----------
    bounds : ndarray of shape (..., bound)
    """
    return bool(has_interval(bounds)[np.isfinite(bounds[..., 0])].all())


def hollow_of(bounds: FloatArray) -> Iterator[str]:
    """A note on estimates without an interval, if there are any, for a chart that has a table.

    Parameters
    ----------
    bounds : ndarray of shape (..., bound)
    """
    if not all_bounded(bounds):
        yield f"{capitalized(HOLLOW)}; the table says why."


def bars_of(figures: Iterable[xr.DataArray], each: str = "") -> Iterator[str]:
    """A note for each level of the intervals that are drawn as bars.

    Parameters
    ----------
    figures : iterable of DataArray
        Along ``bound`` at the last; those without an interval do not count.
    each : str
        What else is said of the intervals, with all that stands before it.
    """
    levels = {
        float(figure.attrs[INTERVAL_LEVEL])
        for figure in figures
        if INTERVAL_LEVEL in figure.attrs and has_interval(figure.values).any()
    }
    yield from (f"Bars: {percent(level)} intervals{each}." for level in sorted(levels))
