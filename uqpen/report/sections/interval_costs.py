"""Cost of an interval: its width against the runs that a source took."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.charts.axes import logarithmic_axis
from uqpen.charts.chart import Block, Chart, Charts, LegendKey
from uqpen.charts.marks import Line, Mark, Points, escape_text, series_marker
from uqpen.charts.source_comparison import ComparedStatistic
from uqpen.core.sampling import Sampling
from uqpen.core.units import DIMENSIONLESS
from uqpen.execution import run_count
from uqpen.report.blocks import Table
from uqpen.report.counting import count_text
from uqpen.report.sections.quoted_statistics import share_label
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number
from uqpen.results.output_tables import runs_spent
from uqpen.results.statistic_entries import THRESHOLD_PROBABILITIES
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    entry_label,
    estimate_remark,
    identity,
    quantile_label,
)
from uqpen.results.texts import title_with_unit, unit_suffix

__all__ = ["interval_costs", "main_statistics"]

# Probabilities of one output that are shown.
_MOST_SHARES = 2

_ROUGH = (
    "independent draws needed for as narrow an interval: a rough estimate, the square of the ratio "
    "of two widths, without an interval"
)
_HALF = "Half-width: half of an interval's length, also if its ends are not symmetric."


class _Width(NamedTuple):
    """Half the length of a source's interval, in the unit that is shown, and its runs."""

    runs: int
    half: float
    estimate: xr.DataArray


# A statistic and the intervals that there are of it, by source.
_ComparedWidths = tuple[ComparedStatistic, Mapping[str, _Width]]


def interval_costs(
    view: ArchiveView, output: str, found: Sequence[ComparedStatistic]
) -> Iterator[Block]:
    """Widths of intervals against runs, where there are several to be compared."""
    every = ((each, _widths(view, each)) for each in main_statistics(view, output, found))
    compared = [(statistic, widths) for statistic, widths in every if len(widths) > 1]
    if not compared:
        return
    plain = _independent_design(view)
    shown = {source for _, widths in compared for source in widths}
    sources = [source for source in view.sources if source in shown]
    available = {source for each in found for source in each.available_estimates}
    others = [source for source in view.sources if source in available - shown]
    keys = [_key(view, source) for source in sources]
    if plain in shown:
        keys.append(LegendKey(_guide(plain), "quiet", "line", "dot"))
    notes = [_HALF]
    if others:
        notes.append(f"No interval, so not shown: {', '.join(others)}.")
    yield Charts(
        charts=tuple(_chart(view, output, each, plain) for each in compared),
        keys=tuple(keys),
        notes=tuple(notes),
    )
    if plain in shown:
        yield Table(_table(view, output, compared, sources, plain))


def main_statistics(
    view: ArchiveView, output: str, found: Sequence[ComparedStatistic]
) -> list[ComparedStatistic]:
    """Return mean, median, and the first probabilities among statistics."""
    by_label = {each.label: each for each in found}
    thresholds = [
        entry_label(statistic, entry)
        for statistic in THRESHOLD_PROBABILITIES
        for entry in _entries(view, output, statistic.name, statistic.dims[0])
    ]
    shares = map(share_label, _entries(view, output, "share", "category_label"))
    first = [label for label in thresholds if label in by_label][:1]
    kinds = [label for label in shares if label in by_label][:_MOST_SHARES]
    labels = ("mean", quantile_label(0.5), *first, *kinds)
    return [by_label[label] for label in labels if label in by_label]


def _entries(view: ArchiveView, output: str, statistic: str, along: str) -> list[str]:
    statistics = view.statistics
    arrays = (statistics.get(source, output, statistic) for source in view.sources)
    first = next((array for array in arrays if array is not None), None)
    return [] if first is None else [str(each) for each in first[along].values.tolist()]


def _widths(view: ArchiveView, statistic: ComparedStatistic) -> dict[str, _Width]:
    widths = {}
    for source, estimate in statistic.available_estimates.items():
        _, lower, upper = (float(bound) for bound in statistic.convert(estimate.values))
        runs = runs_spent(view.tree, source)
        if runs and 0 < upper - lower < math.inf:
            widths[source] = _Width(runs, (upper - lower) / 2, estimate)
    return widths


