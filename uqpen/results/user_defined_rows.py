"""Statistics that the catalogue does not know, shown from their own attributes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.units import DIMENSIONLESS, Scale
from uqpen.results.estimate_json import entries_json, estimate_json
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.statistic_entries import described_statistics, outside_catalogue
from uqpen.results.table import NOTHING, Conversion, OutputTable, identity, label_with_unit

__all__ = ["OutputUnit", "add_user_defined_rows", "user_defined_json"]


class OutputUnit(NamedTuple):
    """The unit of an output: of its values in an archive, and in a table."""

    si: str
    shown: Scale


def add_user_defined_rows(
    table: OutputTable, statistics: SourceStatistics, output: str, unit: OutputUnit
) -> None:
    """Add a row for each entry of the output's statistics that have no record."""
    described = {each.name for each in described_statistics(statistics, output)}
    cells: dict[tuple[str, str], dict[str, str]] = {}
    for source in table.columns:
        for name, array in outside_catalogue(statistics.statistics(source, output)).items():
            if name in described:
                continue
            title = str(array.attrs.get("long_name", name))
            convert, shown = _shown(array, unit, is_difference=statistics.is_difference)
            dims = array.dims[:-1]
            for place in np.ndindex(array.shape[:-1]):
                at = zip(dims, place, strict=True)
                entry = ", ".join(f"{dim}={array[dim].values.tolist()[i]}" for dim, i in at)
                label = label_with_unit(f"{title} ({entry})" if entry else title, shown)
                cell = table.cell(array[place], convert)
                cells.setdefault((name, label), {})[source] = cell
    for (_, label), by_source in cells.items():
        table.rows.append((label, [by_source.get(source, NOTHING) for source in table.columns]))


def user_defined_json(
    arrays: Mapping[str, xr.DataArray], *, field: Sequence[str] = ()
) -> dict[str, Any]:
    """Return the statistics that the catalogue does not know, each with its unit and its title.

    They are those of one source and output, by the coordinate along each of their dimensions.
    """
    return {
        name: entries_json(array, _described_json, field=field)
        for name, array in outside_catalogue(arrays).items()
    }


def _described_json(array: xr.DataArray) -> dict[str, Any]:
    described = {key: str(array.attrs.get(key, "")) for key in ("units", "long_name")}
    return {**estimate_json(array), **described}


def _shown(array: xr.DataArray, unit: OutputUnit, *, is_difference: bool) -> tuple[Conversion, str]:
    """Return the conversion of a statistic, and its unit where that is not the output's."""
    own, rule = (str(array.attrs.get(name, "")) for name in ("units", "unit_rule"))
    if own == unit.si and rule in ("value", "difference"):
        is_value = rule == "value" and not is_difference
        return unit.shown.from_si if is_value else unit.shown.difference_from_si, DIMENSIONLESS
    return identity, own or DIMENSIONLESS
