"""Distribution of each output: its distribution function, its histogram, its quantiles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from uqpen.charts.chart import Block, Chart, Charts, RunsBeyondAxis, ThresholdReadout
from uqpen.charts.distributions import (
    Curve,
    LargestRun,
    cdf_chart,
    distribution_curves,
    empirical_cdf,
    exceedance_chart,
)
from uqpen.charts.histograms import histogram, shares
from uqpen.charts.marks import Line, Rule
from uqpen.charts.study_limits import study_limits
from uqpen.core.arrays import FloatArray, evenly_spread
from uqpen.core.labels import INTERVAL_LEVEL, PERCENT
from uqpen.report.blocks import Fold, Table
from uqpen.report.sections.main_outputs import main_outputs, output_blocks
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import number_text, percent_text, range_text
from uqpen.results.table import OutputTable, quantile_label
from uqpen.results.texts import unit_suffix

__all__ = ["distributions"]


# Probabilities at which the numbers behind a distribution function are shown.
_SHOWN = np.linspace(0, 1, 21)
# Runs beyond either end of an axis at the most, so that a page does not grow with their number.
_MOST_BEYOND = 40


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
    curves = sorted(found, key=lambda curve: curve.source != design)
    if not curves:
        return
    bins = () if is_pictured else (histogram(view, output, design),)
    tail = exceedance_chart(view, output, curves[0])
    yield Charts((_cdf(view, output, curves[:1]), *bins, *tail))
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
    yield Table(table, is_folded=True)
    if len(curves) > 1:
        yield Fold("Distribution functions by all methods", (_cdf(view, output, curves),))


def _cdf(view: ArchiveView, output: str, curves: list[Curve]) -> Chart:
    """Return a chart of functions with the numbers of the first; of one alone with a threshold."""
    curve = curves[0]
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
    chart = replace(cdf_chart(view, output, curves), tables=(table,))
    if len(curves) > 1:
        return chart
    return replace(chart, reading=_threshold_readout(view, output, curves[0], chart))


def _threshold_readout(
    view: ArchiveView, output: str, curve: Curve, chart: Chart
) -> ThresholdReadout:
    (thresholds,) = (mark.x for mark in chart.marks if isinstance(mark, Line))
    drawn = [mark.at for mark in chart.marks if isinstance(mark, Rule)]
    curve = curve.at(np.asarray(thresholds))
    limits = study_limits(view, output)
    # First the limit that the study has a verdict about, wherever it lies; else the first limit on
    # the axis, or any; and without limits, a quantile.
    decided = [limit.value for limit in limits if limit.acceptance is not None]
    place = min(int(np.searchsorted(curve.band[:, 0], 0.95)), curve.values.size - 1)
    quantile = float(curve.values[place])
    return ThresholdReadout(
        output=output_title(view, output),
        unit=unit_suffix(view.unit(output)).lstrip(),
        source=curve.source,
        level=curve.level,
        note=curve.note,
        values=curve.values.tolist(),
        limits=tuple((limit.value, limit.text) for limit in limits),
        start=[*decided, *drawn, *(limit.value for limit in limits), quantile][0],
        bounds=_listed_bounds(curve.band),
        beyond=_runs_beyond_axis(view, output, curve),
    )


def _runs_beyond_axis(view: ArchiveView, output: str, curve: Curve) -> RunsBeyondAxis | None:
    """Return the runs beyond the thresholds of a function, for those that a reader types."""
    if not view.design(curve.source).keeps_runs:
        return None
    values = np.sort(view.design(curve.source).completed_values(output))
    shown = view.scale(output).from_si(values)
    first, last = float(curve.values[0]), float(curve.values[-1])

    def listed(which: FloatArray) -> list[list[float | None]]:
        chosen = np.unique(which[evenly_spread(which.size, _MOST_BEYOND)]) if which.size else which
        bounds = _listed_bounds(curve.limits.around(empirical_cdf(values, chosen)))
        return [
            [_exact(value), *row]
            for value, row in zip(view.scale(output).from_si(chosen).tolist(), bounds, strict=True)
        ]

    (nothing,) = _listed_bounds(curve.limits.around(np.zeros(1)))
    return RunsBeyondAxis(
        runs=int(values.size),
        smallest=_exact(float(shown[0])),
        largest=_exact(float(shown[-1])),
        nothing=nothing,
        below=listed(values[shown < first]),
        above=listed(values[shown > last]),
    )


def _listed_bounds(band: FloatArray) -> list[list[float | None]]:
    """Return a function with its band as rows of numbers; None in place of NaN."""
    return [
        [round(value, 9) if math.isfinite(value) else None for value in row]
        for row in band.tolist()
    ]


def _exact(value: float) -> float:
    """Return a value in more digits than anybody types."""
    return float(f"{value:.12g}")
