"""Shares of the variance over several models: of model form and of inputs; tables and JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import xarray as xr

from uqpen.core.catalogue import MODEL_FORM_STATISTICS
from uqpen.core.labels import MODEL_FORM, MODELS, OF_EXCEEDANCE
from uqpen.core.statistic_dimensions import THRESHOLD
from uqpen.results.estimate_json import entries_json
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import OutputTable, exceedance_label

__all__ = ["model_form_json", "model_form_tables"]

_SHARES = [each for each in MODEL_FORM_STATISTICS.values() if not each.of]
_OF_EVENTS = [each.name for each in MODEL_FORM_STATISTICS.values() if each.prefix == OF_EXCEEDANCE]
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
            if _SHARES[0].name in found:
                title = f"{output} by {count} models: shares of its variance, {design}"
                yield _table(title, dict(found.items()))


def _table(title: str, found: dict[str, xr.DataArray]) -> OutputTable:
    table = OutputTable(title, [each.shown.label for each in _SHARES])
    mark = table.note_mark(_NOTE)
    table.rows.append((f"value{mark}", [table.cell(found[each.name]) for each in _SHARES]))
    if events := [found[name] for name in _OF_EVENTS if name in found]:
        for place, threshold in enumerate(events[0][THRESHOLD].values.tolist()):
            cells = [table.cell(array[{THRESHOLD: place}]) for array in events]
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
