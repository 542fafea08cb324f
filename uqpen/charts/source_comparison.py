"""One statistic by all sources, side by side, and the width of its intervals against runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.charts.axes import logarithmic_axis
from uqpen.charts.chart import Axis, Chart, Charts, LegendKey
from uqpen.charts.marks import (
    Dots,
    Line,
    Mark,
    Points,
    escape_text,
    has_interval,
    interval_notes,
    series_marker,
)
from uqpen.core.sampling import Sampling
from uqpen.core.statistic import Statistic
from uqpen.core.units import DIMENSIONLESS
from uqpen.execution import run_count
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import count_text, grouped_number
from uqpen.results.output_tables import runs_spent
from uqpen.results.source_statistics import (
    COMPARED,
    described_statistics,
    labelled_entries,
)
from uqpen.results.table import (
    NOTHING,
    Conversion,
    OutputTable,
    estimate_remark,
    identity,
    quantile_label,
    shown_estimate,
)
from uqpen.results.texts import title_with_unit, unit_suffix

# Rows of a chart, and what is around them, in CSS pixels.
_ROW, _FRAME = 22, 66
# Probabilities of one output among its main statistics.
_MOST_SHARES = 2

_HALF = "Half-width: half of an interval's length, also if its ends are not symmetric."
_ROUGH = (
    "independent draws needed for as narrow an interval: a rough estimate, the square of the ratio "
    "of two widths, without an interval"
)


def source_charts(view: ArchiveView) -> Iterator[Charts]:
    """Means, quantiles and probabilities by each source."""
    for output in (*view.numeric_outputs, *view.categorical_outputs):
        if found := available_statistics(view, output):
            yield comparison_charts(view, output, found, compared_sources(view, found))


class ComparedStatistic(NamedTuple):
    """A single statistic of an output, and its estimates by all sources."""

    statistic: Statistic
    label: str  # its name in tables
    convert: Conversion  # from SI to the unit that it is shown in
    estimates: Mapping[str, xr.DataArray]  # by source; along ``bound``

    @property
    def has_unit(self) -> bool:
        """True if it is in the unit of its output."""
        return self.convert is not identity

    @property
    def available_estimates(self) -> dict[str, xr.DataArray]:
        """The estimates that there are."""
        return {s: e for s, e in self.estimates.items() if np.isfinite(e.values[0])}


def compared_statistics(view: ArchiveView, output: str) -> Iterator[ComparedStatistic]:
    """Yield mean, standard deviation, quantiles, probabilities and shares of an output."""
    described = described_statistics(view.statistics, output)
    for statistic in (*COMPARED, *(each for each in described if each.shown.is_compared)):
        convert = view.conversion(output, statistic)
        for label, found in labelled_entries(statistic, view.estimates(output, statistic.name)):
            yield ComparedStatistic(statistic, label, convert, found)


def available_statistics(view: ArchiveView, output: str) -> list[ComparedStatistic]:
    """Return the statistics of an output that any source has an estimate of."""
    return [each for each in compared_statistics(view, output) if each.available_estimates]


def compared_sources(view: ArchiveView, found: Sequence[ComparedStatistic]) -> tuple[str, ...]:
    """Return the sources that have an estimate of any of some statistics."""
    return tuple(
        name for name in view.sources if any(name in each.available_estimates for each in found)
    )


def comparison_charts(
    view: ArchiveView, output: str, found: Sequence[ComparedStatistic], rows: tuple[str, ...]
) -> Charts:
    """Return a chart of each of some statistics, with a row for each source."""
    every = [estimate for each in found for estimate in each.available_estimates.values()]
    has_all = all(has_interval(each.values) for each in every)
    return Charts(
        charts=tuple(_comparison_chart(view, output, each, rows) for each in found),
        keys=() if has_all else (LegendKey("no interval", "ink", "circle-open"),),
        notes=tuple(interval_notes(every)),
    )


def _comparison_chart(
    view: ArchiveView, output: str, statistic: ComparedStatistic, rows: tuple[str, ...]
) -> Chart:
    dots: list[Dots] = []
    texts = []
    unit = view.unit(output) if statistic.has_unit else DIMENSIONLESS
    is_log = view.is_logarithmic(output) and statistic.has_unit
    for source, estimate in statistic.available_estimates.items():
        shown = shown_estimate(estimate, statistic.convert, is_logarithmic=is_log)
        texts.append(f"{source} {shown}{unit_suffix(unit)}")
        bounds = np.asarray([statistic.convert(estimate.values)], dtype=np.float64)
        place, position = [rows.index(source)], view.series(source)
        marker = series_marker(position)
        dots.append(Dots(bounds, place, position, hovers=texts[-1:], name=source, marker=marker))
    return Chart(
        title=statistic.label,
        summary=f"Of {output_title(view, output)}: {'; '.join(texts)}.",
        x=Axis(title_with_unit(statistic.label, unit)),
        y=Axis("", rows=rows),
        marks=tuple(dots),
        height=_FRAME + _ROW * len(rows),
        of=output,
    )


class _IntervalWidth(NamedTuple):
    """Half the length of a source's interval, in the unit that is shown, and its runs."""

    runs: int
    half: float
    estimate: xr.DataArray


# A statistic and the intervals that there are of it, by source.
_ComparedWidths = tuple[ComparedStatistic, Mapping[str, _IntervalWidth]]


