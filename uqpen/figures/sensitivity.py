"""The inputs' shares in the variance of each output, and its responses to them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import MEASURES
from uqpen.core.statistic import Statistic
from uqpen.figures.measures import MeasureSeries, measure_series, measures_panel
from uqpen.figures.panel import Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.best_sources import best_sources as best_source_names
from uqpen.results.input_measures import index_titles
from uqpen.results.table import Conversion, identity
from uqpen.results.texts import title_with_unit

__all__ = [
    "EFFECTS",
    "best_sources",
    "index_series",
    "magnitudes",
    "response_measures",
    "response_panels",
    "sensitivity_panels",
    "shown_indices",
]


EFFECTS = tuple(each for each in MEASURES["effects"] if each.measure.marker)


def response_measures(
    view: ArchiveView, output: str
) -> Iterator[tuple[Statistic, list[MeasureSeries], Conversion, str]]:
    """Yield the measures of an output's change near the nominal point, which are magnitudes.

    Each comes with its estimates, the conversion of bounds to the unit that is shown, and that
    unit. Those relative to a quantity in a unit with an offset have no estimates.
    """
    for each in (*MEASURES["responses"], *MEASURES["changes"]):
        if found := measure_series(view, output, [each]):
            convert = partial(magnitudes, convert=view.conversion(output, each.name))
            yield each, found, convert, "%" if each.measure.relative_to else view.unit(output)


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
        for each, found, convert, unit in response_measures(view, output):
            title = view.title(f"{output}: {each.measure.chart}")
            axis = title_with_unit(each.measure.axis, unit)
            yield measures_panel(view, title, axis, found, convert)


def shown_indices(view: ArchiveView, output: str) -> tuple[tuple[str, Sequence[Statistic]], ...]:
    """Return the indices of an output to show: of its logarithm first if that is shown."""
    of_output = ("its variance", MEASURES["shares"])
    if not view.is_logarithmic(output):
        return (of_output,)
    return (("its logarithm's variance", MEASURES["shares of the logarithm"]), of_output)


def index_series(
    view: ArchiveView, output: str, measures: Sequence[Statistic]
) -> list[MeasureSeries]:
    """Return the indices of an output by all sources, in the order that they are shown."""
    shares = index_titles(view.tree)
    ordered = shares.ordered(measures)
    found = measure_series(view, output, ordered)
    if not shares.is_dependent:
        return found
    ranks = [each.measure.rank for each in ordered]
    return sorted(found, key=lambda each: ranks.index(each.measure.rank))


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
