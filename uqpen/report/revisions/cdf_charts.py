"""Distribution functions of two archives over each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uqpen.charts.axes import CUT, ValueAxis, output_axis
from uqpen.charts.chart import Axis, Block, Chart, LegendKey
from uqpen.charts.marks import Mark, series_dash
from uqpen.figures.curves import Curve
from uqpen.report.blocks import Heading
from uqpen.report.revisions.revision_page import ArchivePair, ModelPair
from uqpen.report.sections.distribution_curves import curve_at, curve_quantile, curve_traces
from uqpen.results.archive_view import ArchiveView, output_heading, output_title
from uqpen.results.digits import number_text, percent_text
from uqpen.results.texts import capitalized, unit_suffix

__all__ = ["cdf_charts"]


class _Drawn(NamedTuple):
    """The function of one of two archives: its name, the part of the archive, the function."""

    label: str
    view: ArchiveView
    curve: Curve


def cdf_charts(pair: ArchivePair) -> Iterator[Block]:
    """Distribution functions of each output of both archives, by the first common source."""
    for model, each in pair.models.items():
        for output in each.outputs:
            source, drawn = next(_common_curves(each, output), ("", []))
            if drawn:
                heading = output_heading(each.first, output)
                yield Heading(f"{model}: " * bool(model) + heading)
                yield _chart(each, output, source, drawn)


def _common_curves(pair: ModelPair, output: str) -> Iterator[tuple[str, list[_Drawn]]]:
    """Yield the functions of both archives by each source that has them in both."""
    measure = pair.first.scale(output)
    for source in pair.sources:
        drawn = [
            _Drawn(label, view, curve)
            for label, view in (("A", pair.first), ("B", pair.second))
            if (curve := Curve.from_source(source, view.statistics, source, output, measure))
        ]
        if len(drawn) == 2:
            yield source, drawn


def _chart(pair: ModelPair, output: str, source: str, drawn: list[_Drawn]) -> Chart:
    view = pair.first
    every = [each.curve.values for each in drawn]
    is_logarithmic = all(each.view.is_logarithmic(output) for each in drawn)
    span = ValueAxis.of_values(every, is_logarithmic=is_logarithmic)
    values = span.thresholds(np.concatenate(every))
    traces: list[Mark] = []
    keys: list[LegendKey] = []
    for series, (label, of, curve) in enumerate(drawn):
        # Runs are read off in the unit of their archive; else the ranks of the function remain.
        has_grid = of.unit(output) == view.unit(output)
        function = curve_at(of, output, curve, values) if has_grid else curve
        dash, named = series_dash(series), replace(function, name=label)
        traces += curve_traces(named, series, dash, is_stepped=curve.is_stepped)
        keys.append(LegendKey(label, series, "line", dash))
    return Chart(
        title=f"Probability that {output_title(view, output)} is at most x, by {source}",
        summary=" ".join(
            f"In {each.label}, the median is "
            f"{number_text(curve_quantile(each.curve, 0.5))}{unit_suffix(view.unit(output))}."
            for each in drawn
        ),
        x=replace(output_axis(view, output, span), quantity=None),
        y=Axis("P(at most x)", (0.0, 1.0)),
        marks=tuple(traces),
        keys=tuple(keys),
        notes=tuple(_notes(drawn, is_cut=span.is_cut)),
        height=340,
        is_compared=True,
    )


def _notes(drawn: list[_Drawn], *, is_cut: bool) -> Iterator[str]:
    for each in drawn:
        if not each.curve.has_band:
            yield f"no band of {each.label}: {each.curve.note}"
    levels = [each.curve.level for each in drawn if each.curve.has_band]
    if levels:
        yield f"Shades: simultaneous {percent_text(levels[0])} bands, for each archive by itself."
    if is_cut:
        yield f"{capitalized(CUT)}."
