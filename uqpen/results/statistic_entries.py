"""The single numbers among the statistics of an output, each under its label in a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.catalogue import CATALOGUE
from uqpen.core.statistic import RECORD, RECORD_NUMBERS, RECORD_WORDS, Shown, Statistic, UnitRule
from uqpen.results.source_statistics import SourceStatistics, source_entries, user_defined
from uqpen.results.table import entry_label
from uqpen.results.texts import plain_text

__all__ = [
    "COMPARED",
    "SHOWN",
    "THRESHOLD_PROBABILITIES",
    "described_statistics",
    "labelled_entries",
]

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
    if statistic.name not in CATALOGUE:
        by_label: dict[str, dict[str, xr.DataArray]] = {}
        for source, array in arrays.items():
            for entry, each in zip(array[statistic.dims[0]].values.tolist(), array, strict=True):
                by_label.setdefault(entry_label(statistic, entry), {})[source] = each
        yield from by_label.items()
        return
    coordinate = statistic.shown.coordinate or statistic.dims[0]
    for entry, found in source_entries(arrays, coordinate):
        yield entry_label(statistic, entry), found


def described_statistics(statistics: SourceStatistics, output: str) -> list[Statistic]:
    """Return the records of an output's user-defined statistics, as their attributes have them."""
    found: dict[str, Statistic] = {}
    for source in statistics.sources:
        for name, array in user_defined(statistics.statistics(source, output)).items():
            if name not in found and (record := _described(name, array)):
                own = "1" if record.unit is UnitRule.NONE else statistics.si_unit(output)
                if array.attrs.get("units") == own:
                    found[name] = record
    return list(found.values())


def _described(name: str, array: xr.DataArray) -> Statistic | None:
    """Return the record of a statistic from its attributes; None where these have none.

    The words of an archive are a stranger's: plain text without any meaning of their own.
    """
    attributes = array.attrs
    found: dict[str, Any] = {
        field: plain_text(str(attributes[RECORD + field]), 300)
        for field in RECORD_WORDS
        if RECORD + field in attributes
    }
    for field in RECORD_NUMBERS:
        if isinstance(number := attributes.get(RECORD + field), int | float | np.number):
            found[field] = int(np.nan_to_num(np.clip(number, -999, 999)))
    rule = str(attributes.get("unit_rule", "none")).upper()
    if not found.get("label") or array.ndim > 2 or rule not in UnitRule.__members__:
        return None
    title = plain_text(str(attributes.get("long_name", name)), 100)
    shown = replace(Shown(row=999), **found)
    return Statistic(name, title, tuple(map(str, array.dims[:-1])), UnitRule[rule], shown=shown)