def main_statistics(found: Sequence[ComparedStatistic]) -> list[ComparedStatistic]:
    """Return mean, median, and the first probabilities among statistics."""
    thresholds = [each for each in found if each.statistic.shown.has_verdict]
    shares = [each for each in found if each.statistic.shown.axis == "share"]
    by_label = {each.label: each for each in found}
    first = [by_label[label] for label in ("mean", quantile_label(0.5)) if label in by_label]
    return [*first, *thresholds[:1], *shares[:_MOST_SHARES]]


def interval_cost_charts(
    view: ArchiveView, output: str, found: Sequence[ComparedStatistic]
) -> list[Charts]:
    """Return the charts of widths against the runs that they took, if there are any to compare.

    Their table has the number of independent draws for as narrow an interval.
    """
    compared: list[_ComparedWidths] = []
    for statistic in main_statistics(found):
        widths = {}
        for source, estimate in statistic.available_estimates.items():
            _, lower, upper = (float(bound) for bound in statistic.convert(estimate.values))
            runs = runs_spent(view.tree, source)
            if runs and 0 < upper - lower < math.inf:
                widths[source] = _IntervalWidth(runs, (upper - lower) / 2, estimate)
        if len(widths) > 1:
            compared.append((statistic, widths))
    if not compared:
        return []
    plain = next(
        (name for name in view.designs if view.design(name).sampling is Sampling.INDEPENDENT), ""
    )
    shown = {source for _, widths in compared for source in widths}
    sources = [source for source in view.sources if source in shown]
    keys = []
    for source in sources:
        position = view.series(source)
        keys.append(LegendKey(source, position, series_marker(position)))
    guide = f"as 1/√runs, from {plain}"
    if plain in shown:
        keys.append(LegendKey(guide, "quiet", "line", "dot"))
    notes = [_HALF]
    available = {source for each in found for source in each.available_estimates}
    if others := [source for source in view.sources if source in available - shown]:
        notes.append(f"No interval, so not shown: {', '.join(others)}.")
    charts = Charts(
        charts=tuple(_width_chart(view, output, *each, plain, guide) for each in compared),
        keys=tuple(keys),
        notes=tuple(notes),
        tables=(_cost_table(view, output, compared, sources, plain),) * (plain in shown),
    )
    return [charts]


def _width_chart(
    view: ArchiveView,
    output: str,
    statistic: ComparedStatistic,
    widths: Mapping[str, _IntervalWidth],
    plain: str,
    guide: str,
) -> Chart:
    """One statistic: half the length of its intervals against the runs that they took."""
    unit = view.unit(output) if statistic.has_unit else DIMENSIONLESS
    marks: list[Mark] = []
    heights, runs = [each.half for each in widths.values()], [each.runs for each in widths.values()]
    if (first := widths.get(plain)) is not None:
        ends = np.array([min(runs), max(runs)], dtype=np.float64)
        half = first.half * np.sqrt(first.runs / ends)
        heights += half.tolist()
        hover = escape_text(guide, 200)
        marks.append(Line(ends, half, "quiet", hover=hover, name="guide", dash="dot", width=1.5))
    texts = []
    for source, each in widths.items():
        width = f"half-width {_half_width_text(each.half)}{unit_suffix(unit)}"
        texts.append(f"{source}: {width} with {count_text(each.runs, 'run')}")
        position = view.series(source)
        marks.append(
            Points(
                [each.runs],
                [each.half],
                position,
                hover=escape_text(texts[-1], 200),
                name=source,
                marker=series_marker(position),
                size=10,
                opacity=1,
            )
        )
    return Chart(
        title=f"Width of the interval: {statistic.label}",
        summary=f"{'; '.join(texts)}.",
        x=logarithmic_axis("runs spent", runs),
        y=logarithmic_axis(title_with_unit("half-width", unit), heights),
        marks=tuple(marks),
        height=260,
        of=output,
    )


def _half_width_text(half: float) -> str:
    power = math.floor(math.log10(half))
    return f"{half:.{max(0, 1 - power)}f}" if -5 <= power < 6 else f"{half:.1e}"


def _cost_table(
    view: ArchiveView,
    output: str,
    compared: Sequence[_ComparedWidths],
    sources: Sequence[str],
    plain: str,
) -> OutputTable:
    title = "Cost of an interval: its half-width, and the independent draws needed for it"
    table = OutputTable(title, ["runs"])
    for statistic, _ in compared:
        unit = view.unit(output) if statistic.has_unit else DIMENSIONLESS
        table.columns += [title_with_unit(f"{statistic.label}, half-width", unit), "draws"]
    for source in sources:
        spent = runs_spent(view.tree, source) or 0
        sampled = run_count(view.design(source).runs) if source in view.designs else spent
        note = f"{grouped_number(sampled)} of them are a sample; the others are for its indices"
        cells = [grouped_number(spent) + table.note_mark(note * (sampled < spent))]
        for _, widths in compared:
            cells += _cells(widths.get(source), widths.get(plain), table)
        table.rows.append((source, cells))
    return table


def _cells(
    width: _IntervalWidth | None, plain: _IntervalWidth | None, table: OutputTable
) -> list[str]:
    """A half-width, and the number of independent draws for as narrow an interval."""
    if width is None:
        return [NOTHING, NOTHING]
    half = f"{_half_width_text(width.half)}{table.note_mark(estimate_remark(width.estimate))}"
    if plain is None:
        return [half, NOTHING]
    if width is plain:
        return [half, grouped_number(plain.runs)]
    draws = plain.runs * (plain.half / width.half) ** 2
    rounded = int(float(f"{draws:.2g}"))
    return [half, f"≈ {grouped_number(rounded)}{table.note_mark(_ROUGH)}"]
