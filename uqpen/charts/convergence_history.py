"""Convergence of estimates as runs are added."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.charts.axes import logarithmic_axis, padded_limits
from uqpen.charts.chart import Axis, Chart, Charts, LegendKey
from uqpen.charts.marks import Dots, Rule, all_bounded, has_interval, series_marker
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import BY_RUNS, INTERVAL_LEVEL, REPLICATE, RUNS, RUNS_SO_FAR, STOPPING_NOTE
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.core.units import DIMENSIONLESS
from uqpen.execution import replicate_count, run_count
from uqpen.results.acceptance import unseen_text
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import count_text, grouped_number, percent_text
from uqpen.results.table import (
    Conversion,
    OutputTable,
    entry_label,
    shown_estimate,
)
from uqpen.results.texts import capitalized, title_with_unit, unit_suffix

# Categories of an output that are drawn.
_MOST_CATEGORIES = 3
# Widths of the last interval that an axis goes to on either side; wider ones are cut off.
_WIDEST = 12

_SHARED = (
    "The runs of each point are among those of the next. So points are not independent of each "
    "other, and vary less than separate samples would."
)
_FIXED = (
    "An interval has its nominal coverage for a number of runs that is fixed beforehand. If you "
    "make runs until it looks good, its coverage is lower."
)
_CUT = "The widest intervals extend beyond the axis; the table has their ends."


class _EstimateHistory(NamedTuple):
    """A statistic along the runs so far."""

    label: str
    unit: str
    convert: Conversion
    estimates: xr.DataArray

    @property
    def runs(self) -> list[int]:
        """The runs so far."""
        return [int(size) for size in self.estimates[RUNS_SO_FAR].values]

    @property
    def bounds(self) -> FloatArray:
        """Estimate, lower, upper for each, in the unit that is shown."""
        return np.asarray(self.convert(self.estimates.values), dtype=np.float64)


def convergence_charts(view: ArchiveView) -> Iterator[Charts]:
    """Estimates from growing parts of the runs of one design."""
    design = view.leading_design
    if design is None or view.design(design).reason_without_convergence:
        return
    runs = read_group(view.tree, RUNS, design)
    note, unseen = runs.attrs.get(STOPPING_NOTE), unseen_text(runs)
    remarks = [f"{capitalized(str(each))}." for each in (note, unseen) if each] or [_FIXED]
    notes = (_design_sentence(view, design), _SHARED, *remarks)
    for output in (*view.numeric_outputs, *view.categorical_outputs):
        arrays = view.statistics.statistics(design, output)
        if histories := list(_estimate_histories(view, output, arrays)):
            charts = _history_charts(view, output, design, histories)
            yield replace(charts, notes=notes)


def _design_sentence(view: ArchiveView, design: str) -> str:
    runs = read_group(view.tree, RUNS, design)
    drawn = view.design(design).runs
    runs_text = count_text(run_count(drawn), "run")
    if run_count(drawn) < run_count(runs):
        runs_text += " that are a sample"
    place = (
        "the first of the study that is a sample of the inputs"
        if view.is_sample_design(design)
        else "as no other design is a sample of the inputs"
    )
    if REPLICATE in drawn.coords:
        count = replicate_count(drawn)
        parts = (
            f"{count} independent replicates. Each part has the first few of these: less than a "
            "whole replicate would not be a sample of the same type."
        )
    else:
        parts = "independent draws. Each part has the first few of these."
    return f"By {design}, the design of the main results, {place}. Its {runs_text} are {parts}"


def _estimate_histories(
    view: ArchiveView, output: str, statistics: Mapping[str, xr.DataArray]
) -> Iterator[_EstimateHistory]:
    has_threshold = False
    for each in (each for each in CATALOGUE.values() if each.prefix == BY_RUNS):
        of, array = CATALOGUE[each.of], statistics.get(each.name)
        # One threshold is enough, be it one to exceed or one to lie below.
        if array is None or (of.shown.has_verdict and has_threshold):
            continue
        has_threshold = has_threshold or of.shown.has_verdict
        unit = DIMENSIONLESS if of.unit is UnitRule.NONE else view.unit(output)
        for label, entry in _shown_entries(of, array):
            history = _EstimateHistory(label, unit, view.conversion(output, of), entry)
            if np.isfinite(history.bounds[:, 0]).any():
                yield history


def _shown_entries(of: Statistic, array: xr.DataArray) -> Iterator[tuple[str, xr.DataArray]]:
    """Yield the entries that are drawn: of quantiles the median, or else the first and the last."""
    if not of.dims:
        yield entry_label(of, ""), array
        return
    entries = array[of.shown.coordinate or of.dims[0]].values.tolist()
    places: Sequence[int] = range(len(entries))[: 1 if of.shown.has_verdict else _MOST_CATEGORIES]
    if of.shown.entry == "probability":
        ends = sorted({0, len(entries) - 1})
        places = [entries.index(0.5)] if 0.5 in entries else ends
    for place in places:
        yield entry_label(of, entries[place]), array[{of.dims[0]: place}]


def _history_charts(
    view: ArchiveView, output: str, design: str, histories: Sequence[_EstimateHistory]
) -> Charts:
    charts = [_chart(view, output, design, history) for history in histories]
    position = view.series(design)
    every = np.concatenate([history.bounds for history in histories])
    keys = [LegendKey("by all runs", "quiet", "line", "dot")]
    if not all_bounded(every):
        keys.insert(0, LegendKey("no interval", position, f"{series_marker(position)}-open"))
    if has_interval(every).any():
        levels = (each.estimates.attrs.get(INTERVAL_LEVEL) for each in histories)
        covered = percent_text(next(filter(None, levels)))
        keys.insert(0, LegendKey(f"with its {covered} interval", position, series_marker(position)))
    columns = [title_with_unit(history.label, history.unit) for history in histories]
    table = OutputTable(f"{output_title(view, output)} by {design}, by its runs so far", columns)
    for number, runs in enumerate(histories[0].runs):
        cells = [table.cell(history.estimates[number], history.convert) for history in histories]
        table.rows.append((grouped_number(runs), cells))
    return Charts(charts=tuple(charts), keys=tuple(keys), tables=(table,))


def _chart(view: ArchiveView, output: str, design: str, history: _EstimateHistory) -> Chart:
    position = view.series(design)
    marker = series_marker(position)
    bounds, runs, unit = history.bounds, history.runs, unit_suffix(history.unit)
    # All estimates fit between the limits, which cut off wide intervals.
    estimates = bounds[np.isfinite(bounds[:, 0]), 0]
    last = bounds[-1]
    half = np.nanmax(np.abs(last[1:] - last[0])) if np.isfinite(last[1:]).any() else np.inf
    sides = bounds[:, 1:][np.isfinite(bounds[:, 1:])]
    kept = np.clip(sides, last[0] - _WIDEST * half, last[0] + _WIDEST * half) if half else sides
    lower, upper = min([*estimates, *kept]), max([*estimates, *kept])
    is_cut = bool((sides < lower).any() or (sides > upper).any())
    texts = [
        f"{count_text(size, 'run')}: {shown_estimate(estimate, history.convert)}{unit}"
        for size, estimate in zip(runs, history.estimates, strict=True)
    ]
    trace = Dots(bounds, runs, position, hovers=texts, name=history.label, marker=marker, along="y")
    middle = len(texts) // 2
    return Chart(
        title=history.label,
        summary=f"{capitalized(output_title(view, output))} by {design}, "
        f"{texts[0]}; {texts[middle]}; {texts[-1]}.",
        x=logarithmic_axis("runs so far", runs),
        y=Axis(
            title_with_unit(history.label, history.unit),
            padded_limits(float(lower), float(upper), 0.05),
        ),
        marks=(trace, Rule(float(bounds[-1, 0]), "quiet", "dot", is_horizontal=True)),
        notes=(_CUT,) if is_cut else (),
        height=260,
        of=output,
    )
