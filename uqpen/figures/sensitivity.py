"""The inputs' shares in the variance of each output, and its responses to them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

from uqpen.core.arrays import FloatArray
from uqpen.figures.measures import MeasureSeries, measure_series, measures_panel
from uqpen.figures.panel import Panel
from uqpen.results import measure_labels
from uqpen.results.archive_view import ArchiveView
from uqpen.results.index_titles import index_titles
from uqpen.results.measure_labels import INDICES, LOGARITHM_INDICES, Measure
from uqpen.results.source_statistics import best_sources as best_source_names
from uqpen.results.table import Conversion, identity
from uqpen.results.texts import title_with_unit

__all__ = [
    "EFFECTS",
    "INDICES",
    "ResponseMeasure",
    "best_sources",
    "index_series",
    "magnitudes",
    "response_measures",
    "response_panels",
    "sensitivity_panels",
    "shown_indices",
]


# The mean effect stands in the tables alone: effects of both signs cancel in it.
EFFECTS = tuple(each for each in measure_labels.EFFECTS if each.statistic != "mu")


class ResponseMeasure(NamedTuple):
    """A measure of the change of an output near the nominal point.

    Attributes
    ----------
    statistic : str
        An entry of the catalogue.
    label, axis : str
        Its name in titles, and the label of its axis.
    convert : callable
        From an archive's bounds to magnitudes in the unit that is shown.
    unit : str
        That unit.
    """

    statistic: str
    label: str
    axis: str
    convert: Conversion
    unit: str


def response_measures(view: ArchiveView, output: str) -> tuple[ResponseMeasure, ...]:
    """Return the measures of an output's responses.

    Those relative to a quantity in a unit with an offset have no estimates (`measure_series`).
    """
    unit = view.unit(output)
    change = partial(magnitudes, convert=view.scale(output).difference_from_si)
    axis = title_with_unit("|change| per standard deviation", unit)
    return (
        ResponseMeasure("response", "response", "|response| [%]", _percent, "%"),
        ResponseMeasure(
            "contribution",
            "response × uncertainty",
            "|response × uncertainty| [%]",
            _percent,
            "%",
        ),
        ResponseMeasure(
            "change_per_std", "change per standard deviation of an input", axis, change, unit
        ),
    )


def sensitivity_panels(view: ArchiveView) -> Iterator[Panel]:
    """Each input's share of the variance, and its effects."""
    shares = index_titles(view.tree)
    for output in view.numeric_outputs:
        for of, measures in shown_indices(view, output):
            if found := best_sources(view, index_series(view, output, measures)):
                title = view.title(f"{output}: {shares.title(of)}")
                yield measures_panel(view, title, shares.axis, found, identity, shares.note)
    for output in view.numeric_outputs:
        if found := measure_series(view, output, EFFECTS):
            title = view.title(f"{output}: elementary effects")
            axis = f"effect on {view.axis_label(output)}"
            yield measures_panel(view, title, axis, found, view.scale(output).difference_from_si)


def response_panels(view: ArchiveView) -> Iterator[Panel]:
    """Relative responses to the inputs, and × uncertainty."""
    for output in view.numeric_outputs:
        for each in response_measures(view, output):
            if found := measure_series(view, output, ((each.statistic, "", "o"),)):
                title = view.title(f"{output}: {each.label}")
                yield measures_panel(view, title, each.axis, found, each.convert)


def shown_indices(view: ArchiveView, output: str) -> tuple[tuple[str, Sequence[Measure]], ...]:
    """Return the indices of an output to show: of its logarithm first if that is shown."""
    of_output = ("its variance", INDICES)
    if not view.is_logarithmic(output):
        return (of_output,)
    return (("its logarithm's variance", LOGARITHM_INDICES), of_output)


def index_series(
    view: ArchiveView, output: str, measures: Sequence[Measure] = INDICES
) -> list[MeasureSeries]:
    """Return the indices of an output by all sources, in the order that they are shown."""
    shares = index_titles(view.tree)
    found = measure_series(view, output, shares.ordered(measures))
    if not shares.is_dependent:
        return found
    labels = [each.label for each in shares.ordered(measures)]
    return sorted(found, key=lambda each: labels.index(each.label))


def best_sources(view: ArchiveView, found: list[MeasureSeries]) -> list[MeasureSeries]:
    """Leave plain samples out, unless one is selected or there is nothing else."""
    if view.source is not None and all(view.is_sample_design(each.source) for each in found):
        return found
    shown = best_source_names(view.tree, ((each.source, each.array) for each in found))
    return [each for each in found if each.source in shown]


def magnitudes(bounds: FloatArray, convert: Conversion) -> FloatArray:
    """Return converted magnitudes; of a negative estimate the bounds change their places."""
    if bounds[0] < 0:
        bounds = -bounds[[0, 2, 1]]
    converted: FloatArray = convert(bounds)
    return converted


def _percent(bounds: FloatArray) -> FloatArray:
    return magnitudes(bounds, lambda values: 100 * values)
