"""Unknowns from measurements as tables: values, what the data teach, and how well they fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import xarray as xr

from uqpen.archive.groups import group_names, read_group
from uqpen.core.labels import CALIBRATIONS, COMBINATION, RUNS, UNKNOWN
from uqpen.core.units import scale
from uqpen.results.digits import number_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import NOTHING, OutputTable, label_with_unit, shown_unit


def calibration_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the tables of each search for least squares of a model."""
    statistics = SourceStatistics(tree)
    for design in group_names(tree, CALIBRATIONS):
        found = statistics.of_runs(CALIBRATIONS, design)
        if "unknown_value" in found:
            runs = read_group(tree, RUNS, design)
            yield _unknowns_table(design, found, runs)
            yield _combinations_table(design, found)
            yield _fit_table(design, found)


def _unknowns_table(
    design: str, found: Mapping[str, xr.DataArray], runs: xr.Dataset
) -> OutputTable:
    columns = ["value", "profile", "standard error", "prior sd", "learnt"]
    table = OutputTable(f"{design}: unknowns", columns)
    names = found["unknown_value"][UNKNOWN].values.tolist()
    for place, name in enumerate(names):
        unit = shown_unit(runs[name].attrs)
        shown = scale(unit)
        error, prior = (float(found[key][place]) for key in ("standard_error", "prior_std"))
        differences = [float(shown.difference_from_si(np.array(each))) for each in (error, prior)]
        cells = [
            *(
                table.cell(found[key][place], shown.from_si)
                for key in ("unknown_value", "profile_value")
            ),
            *map(number_text, differences),
            f"{max(1 - error / prior, 0.0):.1%}" if np.isfinite(error) else NOTHING,
        ]
        table.rows.append((label_with_unit(name, unit), cells))
    return table


def _combinations_table(design: str, found: Mapping[str, xr.DataArray]) -> OutputTable:
    table = OutputTable(f"{design}: what the data teach", ["known to", "learnt"])
    table.columns[0] += table.note_mark("in standard deviations of the priors")
    # Its module loads the search, which an archive without one does not need.
    from uqpen.statistics.calibration import Combination

    weights, errors = found["combination_weight"], found["combination_error"]
    names = weights[UNKNOWN].values.tolist()
    for place in range(weights.sizes[COMBINATION]):
        each = Combination(weights.values[place], float(errors[place]))
        learnt = "yes" if each.standard_error < 1 else "no: no more than the prior says"
        table.rows.append((each.text(names), [number_text(each.standard_error), learnt]))
    return table


def _fit_table(design: str, found: Mapping[str, xr.DataArray]) -> OutputTable:
    table = OutputTable(f"{design}: fit", ["value"])
    for name, array in found.items():
        if not array.dims:
            title = str(array.attrs.get("long_name", name))
            value = float(array)
            table.rows.append((title, [number_text(value) if np.isfinite(value) else NOTHING]))
    return table
