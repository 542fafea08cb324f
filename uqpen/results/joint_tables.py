"""Table of the probabilities of events of several outputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import xarray as xr

from uqpen.archive.read import group_names
from uqpen.core.catalogue import MEASURES
from uqpen.core.labels import INPUT, JOINT_GROUP
from uqpen.core.statistic_dimensions import DESIGN_POINT, SENSITIVITY_EVENT
from uqpen.results.acceptance import Acceptance
from uqpen.results.disagreements import disagreements
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import NOTHING, OutputTable

__all__ = ["joint_tables"]


def joint_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the table of a model's joint probabilities, if the study requests any.

    An event has a row over all designs that know it, with its condition in a note, and a row of
    verdicts where the study has acceptance limits. A note says which designs disagree.
    Sensitivities and design points follow in tables of their own.
    """
    statistics = SourceStatistics(tree)
    found = {name: statistics.joint_probability(name) for name in group_names(tree, JOINT_GROUP)}
    arrays = {name: array for name, array in found.items() if array is not None}
    if not arrays:
        return
    table = OutputTable("joint probabilities", list(arrays))
    for event, entries in _events(arrays):
        first = next(iter(entries.values()))
        condition = str(first["event_condition"].values)
        mark = "" if condition == event else table.note_mark(condition)
        for each in disagreements(arrays):
            if each.condition == condition:
                mark += table.note_mark(str(each))
        table.rows.append((f"P({event}){mark}", table.cells(entries)))
        verdicts = {name: Acceptance.from_array(each) for name, each in entries.items()}
        if accepted := next(filter(None, verdicts.values()), None):
            shown = (verdicts.get(name) for name in arrays)
            cells = [str(each.verdict) if each else NOTHING for each in shown]
            table.rows.append((f"accepted: {accepted}", cells))
    yield table
    yield from _sensitivity_tables(statistics, list(arrays))
    for design in arrays:
        yield from _design_point_table(design, statistics.joint_statistics(design))


def _design_point_table(
    design: str, statistics: Mapping[str, xr.DataArray]
) -> Iterator[OutputTable]:
    """Yield the table of the design points that a design has found, if there are any."""
    known = [each for each in MEASURES["design points"] if each.name in statistics]
    if not known:
        return
    indices = statistics[known[0].name]
    runs = indices[f"{DESIGN_POINT}_run"].values.tolist()
    numbers = indices[DESIGN_POINT].values.tolist()
    columns = [f"point {number}, run {run}" for number, run in zip(numbers, runs, strict=True)]
    table = OutputTable(f"{design}: design points", columns)
    for each in known:
        array, label = statistics[each.name], each.measure.label
        if INPUT not in each.dims:
            table.rows.append((label, [table.cell(entry) for entry in array]))
            continue
        for position, name in enumerate(array[INPUT].values.tolist()):
            cells = [table.cell(entry[position]) for entry in array]
            table.rows.append((f"{label} of {name}", cells))
    yield table


def _sensitivity_tables(
    statistics: SourceStatistics, designs: Sequence[str]
) -> Iterator[OutputTable]:
    """Yield, for each event that has sensitivities, a table by input for each design."""
    found: dict[str, dict[str, dict[str, xr.DataArray]]] = {}
    for design in designs:
        for name, array in statistics.joint_statistics(design).items():
            for entry in array if SENSITIVITY_EVENT in array.dims else ():
                event = str(entry[SENSITIVITY_EVENT].item())
                found.setdefault(event, {}).setdefault(design, {})[name] = entry
    for event, of_designs in found.items():
        for design, entries in of_designs.items():
            chosen = [each for each in MEASURES["event"] if each.name in entries]
            title = f"P({event}): changes with the inputs' mean and sd, {design}"
            table = OutputTable(title, [each.measure.label for each in chosen])
            inputs = entries[chosen[0].name][INPUT].values.tolist()
            for position, name in enumerate(inputs):
                cells = [table.cell(entries[each.name][position]) for each in chosen]
                table.rows.append((str(name), cells))
            yield table


def _events(
    arrays: Mapping[str, xr.DataArray],
) -> Iterator[tuple[str, dict[str, xr.DataArray]]]:
    """Yield each event with its estimates by design: a design for a rare event has its own."""
    entries: dict[str, dict[str, xr.DataArray]] = {}
    for design, array in arrays.items():
        for entry in array:
            entries.setdefault(str(entry["event"].item()), {})[design] = entry
    yield from entries.items()
