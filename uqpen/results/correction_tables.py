"""Estimates of a surrogate that real runs have corrected, beside its own."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.core.labels import EQUIVALENT_RUNS, SURROGATE_ESTIMATE
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.digits import estimate_text, grouped_number
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.statistic_entries import COMPARED, labelled_entries
from uqpen.results.table import (
    NOTHING,
    Conversion,
    OutputTable,
    conversion,
    first_runs,
    label_with_unit,
)

__all__ = ["correction_tables", "equivalent_runs_text", "is_corrected"]

_PLAIN_RUNS = "the number of runs with as narrow an interval, without the surrogate"


def correction_tables(tree: xr.DataTree, surrogate: str) -> Iterator[OutputTable]:
    """Yield a table for each output whose estimates by a surrogate are corrected.

    Parameters
    ----------
    tree : DataTree
        The part of an archive on one model.
    surrogate : str
        Its name.
    """
    statistics, runs = SourceStatistics(tree), first_runs(tree)
    for output in statistics.scalar_outputs:
        unit = str(runs[output].attrs.get("display_units", DIMENSIONLESS))
        found = statistics.statistics(surrogate, output)
        table = OutputTable(f"{surrogate}: {label_with_unit(output, unit)}", [])
        plain = f"plain runs{table.note_mark(_PLAIN_RUNS)}"
        table.columns = ["corrected", "surrogate", plain]
        for statistic in COMPARED:
            array = found.get(statistic.name)
            if array is None or SURROGATE_ESTIMATE not in array.coords:
                continue
            convert = conversion(statistic, scale(unit))
            for label, entries in labelled_entries(statistic, {surrogate: array}):
                if not _has_number(entries[surrogate]):
                    continue
                table.rows.append((label, _cells(table, entries[surrogate], convert)))
        if table.rows:
            yield table


def _has_number(estimate: xr.DataArray) -> bool:
    """Return True unless there is neither a corrected estimate nor one of the surrogate."""
    alone = float(estimate.coords[SURROGATE_ESTIMATE])
    return math.isfinite(alone) or bool(np.isfinite(estimate.values).any())


def _cells(table: OutputTable, estimate: xr.DataArray, convert: Conversion) -> list[str]:
    alone = float(convert(float(estimate.coords[SURROGATE_ESTIMATE])))
    return [
        table.cell(estimate, convert),
        estimate_text(alone, math.nan, math.nan) if math.isfinite(alone) else NOTHING,
        equivalent_runs_text(estimate) or NOTHING,
    ]


def is_corrected(estimate: xr.DataArray | None) -> bool:
    """Return True for a single estimate by a surrogate with an interval from real runs."""
    return (
        estimate is not None
        and EQUIVALENT_RUNS in estimate.coords
        and bool(np.isfinite(estimate.values).all())
    )


def equivalent_runs_text(estimate: xr.DataArray) -> str:
    """Return how many plain runs have an interval as narrow, to two digits; empty if unknown."""
    runs = float(estimate.coords.get(EQUIVALENT_RUNS, math.nan))
    return grouped_number(int(float(f"{runs:.2g}"))) if math.isfinite(runs) else ""
