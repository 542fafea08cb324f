"""Probabilities of events of several outputs: their disagreements, their tables, their JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.catalogue import MEASURES
from uqpen.core.labels import DESIGN_POINT, INPUT, JOINT_GROUP, SENSITIVITY_EVENT
from uqpen.results.acceptance import acceptance_json, add_verdicts
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import OutputTable, entries_json, estimate_json


class Disagreement(NamedTuple):
    """Two designs whose estimates of a probability are not compatible."""

    condition: str  # the event
    first: str  # name of a design that has an interval
    second: str  # name of the other design
    # True if two intervals are disjoint, False if a value lies outside an interval.
    second_has_interval: bool

    def __str__(self) -> str:
        if self.second_has_interval:
            return (
                f"{self.first} and {self.second} disagree: their intervals do not overlap, which "
                "chance hardly explains. One of them may have missed a part of the event, "
                "and no mean of them is right"
            )
        return f"the value of {self.second} lies outside the interval of {self.first}"


def disagreements(arrays: Mapping[str, xr.DataArray]) -> Iterator[Disagreement]:
    """Yield the disagreements on each event between designs that have its probability.

    `arrays` are the joint probabilities of each design, along ``event`` and ``bound``.
    """
    for condition, entries in _by_design(arrays, "event_condition").items():
        for pair in combinations(entries.items(), 2):
            # One with an interval comes first.
            (first, one), (second, other) = sorted(pair, key=lambda each: not _is_known(each[1]))
            if _is_known(one) and _are_disjoint(one, other):
                yield Disagreement(condition, first, second, _is_known(other))


def _by_design(
    arrays: Mapping[str, xr.DataArray], coordinate: str
) -> dict[str, dict[str, xr.DataArray]]:
    """Return the estimates of each event by design: a design for a rare event has its own."""
    found: dict[str, dict[str, xr.DataArray]] = {}
    for design, array in arrays.items():
        for entry in array:
            found.setdefault(str(entry[coordinate].item()), {})[design] = entry
    return found


def _is_known(estimate: xr.DataArray) -> bool:
    """Return True if an estimate has an interval."""
    return bool(np.isfinite(estimate.values).all())


def _are_disjoint(one: xr.DataArray, other: xr.DataArray) -> bool:
    """Return True if an interval contains nothing of another, or not the value that has none."""
    _, lower, upper = one.values
    value, low, high = other.values
    if not _is_known(other):
        low = high = value
    return bool(high < lower or upper < low)


def joint_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the table of a model's joint probabilities, if the study requests any.

    An event has a row over all designs that know it, with its condition in a note, and a row of
    verdicts where the study has acceptance limits. A note says which designs disagree.
    Sensitivities and design points follow in tables of their own.
    """
    statistics = SourceStatistics(tree)
    arrays = statistics.joint_probabilities()
    if not arrays:
        return
    table, name = OutputTable("joint probabilities", list(arrays)), "fitted_joint_probability"
    found = {design: statistics.joint_statistics(design).get(name) for design in arrays}
    fitted = {design: array for design, array in found.items() if array is not None}
    for event, entries in _by_design(arrays, "event").items():
        condition = str(next(iter(entries.values()))["event_condition"].values)
        notes = [condition] if condition != event else []
        notes += [str(each) for each in disagreements(arrays) if each.condition == condition]
        table.rows.append((f"P({event}){table.note_mark(*notes)}", table.cells(entries)))
        add_verdicts(table, entries)
        over = {
            design: array.sel(event=event)
            for design, array in fitted.items()
            if event in array["event"].values
        }
        if over:
            table.rows.append((f"P({event}), over parameters", table.cells(over)))
    yield table
    sensitivities: dict[str, dict[str, dict[str, xr.DataArray]]] = {}
    for design in arrays:
        for event, measures in _sensitivities(statistics.joint_statistics(design)).items():
            sensitivities.setdefault(event, {})[design] = measures
    for event, of_designs in sensitivities.items():
        for design, measures in of_designs.items():
            yield _sensitivity_table(event, design, measures)
    for design in arrays:
        yield from _design_point_table(design, statistics.joint_statistics(design))


def _sensitivities(
    statistics: Mapping[str, xr.DataArray],
) -> dict[str, dict[str, xr.DataArray]]:
    """Return, for each event of a design that has some, its measures along the inputs."""
    found: dict[str, dict[str, xr.DataArray]] = {}
    for name, array in statistics.items():
        for entry in array if SENSITIVITY_EVENT in array.dims else ():
            found.setdefault(str(entry[SENSITIVITY_EVENT].item()), {})[name] = entry
    return found


def _sensitivity_table(event: str, design: str, entries: Mapping[str, xr.DataArray]) -> OutputTable:
    chosen = [each for each in MEASURES["event"] if each.name in entries]
    title = f"P({event}): changes with the inputs' mean and sd, {design}"
    table = OutputTable(title, [each.measure.label for each in chosen])
    for position, name in enumerate(entries[chosen[0].name][INPUT].values.tolist()):
        cells = [table.cell(entries[each.name][position]) for each in chosen]
        table.rows.append((str(name), cells))
    return table


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


def joint_json(statistics: SourceStatistics, design: str) -> dict[str, Any]:
    """Return the probabilities of a design's events; empty where a study requests none."""
    arrays = statistics.joint_probabilities()
    if design not in arrays:
        return {}
    entries = entries_json(arrays[design])
    for entry, array in zip(entries.values(), arrays[design], strict=True):
        entry |= acceptance_json(array)
        entry["condition"] = str(array["event_condition"].values)
        pairs = (
            {each.first, each.second}
            for each in disagreements(arrays)
            if each.condition == entry["condition"]
        )
        if others := sorted(name for pair in pairs if design in pair for name in pair - {design}):
            entry["disagrees_with"] = others
    of_design = statistics.joint_statistics(design)
    if (fitted := of_design.get("fitted_joint_probability")) is not None:
        for entry, array in zip(entries.values(), fitted, strict=True):
            entry["fitted"] = estimate_json(array)
    for event, measures in _sensitivities(of_design).items():
        found = {name: entries_json(array) for name, array in measures.items()}
        entries[event]["sensitivities"] = found
    if "reliability_index" in of_design:
        runs = of_design["reliability_index"][f"{DESIGN_POINT}_run"].values
        points: list[dict[str, Any]] = [{"run": int(run)} for run in runs]
        for name, array in of_design.items():
            of_points = array if DESIGN_POINT in array.dims else ()
            for point, entry in zip(points, of_points, strict=False):
                of_inputs = INPUT in entry.dims
                point[name] = entries_json(entry) if of_inputs else estimate_json(entry)
        next(iter(entries.values()))["design_points"] = points
    return {JOINT_GROUP: entries}
