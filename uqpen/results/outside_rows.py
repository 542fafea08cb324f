"""Statistics that the catalogue does not know, shown from their own attributes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import BOUND, RANK
from uqpen.core.units import DIMENSIONLESS, Scale
from uqpen.results.estimate_json import estimate_json
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import NOTHING, Conversion, OutputTable, identity

__all__ = ["OutputUnit", "add_outside_rows", "outside_json"]


class OutputUnit(NamedTuple):
    """The unit of an output.

    Attributes
    ----------
    si : str
        Of its values in an archive.
    shown : Scale
        Of its values in a table.
    """

    si: str
    shown: Scale


class _Row(NamedTuple):
    """An entry of a statistic."""

    statistic: str
    label: str
    estimate: xr.DataArray
    convert: Conversion


def add_outside_rows(
    table: OutputTable, statistics: SourceStatistics, output: str, unit: OutputUnit
) -> None:
    """Add a row for each entry of the statistics that the catalogue does not know.

    Parameters
    ----------
    table : OutputTable
        Of the output, a column for each source.
    statistics : SourceStatistics
        Of the model.
    output : str
        The output's name.
    unit : OutputUnit
        The output's unit.
    """
    cells: dict[tuple[str, str], dict[str, str]] = {}
    for source in table.columns:
        for row in _rows(statistics, source, output, unit):
            of_row = cells.setdefault((row.statistic, row.label), {})
            of_row[source] = table.cell(row.estimate, row.convert)
    for (_, label), by_source in cells.items():
        table.rows.append((label, [by_source.get(source, NOTHING) for source in table.columns]))


def outside_json(arrays: Mapping[str, xr.DataArray]) -> dict[str, Any]:
    """Return the statistics that the catalogue does not know, each with its unit and its title.

    Parameters
    ----------
    arrays : mapping of str to DataArray
        What a source has of an output.

    Returns
    -------
    dict
        By statistic; of one with dimensions, by the coordinate along each of them.
    """
    return {name: _entries_json(array) for name, array in _outside(arrays).items()}


def _outside(arrays: Mapping[str, xr.DataArray]) -> dict[str, xr.DataArray]:
    """Return the estimates that are not in the catalogue; distribution functions are too long."""
    return {
        name: array
        for name, array in arrays.items()
        if name not in CATALOGUE and BOUND in array.dims and RANK not in array.dims
    }


def _rows(
    statistics: SourceStatistics, source: str, output: str, unit: OutputUnit
) -> Iterator[_Row]:
    """Yield the entries that a source has of an output."""
    for name, array in _outside(statistics.statistics(source, output)).items():
        title = str(array.attrs.get("long_name", name))
        convert, unit_text = _shown(array, unit, is_difference=statistics.is_difference)
        dims = [str(dim) for dim in array.dims if dim != BOUND]
        for place in np.ndindex(*(array.sizes[dim] for dim in dims)):
            at = zip(dims, place, strict=True)
            entry = ", ".join(f"{dim}={array[dim].values.tolist()[i]}" for dim, i in at)
            label = f"{title} ({entry})" if entry else title
            yield _Row(name, label + unit_text, array[place], convert)


def _shown(array: xr.DataArray, unit: OutputUnit, *, is_difference: bool) -> tuple[Conversion, str]:
    """Return how a statistic is converted, and its unit where that is not the output's."""
    own, rule = (str(array.attrs.get(name, "")) for name in ("units", "unit_rule"))
    if own == unit.si and rule in ("value", "difference"):
        is_value = rule == "value" and not is_difference
        return unit.shown.from_si if is_value else unit.shown.difference_from_si, ""
    return identity, "" if own in ("", DIMENSIONLESS) else f" [{own}]"


def _entries_json(array: xr.DataArray) -> dict[str, Any]:
    """Return the entries of a statistic, by coordinate where it has any."""
    if array.dims == (BOUND,):
        described = {key: str(array.attrs.get(key, "")) for key in ("units", "long_name")}
        return {**estimate_json(array), **described}
    labels = array[array.dims[0]].values.tolist()
    return {str(label): _entries_json(array[place]) for place, label in enumerate(labels)}
