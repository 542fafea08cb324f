"""Where among the inputs runs were lost, as tables."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.core.labels import INPUT, RUNS
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.table import OutputTable, identity
from uqpen.statistics.failure_analysis import FAILURES

__all__ = ["failure_tables"]

_ENDS, _ASSOCIATIONS = ("lowest", "highest"), ("larger", "further_out")
_COLUMNS = ("lost from", "to", "P(larger)", "P(further out)")


def failure_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """For each design that lost runs, its inputs, those first that go with the losses most.

    Parameters
    ----------
    tree : DataTree
        What is told of one model.
    """
    for design in group_names(tree, FAILURES):
        associations, runs = read_group(tree, FAILURES, design), read_group(tree, RUNS, design)
        table = OutputTable(f"{design}: where the lost runs lie", list(_COLUMNS))
        measures = np.stack([associations[name].values[:, 0] for name in _ASSOCIATIONS])
        strength = np.nan_to_num(np.abs(measures - 0.5)).max(axis=0)
        for position in np.argsort(-strength, kind="stable").tolist():
            name = str(associations[INPUT].values[position])
            unit = str(runs[name].attrs.get("display_units", DIMENSIONLESS))
            ends = scale(unit).from_si(np.array([associations[end][position] for end in _ENDS]))
            label = name if unit == DIMENSIONLESS else f"{name} [{unit}]"
            chances = [table.cell(associations[each][position], identity) for each in _ASSOCIATIONS]
            table.rows.append((label, [*(f"{end:.4g}" for end in ends), *chances]))
        yield table
