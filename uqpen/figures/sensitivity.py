"""The inputs' shares in the variance of each output, and its responses to them."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.core.arrays import FloatArray
from uqpen.figures.measures import MeasureSeries, measure_series, measures_panel
from uqpen.figures.panel import Panel
from uqpen.results import measure_labels
from uqpen.results.archive_view import ArchiveView
from uqpen.results.best_sources import best_sources as best_source_names
from uqpen.results.measure_labels import INDICES
from uqpen.results.table import identity

__all__ = [
    "EFFECTS",
    "INDICES",
    "RESPONSES",
    "best_sources",
    "magnitudes",
    "response_panels",
    "sensitivity_panels",
]


# The mean effect stands in the tables alone: effects of both signs cancel in it.
EFFECTS = tuple(each for each in measure_labels.EFFECTS if each.statistic != "mu")
# Name, title and axis.
RESPONSES = (
    ("response", "response", "|response| [%]"),
    ("contribution", "response × uncertainty", "|response × uncertainty| [%]"),
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
            axis = f"effect on {view.axis_label(output)}"
            yield measures_panel(view, title, axis, found, view.scale(output).difference_from_si)


def response_panels(view: ArchiveView) -> Iterator[Panel]:
    """Relative responses to the inputs, and × uncertainty."""
    for output in view.numeric_outputs:
        for name, label, axis in RESPONSES:
            if found := measure_series(view, output, ((name, "", "o"),)):
                title = view.title(f"{output}: {label}")
                yield measures_panel(view, title, axis, found, magnitudes)


def best_sources(view: ArchiveView, found: list[MeasureSeries]) -> list[MeasureSeries]:
    """Leave plain samples out, unless one is selected or there is nothing else."""
    if view.source is not None and all(view.is_sample_design(each.source) for each in found):
        return found
    shown = best_source_names(view.tree, ((each.source, each.array) for each in found))
    return [each for each in found if each.source in shown]


def magnitudes(bounds: FloatArray) -> FloatArray:
    """Return magnitudes in per cent; of a negative estimate the bounds change their places."""
    if bounds[0] < 0:
        bounds = -bounds[[0, 2, 1]]
    return 100 * bounds
