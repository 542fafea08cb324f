"""Where among the inputs runs were lost, as tables."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.analyses.where_lost import LOSSES
from uqpen.archive.read import group, names_in
from uqpen.labels import INPUT, RUNS
from uqpen.summary.table import OutputTable, unchanged
from uqpen.units import DIMENSIONLESS, scale

__all__ = ["loss_tables"]

_ENDS, _CHANCES = ("lowest", "highest"), ("larger", "further_out")
_COLUMNS = ("lost from", "to", "P(larger)", "P(further out)")


def loss_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """For each design that lost runs, its inputs, those first that go with the losses most.

    Parameters
    ----------
    tree : DataTree
        What is told of one model.
    """
    for design in names_in(tree, LOSSES):
        told, runs = group(tree, LOSSES, design), group(tree, RUNS, design)
        table = OutputTable(f"{design}: where the lost runs lie", list(_COLUMNS))
        measures = np.stack([told[name].values[:, 0] for name in _CHANCES])
        strength = np.nan_to_num(np.abs(measures - 0.5)).max(axis=0)
        for position in np.argsort(-strength, kind="stable").tolist():
            name = str(told[INPUT].values[position])
            unit = str(runs[name].attrs.get("display_units", DIMENSIONLESS))
            ends = scale(unit).from_si(np.array([told[end][position] for end in _ENDS]))
            label = name if unit == DIMENSIONLESS else f"{name} [{unit}]"
            chances = [table.cell(told[each][position], unchanged) for each in _CHANCES]
            table.rows.append((label, [*(f"{end:.4g}" for end in ends), *chances]))
        yield table