def _independent_design(view: ArchiveView) -> str:
    return next((n for n in view.designs if view.design(n).sampling is Sampling.INDEPENDENT), "")


def _key(view: ArchiveView, source: str) -> LegendKey:
    position = view.series(source)
    return LegendKey(source, position, series_marker(position))


def _guide(plain: str) -> str:
    return f"as 1/√runs, from {plain}"


def _chart(view: ArchiveView, output: str, compared: _ComparedWidths, plain: str) -> Chart:
    """One statistic: half the length of its intervals against the runs that they took."""
    statistic, widths = compared
    unit = _unit(view, output, statistic)
    shown = unit_suffix(unit)
    traces: list[Mark] = []
    heights, runs = [each.half for each in widths.values()], [each.runs for each in widths.values()]
    if (first := widths.get(plain)) is not None:
        ends = np.array([min(runs), max(runs)], dtype=np.float64)
        half = first.half * np.sqrt(first.runs / ends)
        heights += half.tolist()
        hover = escape_text(_guide(plain), 200)
        traces.append(Line(ends, half, "quiet", hover=hover, name="guide", dash="dot", width=1.5))
    texts = []
    for source, each in widths.items():
        key = _key(view, source)
        width = f"half-width {_two_digits(each.half)}{shown}"
        texts.append(f"{source}: {width} with {count_text(each.runs, 'run')}")
        traces.append(
            Points(
                [each.runs],
                [each.half],
                key.series,
                hover=escape_text(texts[-1], 200),
                name=source,
                marker=key.mark,
                size=10,
                opacity=1,
            )
        )
    return Chart(
        title=f"Width of the interval: {statistic.label}",
        summary=f"{'; '.join(texts)}.",
        x=logarithmic_axis("runs spent", runs),
        y=logarithmic_axis(title_with_unit("half-width", unit), heights),
        marks=tuple(traces),
        height=260,
    )


def _two_digits(half: float) -> str:
    power = math.floor(math.log10(half))
    return f"{half:.{max(0, 1 - power)}f}" if -5 <= power < 6 else f"{half:.1e}"


def _unit(view: ArchiveView, output: str, statistic: ComparedStatistic) -> str:
    return DIMENSIONLESS if statistic.convert is identity else view.unit(output)


def _table(
    view: ArchiveView,
    output: str,
    compared: Sequence[_ComparedWidths],
    sources: Sequence[str],
    plain: str,
) -> OutputTable:
    title = "Cost of an interval: its half-width, and the independent draws needed for it"
    table = OutputTable(title, ["runs"])
    for statistic, _ in compared:
        unit = _unit(view, output, statistic)
        table.columns += [title_with_unit(f"{statistic.label}, half-width", unit), "draws"]
    for source in sources:
        cells = [_runs(view, source, table)]
        for _, widths in compared:
            cells += _cells(widths.get(source), widths.get(plain), table)
        table.rows.append((source, cells))
    return table


def _runs(view: ArchiveView, source: str, table: OutputTable) -> str:
    """The runs of a source, and the number of those in the sample."""
    spent = runs_spent(view.tree, source) or 0
    sampled = spent
    if source in view.designs:
        sampled = run_count(view.design(source).runs)
    note = f"{grouped_number(sampled)} of them are a sample; the others are for its indices"
    return grouped_number(spent) + table.note_mark(note * (sampled < spent))


def _cells(width: _Width | None, plain: _Width | None, table: OutputTable) -> list[str]:
    """A half-width, and the number of independent draws for as narrow an interval."""
    if width is None:
        return [NOTHING, NOTHING]
    half = f"{_two_digits(width.half)}{table.note_mark(estimate_remark(width.estimate))}"
    if plain is None:
        return [half, NOTHING]
    if width is plain:
        return [half, grouped_number(plain.runs)]
    draws = plain.runs * (plain.half / width.half) ** 2
    rounded = int(float(f"{draws:.2g}"))
    return [half, f"≈ {grouped_number(rounded)}{table.note_mark(_ROUGH)}"]
