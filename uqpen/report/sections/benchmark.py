"""Sections of a benchmark of methods: leaders, errors, rates, coverage, cost, the reference."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from uqpen.archive.estimates import interval_text
from uqpen.charts.chart import Axis, Block, Chart, Charts
from uqpen.charts.marks import Mark, Points, series_marker
from uqpen.charts.method_comparison import (
    SLOPE_NOTE,
    coverage_note,
    error_chart,
    error_keys,
    method_keys,
    of_coverage,
    of_slopes,
)
from uqpen.core.labels import INTERVAL, NOTE, REPLICATED, SINGLE
from uqpen.core.units import scale
from uqpen.report.blocks import Heading, Quote, Remarks, Table, Text
from uqpen.results.archive_view import ArchiveView, output_heading
from uqpen.results.digits import count_text, grouped_number, number_text
from uqpen.results.method_comparison import (
    IS_DOUBTFUL,
    IS_LEVEL,
    LEGEND,
    WINS,
    ComparedEntry,
    ComparedMethod,
    MethodComparison,
    entry_table,
    methods_table,
    percentage_text,
    single_set_verdicts,
    standing_mark,
    standings_table,
)
from uqpen.results.table import NOTHING, OutputTable, estimate_remark
from uqpen.results.texts import join_names, unit_suffix

# A page shows the first of more charts, with a note.
_MOST_CHARTS = 24

# Texts of a method's standing in a sentence: at first, and further on.
_STANDING_TEXTS = {
    WINS: ("leads all others by more than the noise in {}", "leads in {}"),
    IS_LEVEL: ("is level with the best in {}", "is level in {}"),
    IS_DOUBTFUL: ("is ahead, but not with certainty, in {}", "is ahead, not with certainty, in {}"),
}

# Sizes of the markers, and how far apart those are that share a place, in rows or columns.
_ALONE, _TOGETHER, _APART = 13.0, 7.0, 0.17
_ROW, _FRAME = 30, 70


def leaders(view: ArchiveView) -> Iterator[Block]:
    """The leading methods: in sentences to quote, and by output and statistic."""
    comparison = MethodComparison(view)
    sentences = tuple(_standing_sentences(comparison))
    if sentences:
        yield Quote(sentences)
    elif comparison.reference_runs_used:
        yield Text("No two methods have estimates to compare.")
    if caveats := tuple(_caveat_sentences(comparison)):
        yield Remarks("What to keep in mind", caveats)
    if not sentences:
        return
    yield Table(standings_table(comparison))
    outputs = comparison.by_output
    omitted = []
    if len(outputs) > _MOST_CHARTS:
        count = len(outputs)
        omitted = [f"The first {_MOST_CHARTS} of {count} outputs; the verdicts below cover all."]
    yield Charts(
        tuple(_leaders(comparison, *each) for each in islice(outputs.items(), _MOST_CHARTS)),
        keys=method_keys(comparison.methods_in(SINGLE)),
        notes=(
            "One filled marker: this method leads all others by more than the noise. Several side "
            "by side: they are level. A hollow one: this method is ahead, but its lead is "
            "uncertain and has no interval. None: no two methods have estimates to compare.",
            *omitted,
        ),
    )
    for output, found in outputs.items():
        lines = (f"{each.label}: {'; '.join(single_set_verdicts(each))}." for each in found)
        head = f"In words: {output_heading(comparison.view, output)}"
        yield Remarks(head, tuple(lines), is_folded=True)


def _standing_sentences(comparison: MethodComparison) -> Iterator[str]:
    """Yield a sentence for each number of runs with a verdict."""
    found = [entry.single_set_standings for entry in comparison.entries]
    of = count_text(len(found), "statistic")
    for column, budget in enumerate(comparison.budgets):
        texts = list(_method_standings(comparison, [standings[column] for standings in found]))
        if texts:
            yield f"At {grouped_number(budget)} runs, of {of}, {'; '.join(texts)}."


def _method_standings(
    comparison: MethodComparison, found: list[tuple[str, float]]
) -> Iterator[str]:
    """Yield a statement on each method at a number of runs, the best first."""
    counted = {
        method.source: Counter(standing_mark(method.source, *contest) for contest in found)
        for method in comparison.methods_in(SINGLE)
    }
    ranked = sorted(counted, key=lambda name: [-counted[name][mark] for mark in _STANDING_TEXTS])
    known: set[str] = set()
    for name in ranked:
        marks = [mark for mark in _STANDING_TEXTS if counted[name][mark]]
        parts = [_STANDING_TEXTS[mark][mark in known].format(counted[name][mark]) for mark in marks]
        known.update(marks)
        if parts:
            yield f"{name} {join_names(parts)}"


def _caveat_sentences(comparison: MethodComparison) -> Iterator[str]:
    run_count, used = comparison.reference_runs, comparison.reference_runs_used
    if not used:
        yield "All runs of the reference failed, so all errors are unknown."
        return
    if used < run_count:
        failed = f"{grouped_number(run_count - used)} of {grouped_number(run_count)} runs"
        yield f"{failed} of the reference failed; its estimates use the others."
    found = comparison.entries
    notes = [str(note) for each in found for note in each.finding("remark").values[0]]
    for note, count in Counter(filter(None, notes)).items():
        yield f"For {count} of {len(notes)} verdicts: {note}."
    contests = [contest for each in found for contest in each.single_set_standings]
    firsts = (standing_mark(level.partition(" ")[0], level, lead) for level, lead in contests)
    if doubtful := list(firsts).count(IS_DOUBTFUL):
        yield (
            f"In {doubtful} of {len(contests)} comparisons the lead is uncertain: few of the "
            "repeats decide it, or the errors are no larger than the reference's own."
        )
    for method in comparison.methods_in(SINGLE):
        counts = zip(comparison.budgets, method.runs, strict=True)
        if where := [grouped_number(budget) for budget, count in counts if not count]:
            yield f"{method.source} takes no part at {join_names(where)} runs."
    without = sum(
        runs > 0 and math.isnan(error)
        for each in found
        for method in comparison.methods_in(SINGLE)
        for runs, error in zip(method.runs, each.of(method, "error").values[:, 0], strict=True)
    )
    if without:
        yield (
            f"{without} {'error is' if without == 1 else 'errors are'} unknown, as some repeat "
            "has no estimate, or the reference has none."
        )
    errors = (each.of(method, "error") for each in found for method in comparison.methods)
    notes = [note for error in errors for note in np.ravel(error.coords[NOTE].values).tolist()]
    yield from (f"Intervals of errors: {note}." for note in dict.fromkeys(filter(None, notes)))


def _leaders(comparison: MethodComparison, output: str, found: list[ComparedEntry]) -> Chart:
    """The leading methods: a row for each statistic, a column for each number of runs."""
    budgets = comparison.budgets
    rows = tuple(entry.label for entry in found)
    ends = (-0.5, len(budgets) - 0.5)
    ticks = tuple((float(place), grouped_number(budget)) for place, budget in enumerate(budgets))
    best = [(entry.label, entry.single_set_standings[-1][0].split()) for entry in found]
    texts = [f"{label}: {join_names(names)}" for label, names in best if names]
    return Chart(
        title=f"Who leads in {output_heading(comparison.view, output)}",
        summary=f"Nearest to the reference at {grouped_number(budgets[-1])} runs: "
        f"{'; '.join(texts) or 'none'}. The other numbers of runs are in the sentences below.",
        x=Axis("runs", ends, ticks=ticks),
        y=Axis("", rows=rows),
        marks=tuple(_leader_markers(method, found) for method in comparison.methods_in(SINGLE)),
        height=_FRAME + _ROW * len(rows),
    )


def _leader_markers(method: ComparedMethod, found: list[ComparedEntry]) -> Mark:
    marker = series_marker(method.series)
    marks: list[tuple[float, float, str, float, str]] = []
    for row, entry in enumerate(found):
        texts = entry.finding("verdict").values[0].tolist()
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


def errors(view: ArchiveView) -> Iterator[Block]:
    """Error against runs, of single sets of points."""
    yield from _error_blocks(MethodComparison(view), SINGLE)


def replicates(view: ArchiveView) -> Iterator[Block]:
    """Yield the error charts of replicated sets, where any method has them."""
    comparison = MethodComparison(view)
    if REPLICATED in comparison.variants:
        yield from _error_blocks(comparison, REPLICATED)


def _error_blocks(comparison: MethodComparison, variant: str) -> Iterator[Block]:
    charts: dict[str, list[Chart]] = {}
    without: list[str] = []
    for count, entry in enumerate(comparison.entries, 1):
        if count - len(without) > _MOST_CHARTS:
            continue
        if chart := error_chart(entry, variant):
            charts.setdefault(entry.output, []).append(chart)
        else:
            without.append(f"{entry.output}, {entry.label}")
    if not charts:
        return
    keys = method_keys(comparison.methods_in(variant))
    for output, found in charts.items():
        yield Heading(output_heading(comparison.view, output))
        yield Charts(tuple(found), keys=(*keys, *error_keys(found)))
    drawn = sum(map(len, charts.values()))
    if without:
        yield Text(f"Not drawn, as no error is above 0: {'; '.join(without)}.")
    if drawn + len(without) < len(comparison.entries):
        first = f"These are the first {drawn} of {len(comparison.entries)} statistics"
        yield Text(f"{first}; the tables further down have all.")


def rates(view: ArchiveView) -> Iterator[Block]:
    """Slopes with their intervals."""
    comparison = MethodComparison(view)
    charts = [chart for variant in comparison.variants for chart in of_slopes(comparison, variant)]
    yield from _row_blocks(comparison, charts, [SLOPE_NOTE])


def coverage(view: ArchiveView) -> Iterator[Block]:
    """Share of the repeats in which a method's own interval contains the reference."""
    comparison = MethodComparison(view)
    charts = [each for variant in comparison.variants for each in of_coverage(comparison, variant)]
    covered = {
        method.source
        for method in comparison.methods
        for entry in comparison.entries
        if np.isfinite(entry.of(method, "coverage").values).any()
    }
    sources = dict.fromkeys(method.source for method in comparison.methods)
    without = [f"{each} has no intervals of its own." for each in sources if each not in covered]
    yield from _row_blocks(comparison, charts, [coverage_note(comparison), *without])


