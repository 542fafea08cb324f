"""The single numbers among the statistics of an output, each under its label in a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import xarray as xr

from uqpen.core.catalogue import CATALOGUE
from uqpen.core.statistic import Statistic
from uqpen.results.source_statistics import source_entries
from uqpen.results.table import entry_label

__all__ = ["COMPARED", "SHOWN", "THRESHOLD_PROBABILITIES", "labelled_entries"]

# The statistics that tables show, in the order of their rows.
SHOWN = sorted(
    (each for each in CATALOGUE.values() if each.shown.label), key=lambda each: each.shown.row
)

# Those by which sources, models and archives are compared, in the order of the catalogue.
COMPARED = [each for each in CATALOGUE.values() if each.shown.is_compared]

# Probabilities of lying beyond a value that the study asks for.
THRESHOLD_PROBABILITIES = [each for each in COMPARED if each.shown.has_verdict]


def labelled_entries(
    statistic: Statistic, arrays: Mapping[str, xr.DataArray]
) -> Iterator[tuple[str, dict[str, xr.DataArray]]]:
    """Yield the entries of a statistic that tables show, with their labels.

    Parameters
    ----------
    statistic : Statistic
    arrays : dict of str to DataArray
        Estimate arrays by source.

    Yields
    ------
    label : str
    estimates : dict of str to DataArray
        By source, along ``bound`` alone.
    """
    if not statistic.dims:
        yield entry_label(statistic, ""), dict(arrays)
        return
    coordinate = statistic.shown.coordinate or statistic.dims[0]
    for entry, found in source_entries(arrays, coordinate):
        yield entry_label(statistic, entry), found
