"""The inputs' shares in the variance of each output."""

from __future__ import annotations

from collections.abc import Iterator

import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.labels import SENSITIVITY
from uqpen.figures.archive_view import ArchiveView
from uqpen.figures.measures import MeasureSeries, measure_series, measures_panel
from uqpen.figures.panel import Panel
from uqpen.results.table import identity

__all__ = ["EFFECTS", "INDICES", "best_sources", "sensitivity_panels"]

INDICES = (
    ("first_order", "first order", "o"),
    ("total_order", "total order", "s"),
    ("shapley", "Shapley effect", "D"),
)
EFFECTS = (("mu_star", "mean |effect|", "o"), ("sigma", "sd of effects", "^"))


def sensitivity_panels(view: ArchiveView) -> Iterator[Panel]:
    """Each input's share of the variance, and its effects."""
    for output in view.numeric_outputs:
        if found := best_sources(view, measure_series(view, output, INDICES)):
            title = view.title(f"{output}: shares of its variance")
            yield measures_panel(view, title, "share of the variance", found, identity)
    for output in view.numeric_outputs:
        if found := measure_series(view, output, EFFECTS):
            title = view.title(f"{output}: elementary effects")
            convert = view.scale(output).difference_from_si
            yield measures_panel(view, title, _effect_unit_label(view, output), found, convert)


def _effect_unit_label(view: ArchiveView, output: str) -> str:
    return f"effect on {view.axis_label(output)}"


def best_sources(view: ArchiveView, found: list[MeasureSeries]) -> list[MeasureSeries]:
    """Without what plain samples tell, unless it is asked for or there is nothing else."""
    dedicated = [each for each in found if not view.is_sample_design(each.source)]
    if view.source is not None or dedicated or not found:
        return dedicated or found
    largest = max(
        found, key=lambda each: _run_count(read_group(view.tree, SENSITIVITY, each.source))
    )
    return [each for each in found if each.source == largest.source]


def _run_count(told: xr.Dataset) -> int:
    return int(told.attrs["runs"])