def _row_blocks(
    comparison: MethodComparison, charts: Sequence[Chart], notes: Sequence[str]
) -> Iterator[Block]:
    if not charts:
        return
    if len(charts) > _MOST_CHARTS:
        omitted = f"The first {_MOST_CHARTS} of {len(charts)} charts; more outputs are not drawn."
        notes = [*notes, omitted]
    keys = method_keys(comparison.methods_in(SINGLE))
    yield Charts(tuple(charts[:_MOST_CHARTS]), keys=keys, notes=tuple(notes))


def cost(view: ArchiveView) -> Iterator[Block]:
    """Yield the runs that each method makes of those that it is given."""
    comparison = MethodComparison(view)
    yield Table(_indented(methods_table(comparison)))
    charged = sum(sum(method.runs) for method in comparison.methods) * comparison.repeats
    yield Text(
        f"All repeats together cost {grouped_number(charged)} runs, and the reference "
        f"{grouped_number(comparison.reference_runs)}."
    )
    if any(
        0 < runs < budget
        for method in comparison.methods
        for runs, budget in zip(method.runs, comparison.budgets, strict=True)
    ):
        yield Text(
            "Some methods make fewer runs than the budget, as no further block or replicate fits. "
            "Their errors are drawn at the budget; slopes are over the runs made."
        )


