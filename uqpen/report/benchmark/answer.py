"""Best methods by statistic and number of runs, and the caveats on them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import islice

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.charts.chart import Axis, Block, Chart, Charts
from uqpen.charts.marks import Mark, Points, series_marker
from uqpen.core.labels import METHODS, SINGLE
from uqpen.report.benchmark.section_elements import (
    MOST_CHARTS,
    benchmark_output_heading,
    entries_by_output,
    method_keys,
    reference_run_counts,
)
from uqpen.report.blocks import Quote, Remarks, Table, Text
from uqpen.results.benchmark_entries import BenchmarkEntry, entries
from uqpen.results.benchmark_methods import ArchivedMethod, benchmark_budgets, benchmark_methods
from uqpen.results.benchmark_tables import (
    IS_DOUBTFUL,
    IS_LEVEL,
    WINS,
    entry_comparisons,
    has_reference,
    standing_mark,
    standings_table,
)
from uqpen.results.digits import grouped_number
from uqpen.results.texts import join_names

__all__ = ["answer"]

# Texts of a method's standing in a sentence: at first, and further on.
_STANDING_TEXTS = {
    WINS: ("leads all others by more than the noise in {}", "leads in {}"),
    IS_LEVEL: ("is level with the best in {}", "is level in {}"),
    IS_DOUBTFUL: ("is ahead, but not with certainty, in {}", "is ahead, not with certainty, in {}"),
}

# Sizes of the markers, and how far apart those are that share a place, in rows or columns.
_ALONE, _TOGETHER, _APART = 13.0, 7.0, 0.17
_ROW, _FRAME = 30, 70


def answer(tree: xr.DataTree) -> Iterator[Block]:
    """The leading methods: in sentences to quote, and by output and statistic."""
    sentences = tuple(_standing_sentences(tree))
    if sentences:
        yield Quote(sentences)
    elif has_reference(tree):
        yield Text("No two methods have estimates to compare.")
    if caveats := tuple(_caveat_sentences(tree)):
        yield Remarks("What to keep in mind", caveats)
    if not sentences:
        return
    yield Table(standings_table(tree))
    outputs = entries_by_output(tree)
    omitted = []
    if len(outputs) > MOST_CHARTS:
        count = len(outputs)
        omitted = [f"The first {MOST_CHARTS} of {count} outputs; the verdicts below cover all."]
    yield Charts(
        tuple(_leaders(tree, *each) for each in islice(outputs.items(), MOST_CHARTS)),
        keys=method_keys(benchmark_methods(tree, SINGLE)),
        notes=(
            "One filled marker: this method leads all others by more than the noise. Several side "
            "by side: they are level. A hollow one: this method is ahead, but its lead is "
            "uncertain and has no interval. None: no two methods have estimates to compare.",
            *omitted,
        ),
    )
    yield from _verdict_blocks(tree)


def _standing_sentences(tree: xr.DataTree) -> Iterator[str]:
    """Yield a sentence for each number of runs with a verdict."""
    found = [entry.single_set_standings for entry in entries(tree)]
    of = f"{len(found)} statistic{'s' if len(found) > 1 else ''}"
    for column, budget in enumerate(benchmark_budgets(tree)):
        texts = list(_method_standings(tree, [standings[column] for standings in found]))
        if texts:
            yield f"At {grouped_number(budget)} runs, of {of}, {'; '.join(texts)}."


def _method_standings(tree: xr.DataTree, found: list[tuple[str, float]]) -> Iterator[str]:
    """Yield a statement on each method at a number of runs, the best first."""
    counted = {
        method.source: Counter(standing_mark(method.source, *contest) for contest in found)
        for method in benchmark_methods(tree, SINGLE)
    }
    ranked = sorted(counted, key=lambda name: [-counted[name][mark] for mark in _STANDING_TEXTS])
    known: set[str] = set()
    for name in ranked:
        marks = [mark for mark in _STANDING_TEXTS if counted[name][mark]]
        parts = [_STANDING_TEXTS[mark][mark in known].format(counted[name][mark]) for mark in marks]
        known.update(marks)
        if parts:
            yield f"{name} {join_names(parts)}"


def _caveat_sentences(tree: xr.DataTree) -> Iterator[str]:
    yield from _reference_caveats(tree)
    if not has_reference(tree):
        return
    found = list(entries(tree))
    notes = [str(note) for each in found for note in each.variable("remark").values[0]]
    for note, count in Counter(filter(None, notes)).items():
        yield f"For {count} of {len(notes)} verdicts: {note}."
    marks = [_is_doubtful(*contest) for each in found for contest in each.single_set_standings]
    if any(marks):
        yield (
            f"In {sum(marks)} of {len(marks)} comparisons the lead is uncertain: few of the "
            "repeats decide it, or the errors are no larger than the reference's own."
        )
    yield from _absent_methods(tree)
    if without := sum(map(_count_without_error, found)):
        yield (
            f"{without} {'error is' if without == 1 else 'errors are'} unknown, as some repeat "
            "has no estimate, or the reference has none."
        )
    yield from dict.fromkeys(
        f"Intervals of errors: {note}." for each in found for note in each.error_notes
    )


def _reference_caveats(tree: xr.DataTree) -> Iterator[str]:
    run_count, used = reference_run_counts(tree)
    if not used:
        yield "All runs of the reference failed, so all errors are unknown."
    elif used < run_count:
        failed = f"{grouped_number(run_count - used)} of {grouped_number(run_count)} runs"
        yield f"{failed} of the reference failed; its estimates use the others."


def _is_doubtful(level: str, lowest: float) -> bool:
    first = level.partition(" ")[0]
    return standing_mark(first, level, lowest) == IS_DOUBTFUL if first else False


def _absent_methods(tree: xr.DataTree) -> Iterator[str]:
    runs = read_group(tree, METHODS)["runs"].values
    for method in benchmark_methods(tree, SINGLE):
        counts = zip(benchmark_budgets(tree), runs[method.position].tolist(), strict=True)
        if where := [grouped_number(budget) for budget, count in counts if not count]:
            yield f"{method.source} takes no part at {join_names(where)} runs."


def _count_without_error(entry: BenchmarkEntry) -> int:
    """Return the number of methods that made their runs, as single sets, but have no error."""
    errors = entry.variable("error").values[..., 0]
    takes_part = read_group(entry.tree, METHODS)["runs"].values > 0
    single = [method.position for method in benchmark_methods(entry.tree, SINGLE)]
    return int((np.isnan(errors) & takes_part)[single].sum())


def _leaders(tree: xr.DataTree, output: str, found: list[BenchmarkEntry]) -> Chart:
    """The leading methods: a row for each statistic, a column for each number of runs."""
    budgets = benchmark_budgets(tree)
    rows = tuple(entry.label for entry in found)
    ends = (-0.5, len(budgets) - 0.5)
    ticks = tuple((float(place), grouped_number(budget)) for place, budget in enumerate(budgets))
    best = [(entry.label, entry.single_set_standings[-1][0].split()) for entry in found]
    texts = [f"{label}: {join_names(names)}" for label, names in best if names]
    return Chart(
        title=f"Who leads in {benchmark_output_heading(tree, output)}",
        summary=f"Nearest to the reference at {grouped_number(budgets[-1])} runs: "
        f"{'; '.join(texts) or 'none'}. The other numbers of runs are in the sentences below.",
        x=Axis("runs", ends, ticks=ticks),
        y=Axis("", rows=rows),
        marks=tuple(_leader_markers(method, found) for method in benchmark_methods(tree, SINGLE)),
        height=_FRAME + _ROW * len(rows),
    )


def _leader_markers(method: ArchivedMethod, found: list[BenchmarkEntry]) -> Mark:
    marker = series_marker(method.series)
    marks: list[tuple[float, float, str, float, str]] = []
    for row, entry in enumerate(found):
        texts = entry.variable("verdict").values[0].tolist()
        for column, (level, lowest) in enumerate(entry.single_set_standings):
            names = level.split()
            mark = standing_mark(method.source, level, lowest)
            if mark in _STANDING_TEXTS:
                step = min(_APART, 0.8 / len(names))
                place = column + (names.index(method.source) - (len(names) - 1) / 2) * step
                symbol = f"{marker}-open" if mark == IS_DOUBTFUL else marker
                size = _TOGETHER if mark == IS_LEVEL else _ALONE
                text = f"{entry.label}: {texts[column]}"
                marks.append((place, float(row), symbol, size, text))
    x, y, symbols, sizes, hovers = zip(*marks, strict=True) if marks else ((), (), (), (), ())
    return Points(
        x,
        y,
        method.series,
        hover="%{text}",
        name=method.source,
        texts=hovers,
        marker=symbols,
        size=sizes,
        opacity=1.0,
        outline=[2 if symbol.endswith("-open") else 0 for symbol in symbols],
    )


def _verdict_blocks(tree: xr.DataTree) -> Iterator[Block]:
    lines: dict[str, list[str]] = {}
    for comparison in entry_comparisons(tree):
        entry = comparison.entry
        line = f"{entry.label}: {'; '.join(comparison.verdicts)}."
        lines.setdefault(entry.output, []).append(line)
    for output, found in lines.items():
        yield Remarks(
            f"In words: {benchmark_output_heading(tree, output)}", tuple(found), is_folded=True
        )
