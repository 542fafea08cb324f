"""Table of the probabilities of events of several outputs."""

from __future__ import annotations

from collections.abc import Iterator

import xarray as xr

from uqpen.archive.read import group_names
from uqpen.core.labels import JOINT_GROUP
from uqpen.results.acceptance import Acceptance
from uqpen.results.source_statistics import SourceStatistics, source_entries
from uqpen.results.table import NOTHING, OutputTable

__all__ = ["joint_tables"]


def joint_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the table of a model's joint probabilities, if the study asks for any.

    An event has a row, with its condition in a note, and a row of verdicts where the study has
    acceptance limits.
    """
    statistics = SourceStatistics(tree)
    found = {name: statistics.joint_probability(name) for name in group_names(tree, JOINT_GROUP)}
    arrays = {name: array for name, array in found.items() if array is not None}
    if not arrays:
        return
    table = OutputTable("joint probabilities", list(arrays))
    for event, entries in source_entries(arrays, "event"):
        first = next(iter(entries.values()))
        condition = str(first["event_condition"].values)
        table.rows.append((f"P({event}){table.note_mark(condition)}", table.cells(entries)))
        verdicts = {name: Acceptance.from_array(each) for name, each in entries.items()}
        if accepted := next(filter(None, verdicts.values()), None):
            cells = [str(each.verdict) if each else NOTHING for each in verdicts.values()]
            table.rows.append((f"accepted: {accepted}", cells))
    yield table
