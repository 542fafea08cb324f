"""Shares of the variance over several models: of model form and of inputs; tables and JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import xarray as xr

from uqpen.core.catalogue import MODEL_FORM_STATISTICS
from uqpen.core.labels import MODEL_FORM, MODELS
from uqpen.core.statistic_dimensions import THRESHOLD
from uqpen.results.estimate_json import entries_json
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import OutputTable, exceedance_label

__all__ = ["model_form_json", "model_form_tables"]

_COLUMNS = {
    "model_form_share": "model form",
    "parameter_share": "inputs",
    "interaction_share": "both together",
}
_OF_EVENTS = "exceedance_"
_NOTE = (
    "models of equal weight, which are no sample of all models: the share of model form is of these"
)


def model_form_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the shares of each output's variance over all models, for each design.

    The first row is of the output itself, the others of its exceeding the study's thresholds.
    """
    statistics = SourceStatistics.of_model_form(tree)
    count = len(tree.children[MODELS].children) if MODELS in tree.children else 0
    for design in statistics.sources:
        for output in statistics.outputs:
            found = statistics.statistics(design, output)
            if _OF_VALUE[0] in found:
                title = f"{output} by {count} models: shares of its variance, {design}"
                yield _table(title, dict(found.items()))


_OF_VALUE = tuple(_COLUMNS)


def _table(title: str, found: dict[str, xr.DataArray]) -> OutputTable:
    table = OutputTable(title, list(_COLUMNS.values()))
    mark = table.note_mark(_NOTE)
    table.rows.append((f"value{mark}", [table.cell(found[name]) for name in _COLUMNS]))
    events = {
        name: found[f"{_OF_EVENTS}{name}"] for name in _COLUMNS if f"{_OF_EVENTS}{name}" in found
    }
    if events:
        thresholds = next(iter(events.values()))[THRESHOLD].values.tolist()
        for place, threshold in enumerate(thresholds):
            cells = [table.cell(array[{THRESHOLD: place}]) for array in events.values()]
            table.rows.append((exceedance_label(str(threshold)), cells))
    return table


def model_form_json(tree: xr.DataTree) -> dict[str, Any]:
    """Return the shares by design and output; empty where an archive has none."""
    statistics = SourceStatistics.of_model_form(tree)
    found: dict[str, Any] = {}
    for design in statistics.sources:
        for output in statistics.outputs:
            arrays = statistics.statistics(design, output)
            if shares := {
                name: entries_json(arrays[name]) for name in MODEL_FORM_STATISTICS if name in arrays
            }:
                found.setdefault(design, {})[output] = shares
    return {MODEL_FORM: found} if found else {}
