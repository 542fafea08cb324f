"""Tables of the inputs of failed runs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.core.labels import INPUT, RUNS
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.digits import number_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import OutputTable, label_with_unit

__all__ = ["ASSOCIATIONS", "ENDS", "failure_tables"]

# Statistics of the inputs of failed runs: estimates, and the range of their values.
ASSOCIATIONS, ENDS = ("larger", "further_out"), ("lowest", "highest")
_COLUMNS = ("failed from", "to")
# The names of the estimates, and notes that say what they are.
_PROBABILITIES = {
    "P(larger)": "probability of superiority: the input is larger in a failed run than in a "
    "completed one; 0.5 without an association",
    "P(further out)": "the input is further from its median in a failed run than in a completed "
    "one; 0.5 without an association",
}


def failure_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield a table for each design of a model with failed runs.

    The inputs that are associated most with the failures come first.
    """
    statistics = SourceStatistics(tree)
    for design in group_names(tree, RUNS):
        failures, runs = statistics.failures(design), read_group(tree, RUNS, design)
        if not all(name in failures for name in (*ASSOCIATIONS, *ENDS)):
            continue
        table = OutputTable(f"{design}: inputs of failed runs", list(_COLUMNS))
        table.columns += [name + table.note_mark(note) for name, note in _PROBABILITIES.items()]
        measures = np.stack([failures[name].values[:, 0] for name in ASSOCIATIONS])
        strength = np.nan_to_num(np.abs(measures - 0.5)).max(axis=0)
        names = list(map(str, failures[ASSOCIATIONS[0]][INPUT].values))
        for position in np.argsort(-strength, kind="stable").tolist():
            name = names[position]
            unit = str(runs[name].attrs.get("display_units", DIMENSIONLESS))
            ends = scale(unit).from_si(np.array([failures[end][position] for end in ENDS]))
            chances = [table.cell(failures[each][position]) for each in ASSOCIATIONS]
            cells = [*(number_text(end) for end in ends), *chances]
            table.rows.append((label_with_unit(name, unit), cells))
        yield table