def tables(view: ArchiveView) -> Iterator[Block]:
    """The tables that the command line shows, with their legend."""
    yield Text(LEGEND)
    for entry in MethodComparison(view).entries:
        yield Table(_indented(entry_table(entry)), is_folded=True)


def reference(view: ArchiveView) -> Iterator[Block]:
    """The reference values, and their own errors."""
    comparison = MethodComparison(view)
    run_count, used = comparison.reference_runs, comparison.reference_runs_used
    completed = grouped_number(used) if used < run_count else "all"
    yield Text(f"Of its {grouped_number(run_count)} runs, {completed} completed.")
    columns = ["value", "its own error", "errors are relative to", "method of its interval"]
    for output, found in comparison.by_output.items():
        table = OutputTable(f"Reference of {output_heading(comparison.view, output)}", columns)
        for entry in found:
            truth, own = entry.reference, entry.reference_error
            value = entry.reference_text if math.isfinite(truth.values[0]) else NOTHING
            value += table.note_mark(estimate_remark(truth))
            own_text = NOTHING if math.isnan(own) else f"{percentage_text(own / 100)} %"
            method = interval_text(truth, INTERVAL) or NOTHING
            table.rows.append((entry.label, [value, own_text, _error_scale_text(entry), method]))
        yield Table(table)


def _error_scale_text(entry: ComparedEntry) -> str:
    unit = entry.display_units
    value = float(np.asarray(scale(unit).difference_from_si(entry.error_scale)))
    if not math.isfinite(value + float(entry.reference.values[0])):
        return NOTHING
    return f"{number_text(value)}{unit_suffix(unit)}"


def _indented(table: OutputTable) -> OutputTable:
    """Return a table with labels that stay indented on a page."""
    rows = [
        (label.replace("  ", "\u00a0\u00a0\u00a0"), [cell.strip() for cell in cells])
        for label, cells in table.rows
    ]
    return OutputTable(table.title, table.columns, rows, table.notes)
