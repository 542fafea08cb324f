"""Outputs with dimensions: curves with a place that a reader moves over their charts, and maps."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.archive.fields import field_dimensions
from uqpen.charts.chart import Block, Charts
from uqpen.report.blocks import Fold, Heading
from uqpen.report.sections.curve_drivers import driver_areas, driver_lines, measures_along
from uqpen.report.sections.curve_fan import (
    fan_chart,
    probability_charts,
    quantile_chart,
    ranked_chart,
    tolerance_chart,
)
from uqpen.report.sections.curve_lines import MOST_PLACES
from uqpen.report.sections.curve_readout import place_readout
from uqpen.report.sections.curve_slices import place_drivers, place_histogram
from uqpen.report.sections.field_maps import map_charts
from uqpen.report.sections.leading_design import leading_design
from uqpen.results.archive_view import ArchiveView, output_heading, output_title
from uqpen.results.curve_estimates import CurveEstimates
from uqpen.results.texts import plain_text

__all__ = ["curves"]

# Fields that are open, at the most.
_MOST = 2
# Maps of a field that are open: of the mean and the standard deviation.
_OPEN_MAPS = 2


def curves(view: ArchiveView) -> Iterator[Block]:
    """Yield the charts of each field, those of all but the first ones folded."""
    design = leading_design(view)
    if design is None:
        return
    found = {
        field: blocks
        for field in view.fields
        if (blocks := tuple(_field_blocks(view, field, design)))
    }
    names = list(found)
    for field in names[:_MOST]:
        yield from (Heading(output_heading(view, field)), *found[field])
    if others := names[_MOST:]:
        titles = ", ".join(output_title(view, field) for field in others)
        yield Fold(
            f"Other curves: {plain_text(titles, 120)}",
            tuple(
                block
                for field in others
                for block in (Heading(output_heading(view, field)), *found[field])
            ),
        )


def _field_blocks(view: ArchiveView, field: str, design: str) -> Iterator[Block]:
    along = field_dimensions(view.design(design).runs[field])
    if view.statistics.get(design, field, "mean") is None:
        return
    if len(along) == 1:
        yield from _curve_blocks(CurveEstimates(view, field, design, MOST_PLACES))
        return
    maps = tuple(map_charts(view, field, design))
    yield Charts(maps[:_OPEN_MAPS])
    if further := maps[_OPEN_MAPS:]:
        yield Fold("Maps of the quantiles", (Charts(further),))


def _curve_blocks(curve: CurveEstimates) -> Iterator[Block]:
    readout = place_readout(curve)
    indices = measures_along(curve)
    yield fan_chart(curve, readout)
    yield Charts(
        (
            *([place_histogram(curve, readout)] if curve.has_runs else []),
            *place_drivers(curve, readout, indices),
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
