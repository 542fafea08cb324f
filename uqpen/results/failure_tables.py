"""Tables of where the failed runs lie among the inputs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.core.labels import INPUT, RUNS
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import OutputTable, identity

__all__ = ["failure_tables"]

_ENDS, _ASSOCIATIONS = ("lowest", "highest"), ("larger", "further_out")
_COLUMNS = ("lost from", "to", "P(larger)", "P(further out)")


def failure_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield a table of inputs for each design with failed runs.

    The inputs that are associated most with the failures come first.

    Parameters
    ----------
    tree : DataTree
        The part of an archive on one model.
    """
    statistics = SourceStatistics(tree)
    for design in group_names(tree, RUNS):
        associations, runs = statistics.failures(design), read_group(tree, RUNS, design)
        if not all(name in associations for name in (*_ASSOCIATIONS, *_ENDS)):
            continue
        table = OutputTable(f"{design}: where the lost runs lie", list(_COLUMNS))
        measures = np.stack([associations[name].values[:, 0] for name in _ASSOCIATIONS])
        names = list(map(str, associations[_ASSOCIATIONS[0]][INPUT].values))
        strength = np.nan_to_num(np.abs(measures - 0.5)).max(axis=0)
        for position in np.argsort(-strength, kind="stable").tolist():
            name = names[position]
            unit = str(runs[name].attrs.get("display_units", DIMENSIONLESS))
            ends = scale(unit).from_si(np.array([associations[end][position] for end in _ENDS]))
            label = name if unit == DIMENSIONLESS else f"{name} [{unit}]"
            chances = [table.cell(associations[each][position], identity) for each in _ASSOCIATIONS]
            table.rows.append((label, [*(f"{end:.4g}" for end in ends), *chances]))
        yield table
