"""Distribution of each output: its distribution function, its histogram, its quantiles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from uqpen.charts.axes import CUT, output_axis
from uqpen.charts.chart import Axis, Block, Chart, Charts, LegendKey, ThresholdReadout
from uqpen.charts.marks import Mark, series_dash
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.core.statistic_dimensions import PERCENT
from uqpen.figures.curves import Curve
from uqpen.figures.distributions import (
    StudyLimit,
    distribution_curves,
    output_span,
    scale_notes,
    study_limits,
)
from uqpen.report.blocks import Fold, Table
from uqpen.report.sections.distribution_curves import curve_at, curve_quantile, curve_traces
from uqpen.report.sections.exceedance import exceedance
from uqpen.report.sections.histograms import histogram, shares
from uqpen.report.sections.leading_design import missing_runs_note
from uqpen.report.sections.limit_marks import limit_marks
from uqpen.report.sections.main_outputs import main_outputs, output_blocks
from uqpen.report.sections.runs_beyond_axis import listed_bounds, runs_beyond_axis
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import number_text, percent_text, range_text
from uqpen.results.empirical_cdf import LargestRun
from uqpen.results.table import OutputTable, quantile_label
from uqpen.results.texts import capitalized, plain_text, typeset_quantity, unit_suffix

__all__ = ["distributions"]


# Probabilities at which the numbers behind a distribution function are shown.
_SHOWN = np.linspace(0, 1, 21)


def distributions(view: ArchiveView) -> Iterator[Block]:
    """Distribution function with its band, histogram and quantiles of each output."""
    design = view.leading_design
    if design is None:
        return
    # The main results have the histogram of the first main output.
    pictured = "" if view.model else next(iter(main_outputs(view)), "")
    found = {
        each: _numeric_blocks(view, each, design, is_pictured=each == pictured)
        for each in view.numeric_outputs
    }
    found |= {each: _category_blocks(view, each, design) for each in view.categorical_outputs}
    yield from output_blocks(view, found)


def _category_blocks(view: ArchiveView, output: str, design: str) -> Iterator[Block]:
    probabilities = view.statistics.get(design, output, "share")
    if probabilities is not None:
        yield shares(view, output, design, probabilities)


def _numeric_blocks(
    view: ArchiveView, output: str, design: str, *, is_pictured: bool
) -> Iterator[Block]:
    # The function of the leading design comes first.
    found = distribution_curves(view, output)
    curves = sorted(found, key=lambda curve: curve.name != design)
    if not curves:
        return
    bins = () if is_pictured else (histogram(view, output, design),)
    tail = exceedance(view, output, curves[0])
    yield Charts((_cdf(view, output, curves[:1]), *bins, *tail))
    yield Table(_quantile_table(view, output, design), is_folded=True)
    if len(curves) > 1:
        yield Fold("Distribution functions by all methods", (_cdf(view, output, curves),))


def _cdf(view: ArchiveView, output: str, curves: list[Curve]) -> Chart:
    is_all = len(curves) > 1
    span = output_span(view, output, [curves[0].values])
    marks = limit_marks(view, output, span, at_foot=True)
    values = span.thresholds(curves[0].values, [limit.value for limit in marks.limits])
    drawn = [curve_at(view, output, curve, values, marks.limits) for curve in curves]
    traces: list[Mark] = []
    keys: list[LegendKey] = []
    for curve, shown in zip(curves, drawn, strict=True):
        series, is_first = view.series(curve.name), curve is curves[0]
        dash, width = ("solid", 2.5) if is_first else (series_dash(series), 1.5)
        traces += curve_traces(
            shown, series, dash, is_stepped=curve.is_stepped, width=width, has_band=is_first
        )
        if is_first and curve.has_band:
            text = f"simultaneous {percent_text(curve.level)} band of {curve.name}"
            keys.append(LegendKey(text, series, "band"))
        keys.append(LegendKey(curve.name, series, "line", dash))
    return Chart(
        title=f"Probability that {output_title(view, output)} is at most x",
        summary=_summary(view, output, curves[0]),
        x=output_axis(view, output, span),
        y=Axis("P(at most x)", (0.0, 1.0)),
        marks=(*traces, *marks.rules),
        keys=(*keys, *marks.keys),
        notes=(
            *missing_runs_note(view, curves[0].name),
            *marks.notes,
            *(f"{capitalized(each)}." for each in scale_notes(view, output, span, curves)),
            *(
                [f"{capitalized(CUT)}. {_largest_run_sentence(view, output, curves[0])}"]
                * span.is_cut
            ),
        ),
        tables=(_cdf_table(view, output, curves[0]),),
        height=380,
        is_compared=True,
        reading=None if is_all else _threshold_readout(view, output, drawn[0], marks.limits),
    )


def _largest_run_sentence(view: ArchiveView, output: str, curve: Curve) -> str:
    return LargestRun.of_design(view, curve.name, output).sentence


def _summary(view: ArchiveView, output: str, curve: Curve) -> str:
    low, middle, high = (number_text(curve_quantile(curve, p)) for p in (0.05, 0.5, 0.95))
    unit_text = unit_suffix(view.unit(output))
    return (
        f"By {curve.name} it rises from 5 % at {low}{unit_text} through one half at "
        f"{middle}{unit_text} to 95 % at {high}{unit_text}. The table below has the numbers."
    )


def _cdf_table(view: ArchiveView, output: str, curve: Curve) -> OutputTable:
    with_band = ", with its simultaneous band" * curve.has_band
    title = f"Distribution function by {curve.name}{with_band}"
    table = OutputTable(title, [view.axis_label(output), "P(at most)", "band"])
    ranks = np.unique(np.round(_SHOWN * (curve.values.size - 1)).astype(np.int64))
    for rank in ranks.tolist():
        estimate, lower, upper = curve.band[rank]
        ends = range_text(f"{lower:.4f}", f"{upper:.4f}") if curve.has_band else "–"
        cells = [number_text(curve.values[rank]), f"{estimate:.4f}", ends]
        table.rows.append((percent_text(round(rank / (curve.values.size - 1), 6)), cells))
    if not curve.has_band:
        table.note_mark(f"no band: {curve.note}")
    return table


def _threshold_readout(
    view: ArchiveView, output: str, curve: Curve, limits: Sequence[StudyLimit]
) -> ThresholdReadout:
    return ThresholdReadout(
        output=output_title(view, output),
        unit=unit_suffix(view.unit(output)).lstrip(),
        source=curve.name,
        level=curve.level,
        note=curve.note,
        values=curve.values.tolist(),
        limits=tuple(
            (limit.value, typeset_quantity(plain_text(limit.text, 20)))
            for limit in study_limits(view, output)
        ),
        start=_first_threshold(view, output, curve, limits),
        bounds=listed_bounds(curve.band),
        beyond=runs_beyond_axis(view, output, curve),
    )


def _first_threshold(
    view: ArchiveView, output: str, curve: Curve, limits: Sequence[StudyLimit]
) -> float:
    """Return the threshold that is shown first.

    It is the limit that the study has a verdict about, wherever it lies; else the first limit on
    the axis, or any; and without limits, a quantile.
    """
    every = study_limits(view, output)
    decided = [limit for limit in every if limit.acceptance is not None]
    if first := next(iter((*decided, *limits, *every)), None):
        return first.value
    place = int(np.searchsorted(curve.band[:, 0], 0.95))
    return float(curve.values[min(place, curve.values.size - 1)])


def _quantile_table(view: ArchiveView, output: str, design: str) -> OutputTable:
    """Percentiles and their intervals."""
    convert = view.scale(output).from_si
    array = view.statistics.statistics(design, output)["percentile"]
    probabilities = array[PERCENT] / 100
    level = array.attrs.get(INTERVAL_LEVEL)
    with_intervals = "" if level is None else f", with {percent_text(level)} intervals"
    table = OutputTable(f"Quantiles by {design}{with_intervals}", [view.axis_label(output)])
    for p, estimate in zip(probabilities.values.tolist(), array, strict=True):
        cell = table.cell(estimate, convert, is_logarithmic=view.is_logarithmic(output))
        table.rows.append((quantile_label(p), [cell]))
    largest = LargestRun.of_design(view, design, output)
    table.rows.append((largest.name, [number_text(largest.value)]))
    return table
