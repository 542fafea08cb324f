"""The inputs' shares in the variance of each output."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.core.labels import RUN
from uqpen.figures.measures import MeasureSeries, measure_series, measures_panel
from uqpen.figures.panel import Panel
from uqpen.results import measure_labels as measures
from uqpen.results.archive_view import ArchiveView
from uqpen.results.best_sources import best_sources as best_source_names
from uqpen.results.table import identity

__all__ = ["EFFECTS", "INDICES", "best_sources", "sensitivity_panels"]

_MARKERS = {"first_order": "o", "total_order": "s", "shapley": "D", "mu_star": "o", "sigma": "^"}

# Name, label and marker.
INDICES = tuple((each.statistic, each.label, _MARKERS[each.statistic]) for each in measures.INDICES)
EFFECTS = tuple(
    (each.statistic, each.label, _MARKERS[each.statistic])
    for each in measures.EFFECTS
    if each.statistic in _MARKERS
)


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
    """Leave plain samples out, unless one is asked for or there is nothing else."""
    runs = {
        each.source: view.runs(each.source).sizes[RUN] if view.is_sample_design(each.source) else 0
        for each in found
    }
    if view.source is not None and all(map(view.is_sample_design, runs)):
        return found
    shown = best_source_names(view.tree, runs)
    return [each for each in found if each.source in shown]
