"""Distribution functions of two archives over each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from uqpen.charts.axes import ValueAxis
from uqpen.charts.chart import Block
from uqpen.charts.distributions import Curve, overlaid_chart
from uqpen.report.blocks import Heading
from uqpen.report.revisions.revision_page import ArchivePair, ModelPair
from uqpen.results.archive_view import output_heading

__all__ = ["cdf_charts"]


def cdf_charts(pair: ArchivePair) -> Iterator[Block]:
    """Distribution functions of each output of both archives, by the first common source."""
    for model, each in pair.models.items():
        for output in each.outputs:
            if curves := next(_common_curves(each, output), None):
                heading = output_heading(each.first, output)
                yield Heading(f"{model}: " * bool(model) + heading)
                is_logarithmic = all(curve.view.is_logarithmic(output) for curve in curves)
                values = [curve.values for curve in curves]
                span = ValueAxis.of_values(values, is_logarithmic=is_logarithmic)
                chart = overlaid_chart(each.first, output, curves, span, each="archive")
                yield replace(chart, x=replace(chart.x, quantity=None))


def _common_curves(pair: ModelPair, output: str) -> Iterator[list[Curve]]:
    """Yield the functions of both archives by each source that has them in both."""
    measure = pair.first.scale(output)
    for source in pair.sources:
        found = [
            Curve.of_source(view, source, output, label, series, measure)
            for series, (label, view) in enumerate((("A", pair.first), ("B", pair.second)))
        ]
        curves = [curve for curve in found if curve is not None]
        if len(curves) == 2:
            yield curves
