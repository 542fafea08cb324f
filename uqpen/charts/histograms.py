"""Values of an output by one design: in bins, by category, with their statistics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names
from uqpen.charts.axes import ValueAxis, output_axis
from uqpen.charts.chart import Axis, Chart, LegendKey
from uqpen.charts.distributions import scale_notes
from uqpen.charts.marks import Bars, Dots, Rule, Shade, all_bounded, interval_notes
from uqpen.charts.study_limits import limit_marks, output_span
from uqpen.core.labels import INTERVAL_LEVEL, PROBABILITY, SURROGATES
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import count_text, estimate_text, number_text, percent_text
from uqpen.results.output_tables import add_shares
from uqpen.results.surrogate_tables import is_corrected
from uqpen.results.table import OutputTable, quantile_label
from uqpen.results.texts import capitalized, unit_suffix

# Dashes of the lines at marked estimates, and in turn of those at other quantiles.
_DASHES = {"mean": "dash", "median": "solid"}
_OTHER_DASHES = ("dot", "dashdot", "2px,5px", "longdash")
_HOVER = "%{customdata[0]} … %{customdata[1]}<br>%{y}"

_HOLLOW = LegendKey("no interval", "ink", "circle-open")


def histogram_charts(view: ArchiveView) -> Iterator[Chart]:
    """Runs of one design, with mean and quantiles."""
    design = next((name for name in view.sample_designs if view.design(name).has_shown_runs), None)
    if design is None:
        return
    for output in view.numeric_outputs:
        if view.shown_values(design, output).size:
            yield histogram(view, output, design)
    for output in view.categorical_outputs:
        probabilities = view.statistics.get(design, output, "share")
        if probabilities is not None and np.isfinite(probabilities.values[:, 0]).any():
            chart = shares(view, output, design, probabilities)
            notes = tuple(interval_notes([probabilities]))
            hollow = () if all_bounded(probabilities.values) else (_HOLLOW,)
            yield replace(chart, keys=hollow, notes=notes)


def histogram(view: ArchiveView, output: str, design: str) -> Chart:
    """Return the chart of a design's completed runs, in bins; of quantiles if not all are shown."""
    values = view.scale(output).from_si(view.shown_values(design, output))
    unit, title = "run", f"{count_text(values.size, 'run')} of {design}"
    if not view.design(design).shows_all_runs:
        unit, title = "quantile", f"{design}, by {count_text(values.size, 'quantile')}"
    span = output_span(view, output, [values], has_all_limits=False)
    limits = limit_marks(view, output, span)
    counts, edges = span.bins(values)
    outside = values.size - int(counts.sum())
    statistics = view.statistics.statistics(design, output)
    mean = [("mean", statistics["mean"])] if "mean" in statistics else []
    quantiles = statistics.get("quantile", ())
    marked = [*mean, *((quantile_label(each[PROBABILITY].item()), each) for each in quantiles)]
    drawn, keys, lacks = _estimate_marks(view, output, span, marked)
    notes = []
    if outside:
        verb = "lies" if outside == 1 else "lie"
        notes.append(f"{count_text(outside, unit)} {verb} outside of the axis.")
    if len(lacks) < len(marked):
        level = max(float(e.attrs.get(INTERVAL_LEVEL, 0)) for _, e in marked)
        # Sentences quote a corrected surrogate where there is one.
        whose = ", of these runs alone" * any(
            is_corrected(view.statistics.get(each, output, "mean"))
            or is_corrected(view.statistics.entries(each, output, "quantile").get(0.5))
            for each in group_names(view.tree, SURROGATES)
        )
        notes.append(f"Shades: {percent_text(level)} intervals of the marked estimates{whose}.")
    notes += scale_notes(view, output, span, ())
    if lacks:
        notes.append(f"No two-sided interval, so no shade: {', '.join(lacks)}.")
    highest = int(np.argmax(counts))
    series = view.series(design)
    return Chart(
        title=title,
        summary=f"The fullest bin, with {count_text(int(counts[highest]), unit)}, lies between "
        f"{number_text(edges[highest])} and {number_text(edges[highest + 1])}"
        f"{unit_suffix(view.unit(output))}.",
        x=output_axis(view, output, span),
        y=Axis(f"{unit}s in a bin"),
        marks=(Bars(edges, counts, series, hover=f"{_HOVER} {unit}s"), *drawn, *limits.rules),
        keys=(LegendKey(f"{unit}s", series, "bar"), *keys, *limits.keys),
        notes=(*notes, *limits.notes),
        height=280,
        of=output,
    )


def _estimate_marks(
    view: ArchiveView, output: str, span: ValueAxis, marked: list[tuple[str, xr.DataArray]]
) -> tuple[list[Rule | Shade], list[LegendKey], list[str]]:
    """Lines at estimates, shades of their intervals, and the names of those without one."""
    drawn: list[Rule | Shade] = []
    keys: list[LegendKey] = []
    lacks: list[str] = []
    others = 0
    for name, estimate in marked:
        bounds = view.scale(output).from_si(estimate.values)
        series: int | str = 1 if name == "mean" else "ink"
        dash = _DASHES.get(name) or _OTHER_DASHES[others % len(_OTHER_DASHES)]
        others += name not in _DASHES
        if np.isfinite(bounds[1:]).all():
            # A logarithmic axis has no 0.
            first, last = (min(max(end, span.lower), span.upper) for end in bounds[1:].tolist())
            drawn.append(Shade(first, last, series))
        else:
            lacks.append(name)
        drawn.append(Rule(float(bounds[0]), series, dash))
        estimated = estimate_text(*bounds, is_logarithmic=view.is_logarithmic(output))
        text = f"{name} {estimated}{unit_suffix(view.unit(output))}"
        keys.append(LegendKey(text, series, "line", dash))
    return drawn, keys, lacks


def shares(view: ArchiveView, output: str, design: str, probabilities: xr.DataArray) -> Chart:
    """Return a chart of the probabilities of an output's categories, along ``category``."""
    title = capitalized(output_title(view, output))
    labels = tuple(map(str, probabilities["category_label"].values))
    table = OutputTable(f"Category probabilities by {design}", [design])
    add_shares(table, view.statistics, output)
    texts = [f"{label}: {cells[0]}" for label, cells in table.rows]
    places, series = np.arange(len(labels)), view.series(design)
    return Chart(
        title=f"{title}: probability of each category, by {design}",
        summary="; ".join(texts),
        x=Axis("probability", (0.0, 1.0)),
        y=Axis("", rows=labels),
        marks=(Dots(probabilities.values, places, series, hovers=texts, name=design),),
        tables=(table,),
        height=90 + 34 * len(labels),
        of=output,
    )
