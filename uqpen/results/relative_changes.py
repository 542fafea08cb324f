"""Relative changes of what is shown in a unit whose zero is arbitrary: they have no meaning."""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqpen.core.labels import INPUT, INTERVAL, INTERVAL_LABEL, NOTE
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.table import first_runs

__all__ = ["arbitrary_zero", "without_arbitrary_zeros"]

# Statistics that are relative to the output, and those among them that are relative to the input.
_OF_OUTPUT = ("response", "contribution")
_OF_INPUT = ("response",)

_REASON = "no per cent, as the zero of {unit} is arbitrary"


def arbitrary_zero(tree: xr.DataTree, name: str) -> str:
    """Return the unit that an input or output is shown in if it has an offset, as degC; or empty.

    Parameters
    ----------
    tree : DataTree
        The part of an archive on one model.
    name : str
        The input's or the output's.
    """
    runs = first_runs(tree)
    unit = str(runs[name].attrs.get("display_units", DIMENSIONLESS)) if name in runs else "1"
    return unit if scale(unit).offset else ""


def without_arbitrary_zeros(
    tree: xr.DataTree, output: str, statistic: str, array: xr.DataArray
) -> xr.DataArray:
    """Return a statistic without relative changes of a quantity in a unit with an offset.

    An archive has them relative to the SI value. Per cent of the kelvin say nothing of a
    temperature in degC. Other statistics are returned as they are.

    Parameters
    ----------
    tree : DataTree
        The part of an archive on one model.
    output, statistic : str
        Their names.
    array : DataArray
        Along ``input`` and ``bound``.

    Returns
    -------
    DataArray
        NaN, with the reason as a note, for each entry that is left out.
    """
    if statistic not in _OF_OUTPUT:
        return array
    names = list(map(str, array[INPUT].values))
    reasons = [_reason(tree, output, name if statistic in _OF_INPUT else "") for name in names]
    is_left_out = np.array([bool(reason) for reason in reasons])
    if not is_left_out.any():
        return array
    kept = array.where(xr.DataArray(~is_left_out, dims=INPUT))
    texts = {INTERVAL: "none", INTERVAL_LABEL: "none"}
    replaced = {
        key: (INPUT, np.where(is_left_out, texts.get(key, reasons), array[key].values))
        for key in (INTERVAL, INTERVAL_LABEL, NOTE)
    }
    return kept.assign_coords(replaced).assign_attrs(array.attrs)


def _reason(tree: xr.DataTree, output: str, entry: str) -> str:
    for name in filter(None, (output, entry)):
        if unit := arbitrary_zero(tree, name):
            return _REASON.format(unit=unit)
    return ""
