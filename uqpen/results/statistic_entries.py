"""The single numbers among the statistics of an output, each under its label in a table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

import xarray as xr

from uqpen.core.statistic_dimensions import (
    LOWER_THRESHOLD,
    PROBABILITY,
    RETURN_PERIOD,
    SHORTFALL_LEVEL,
    THRESHOLD,
)
from uqpen.results.source_statistics import source_entries
from uqpen.results.table import (
    below_label,
    exceedance_label,
    quantile_label,
    return_level_label,
    shortfall_label,
)

__all__ = ["NUMBERS", "entry_label", "labelled_entries"]

# Statistics of one number each, and their labels.
_SINGLE = {"mean": "mean", "std": "sd"}
# Those of several: the coordinate that names an entry, and the label of the entry.
_SEVERAL: Mapping[str, tuple[str, Callable[[Any], str]]] = MappingProxyType(
    {
        "quantile": (PROBABILITY, quantile_label),
        "expected_shortfall": (SHORTFALL_LEVEL, shortfall_label),
        "return_level": (RETURN_PERIOD, return_level_label),
        "exceedance": (THRESHOLD, exceedance_label),
        "below": (LOWER_THRESHOLD, below_label),
        "share": ("category_label", "share {}".format),
    }
)

NUMBERS = (*_SINGLE, *_SEVERAL)


def entry_label(statistic: str, entry: Any) -> str | None:
    """Return the label of an entry of one of `NUMBERS` with several; None of another statistic."""
    return _SEVERAL[statistic][1](entry) if statistic in _SEVERAL else None


def labelled_entries(
    statistic: str, arrays: dict[str, xr.DataArray]
) -> Iterator[tuple[str, dict[str, xr.DataArray]]]:
    """Yield the entries of one of `NUMBERS` with their labels.

    Parameters
    ----------
    statistic : str
    arrays : dict of str to DataArray
        Estimate arrays by source.

    Yields
    ------
    label : str
    estimates : dict of str to DataArray
        By source, along ``bound`` alone.
    """
    if statistic in _SINGLE:
        yield _SINGLE[statistic], arrays
        return
    coordinate, label = _SEVERAL[statistic]
    for entry, found in source_entries(arrays, coordinate):
        yield label(entry), found
