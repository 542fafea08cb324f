"""Differences of several models at the same points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from uqpen.charts.axes import CUT, output_axis
from uqpen.charts.chart import Axis, Block, Chart, LegendKey
from uqpen.charts.marks import Mark, series_dash
from uqpen.figures.curves import Curve
from uqpen.figures.distributions import model_curves, output_span, scale_notes
from uqpen.report.blocks import Heading, Table
from uqpen.report.sections.distribution_curves import curve_at, curve_quantile, curve_traces
from uqpen.report.sections.fields import further_curves
from uqpen.report.sections.limit_marks import limit_marks
from uqpen.report.sections.main_outputs import main_outputs
from uqpen.results.archive_view import ArchiveView, output_heading, output_title
from uqpen.results.digits import number_text, percent_text
from uqpen.results.output_tables import difference_tables
from uqpen.results.texts import capitalized, unit_suffix

__all__ = ["model_chart", "model_comparison"]


def model_comparison(view: ArchiveView) -> Iterator[Block]:
    """Curves and distribution functions by each of several models, and the models' differences.

    The first curves and the first main output are on the page already, with the main results.
    """
    if not view.model:
        return
    yield from further_curves(view)
    design = view.leading_design
    first = main_outputs(view)[:1] if design else []
    for output in view.numeric_outputs if design else ():
        chart = model_chart(view, output, design or "")
        if chart is not None and output not in first:
            yield Heading(output_heading(view, output))
            yield chart
    for table in difference_tables(view.archive):
        yield Table(table, is_folded=True)


def model_chart(view: ArchiveView, output: str, design: str) -> Chart | None:
    """Return the distribution functions of an output by each model; None without any."""
    curves = model_curves(view, output, design)
    return _chart(view, output, design, curves) if curves else None


def _chart(view: ArchiveView, output: str, design: str, curves: list[Curve]) -> Chart:
    parts = {each.model: each for each in view.model_views}
    every = [curve.values for curve in curves]
    span = output_span(view, output, every)
    marks = limit_marks(view, output, span, at_foot=True)
    values = span.thresholds(np.concatenate(every), [limit.value for limit in marks.limits])
    traces: list[Mark] = []
    keys: list[LegendKey] = []
    for curve in curves:
        series = list(parts).index(curve.name)
        dash = series_dash(series)
        by_design = replace(curve, name=design)
        function = curve_at(parts[curve.name], output, by_design, values, marks.limits)
        drawn = replace(function, name=curve.name)
        traces += curve_traces(drawn, series, dash, is_stepped=curve.is_stepped)
        keys.append(LegendKey(curve.name, series, "line", dash))
    notes = [f"no band of {curve.name}: {curve.note}" for curve in curves if not curve.has_band]
    if banded := [curve for curve in curves if curve.has_band]:
        notes.append(
            f"Shades: simultaneous {percent_text(banded[0].level)} bands, for each model by itself."
        )
    notes += [f"{capitalized(each)}." for each in scale_notes(view, output, span, curves)]
    notes += [*marks.notes, *[f"{capitalized(CUT)}."] * span.is_cut]
    return Chart(
        title=f"Probability that {output_title(view, output)} is at most x, by {design}",
        summary=" ".join(
            f"By {curve.name}, the median is "
            f"{number_text(curve_quantile(curve, 0.5))}{unit_suffix(view.unit(output))}."
            for curve in curves
        ),
        x=output_axis(view, output, span),
        y=Axis("P(at most x)", (0.0, 1.0)),
        marks=(*traces, *marks.rules),
        keys=(*keys, *marks.keys),
        notes=tuple(notes),
        height=340,
        is_compared=True,
    )
