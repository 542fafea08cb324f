"""Outputs with dimensions: curves with a place that a reader moves over their charts, and maps."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np

from uqpen.archive.fields import entry_place, field_dimensions
from uqpen.charts.chart import Block, Charts, PlaceColumn, PlaceReadout
from uqpen.charts.curves import (
    driver_areas,
    driver_lines,
    fan_chart,
    map_charts,
    measures_along,
    median_charts,
    ordered_curves,
    place_drivers,
    place_histogram,
    probability_charts,
    quantile_chart,
    ranked_chart,
    tolerance_chart,
)
from uqpen.charts.marks import has_interval
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE, MEAN, QUANTILE, STD
from uqpen.core.labels import NOTE
from uqpen.report.blocks import Fold, Heading
from uqpen.report.sections.sentences import QuotedStatistic, headed_blocks, no_break, output_name
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import estimate_text, number_text
from uqpen.results.field_tables import CurveEstimates
from uqpen.results.source_statistics import THRESHOLD_PROBABILITIES
from uqpen.results.table import entry_label, quantile_label
from uqpen.results.texts import unit_suffix

# Places of a curve in its charts at the most, of some thousand.
_MOST_PLACES = 161
# Fields that are open, at the most.
_MOST = 2
# Maps of a field that are open: of the mean and the standard deviation.
_OPEN_MAPS = 2
# Curves among the main results, which fit in one row, and fields with a sentence, at the most.
_MOST_FIRST, _MOST_SENTENCES = 4, 3


def curves(view: ArchiveView) -> Iterator[Block]:
    """Yield the charts of each field, those of all but the first ones folded."""
    design = view.leading_design
    if design is None:
        return
    found = {
        field: blocks
        for field in view.fields
        if (blocks := tuple(_field_blocks(view, field, design)))
    }
    yield from headed_blocks(view, found, list(found)[:_MOST], "Other curves")


def _field_blocks(view: ArchiveView, field: str, design: str) -> Iterator[Block]:
    along = field_dimensions(view.design(design).runs[field])
    if view.statistics.get(design, field, MEAN.name) is None:
        return
    if len(along) == 1:
        curve = CurveEstimates(view, field, design, _MOST_PLACES)
        unit = unit_suffix(curve.view.unit(curve.dimension))
        readout = PlaceReadout(
            output=output_title(curve.view, curve.output),
            dimension=str(curve.view.attributes(curve.dimension).get("long_name", curve.dimension)),
            values=curve.places,
            heads=[f"{number_text(place, 6)}{unit}" for place in curve.places.tolist()],
            columns=list(_columns(curve)),
            start=_first_place(curve),
        )
        indices = measures_along(curve)
        yield fan_chart(curve, readout)
        yield Charts(
            (
                *([place_histogram(curve, readout.start)] if curve.has_runs else []),
                *place_drivers(curve, readout.start, indices),
                *driver_areas(curve, indices),
                *probability_charts(curve),
            )
        )
        further = (
            *tolerance_chart(curve),
            *ranked_chart(curve),
            *quantile_chart(curve),
            *driver_lines(curve, indices),
        )
        if further:
            yield Fold(
                "Bands of new curves, quantiles and shares, and ranked curves", (Charts(further),)
            )
        return
    maps = tuple(map_charts(view, field, design))
    yield Charts(maps[:_OPEN_MAPS])
    if further := maps[_OPEN_MAPS:]:
        yield Fold("Maps of the quantiles", (Charts(further),))


def _first_place(curve: CurveEstimates) -> int:
    """Return where runs differ most, or where the mean is largest if no deviation is known."""
    for statistic in (STD, MEAN):
        bounds = curve.bounds(statistic.name)
        if bounds is not None and np.isfinite(bounds[:, 0]).any():
            return int(np.nanargmax(bounds[:, 0]))
    return 0


def _columns(curve: CurveEstimates) -> Iterator[PlaceColumn]:
    """Yield each statistic at the places."""
    unit = unit_suffix(curve.view.unit(curve.output))
    for statistic in (MEAN, STD):
        if (bounds := curve.bounds(statistic.name)) is not None:
            yield _column(curve, statistic.name, statistic.shown.label, bounds, unit)
    for number, (p, bounds) in enumerate(curve.entries(QUANTILE.name).items()):
        yield _column(curve, QUANTILE.name, quantile_label(p), bounds, unit, number)
    for probability in THRESHOLD_PROBABILITIES:
        for number, (text, bounds) in enumerate(curve.entries(probability.name).items()):
            label = f"{entry_label(probability, text)} ="
            yield _column(curve, probability.name, label, bounds, entry=number)
    if (bounds := curve.bounds("reached")) is not None:
        yield _column(curve, "reached", "share of runs that get this far", bounds)


def _column(
    curve: CurveEstimates,
    statistic: str,
    label: str,
    estimates: FloatArray,
    unit: str = "",
    entry: int = 0,
) -> PlaceColumn:
    """Return the estimates with their intervals, and the reasons where there is none."""
    reasons: dict[int, str] = {}
    if (array := curve.array(statistic)) is not None and NOTE in array.coords:
        notes = array.coords[NOTE].transpose(curve.dimension, ...).values
        at_places = notes.reshape(curve.places.size, -1)[:, entry].tolist()
        lacks = np.isfinite(estimates[:, 0]) & ~has_interval(estimates)
        reasons = {at: at_places[at] for at in np.flatnonzero(lacks).tolist() if at_places[at]}
    return PlaceColumn(label, unit, [estimate_text(*row) for row in estimates.tolist()], reasons)


def first_curves(view: ArchiveView) -> Iterator[Block]:
    """Yield the charts of the first curves at a glance, those by several models before others."""
    if found := ordered_curves(view, _MOST_PLACES)[:_MOST_FIRST]:
        yield median_charts(view, found)


def further_curves(view: ArchiveView) -> Iterator[Block]:
    """Yield the charts of all curves that are not among the first ones."""
    if found := ordered_curves(view, _MOST_PLACES)[_MOST_FIRST:]:
        yield Heading("Further curves")
        yield median_charts(view, found)


def field_sentences(view: ArchiveView, design: str) -> Iterator[str]:
    """Yield where the mean of each of the first fields is largest, with its band if it has one."""
    sentences = (_sentence(view, each, design) for each in view.fields)
    yield from islice(filter(None, sentences), _MOST_SENTENCES)


def _sentence(view: ArchiveView, field: str, design: str) -> str:
    statistics = view.statistics.statistics(design, field)
    statistic = "mean_band" if "mean_band" in statistics else MEAN.name
    if statistic not in statistics:
        return ""
    array = statistics[statistic]
    estimates = array.values[..., 0]
    if not np.isfinite(estimates).any():
        return ""
    position = np.unravel_index(int(np.nanargmax(estimates)), estimates.shape)
    index = tuple(map(int, position))
    quantity = QuotedStatistic(view, field, CATALOGUE[statistic])
    value, interval = quantity.texts(array[index])[0], quantity.interval(array[index])
    if statistic == "mean_band":
        interval = interval.replace("without an interval", "without a band", 1)
        interval = interval.replace("% interval", "% band, valid at all places at once", 1)
    place = no_break(entry_place(array, index)) + view.statistics.reached_text(design, field, index)
    return f"The mean of {output_name(view, field)} is largest at {place}: {value} {interval}."
