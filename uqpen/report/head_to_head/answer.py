"""Which method wins for which statistic, at which number of runs, and what must be known of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import islice

import numpy as np
import xarray as xr

from uqpen.archive.read import group
from uqpen.labels import ERRORS, METHODS, NOTE, SINGLE, VERDICTS
from uqpen.report.blocks import Axis, Block, Chart, Charts, Quote, Remarks, Table, Text
from uqpen.report.head_to_head.contest import (
    MOST_CHARTS,
    Method,
    budgets_of,
    by_output,
    called,
    keys_of,
    methods_of,
    runs_of_reference,
)
from uqpen.report.marks import Trace, points
from uqpen.summary.digits import grouped
from uqpen.summary.head_to_head import (
    IS_DOUBTFUL,
    IS_LEVEL,
    WINS,
    contests,
    has_reference,
    joined,
    standing,
    standings_table,
)
from uqpen.summary.head_to_head_entries import Entry, entries

__all__ = ["answer"]

# What a method's standing is called in a sentence, at first and further on.
_SAID = {
    WINS: ("leads all others by more than the noise in {}", "leads in {}"),
    IS_LEVEL: ("is level with the best in {}", "is level in {}"),
    IS_DOUBTFUL: ("is ahead, but in doubt, in {}", "is ahead, in doubt, in {}"),
}

# Sizes of the markers, and how far apart those are that share a place, in rows or columns.
_ALONE, _TOGETHER, _APART = 13.0, 7.0, 0.17
_ROW, _FRAME = 30, 70


def answer(tree: xr.DataTree) -> Iterator[Block]:
    """Who leads, in sentences to be quoted, and by output and statistic."""
    sentences = tuple(_standings(tree))
    if sentences:
        yield Quote(sentences)
    elif has_reference(tree):
        yield Text("No two methods have figures to compare.")
    if caveats := tuple(_caveats(tree)):
        yield Remarks("What must be known", caveats)
    if not sentences:
        return
    yield Table(standings_table(tree))
    outputs = by_output(tree)
    yield Charts(
        tuple(_leaders(tree, *each) for each in islice(outputs.items(), MOST_CHARTS)),
        keys=keys_of(methods_of(tree, SINGLE)),
        notes=(
            "One filled marker: it leads all others by more than the noise. Several side by side: "
            "they are level. A hollow one: it is ahead, but the lead is in doubt and has no "
            "interval. None: no two methods have figures to compare.",
            *_left_out(len(outputs)),
        ),
    )
    yield from _verdicts(tree)


def _left_out(outputs: int) -> Iterator[str]:
    if outputs > MOST_CHARTS:
        yield f"The first {MOST_CHARTS} of {outputs} outputs; the verdicts below are of all."


def _standings(tree: xr.DataTree) -> Iterator[str]:
    """A sentence for each number of runs at which there is a verdict."""
    found = [entry.contests for entry in entries(tree)]
    of = f"{len(found)} statistic{'s' if len(found) > 1 else ''}"
    for column, budget in enumerate(budgets_of(tree)):
        said = list(_said(tree, [contests[column] for contests in found]))
        if said:
            yield f"At {grouped(budget)} runs, of {of}, {'; '.join(said)}."


def _said(tree: xr.DataTree, found: list[tuple[str, float]]) -> Iterator[str]:
    """What is said of each method at a number of runs, the best first."""
    counted = {
        method.source: Counter(standing(method.source, *contest) for contest in found)
        for method in methods_of(tree, SINGLE)
    }
    ranked = sorted(counted, key=lambda name: [-counted[name][mark] for mark in _SAID])
    known: set[str] = set()
    for name in ranked:
        marks = [mark for mark in _SAID if counted[name][mark]]
        parts = [_SAID[mark][mark in known].format(counted[name][mark]) for mark in marks]
        known.update(marks)
        if parts:
            yield f"{name} {joined(parts)}"


def _caveats(tree: xr.DataTree) -> Iterator[str]:
    """What must be known of the answer, a sentence each."""
    yield from _of_reference(tree)
    if not has_reference(tree):
        return
    found = list(entries(tree))
    notes = [str(note) for each in found for note in each.of(VERDICTS, "_note").values[0]]
    for note, count in Counter(filter(None, notes)).items():
        yield f"For {count} of {len(notes)} verdicts: {note}."
    marks = [_is_doubtful(*contest) for each in found for contest in each.contests]
    if any(marks):
        yield (
            f"In {sum(marks)} of {len(marks)} contests the lead is in doubt: few of the repeats "
            "decide it, or the errors are no larger than the reference's own."
        )
    yield from _absent(tree)
    if without := sum(map(_without_error, found)):
        yield (
            f"{without} {'error is' if without == 1 else 'errors are'} not told, as some repeat "
            "has no estimate, or the reference has none."
        )
    yield from dict.fromkeys(
        f"Intervals of errors: {note}." for each in found if (note := _note(each))
    )


def _of_reference(tree: xr.DataTree) -> Iterator[str]:
    made, used = runs_of_reference(tree)
    if not used:
        yield "The reference lost all of its runs, so no error can be told."
    elif used < made:
        yield (
            f"The reference lost {grouped(made - used)} of its {grouped(made)} runs; errors are "
            "held to what the others tell."
        )


def _is_doubtful(level: str, lowest: float) -> bool:
    first = level.partition(" ")[0]
    return standing(first, level, lowest) == IS_DOUBTFUL if first else False


def _absent(tree: xr.DataTree) -> Iterator[str]:
    """The methods that cannot do with some numbers of runs."""
    runs = group(tree, METHODS)["runs"].values
    for method in methods_of(tree, SINGLE):
        made = zip(budgets_of(tree), runs[method.position].tolist(), strict=True)
        if where := [grouped(budget) for budget, count in made if not count]:
            yield f"{method.source} takes no part at {joined(where)} runs."


def _without_error(entry: Entry) -> int:
    """How many methods made their runs, as single sets, but have no error."""
    errors = entry.of(ERRORS).values[..., 0]
    takes_part = group(entry.tree, METHODS)["runs"].values > 0
    single = [method.position for method in methods_of(entry.tree, SINGLE)]
    return int((np.isnan(errors) & takes_part)[single].sum())


def _note(entry: Entry) -> str:
    return str(entry.of(ERRORS).attrs.get(NOTE, ""))


def _leaders(tree: xr.DataTree, output: str, found: list[Entry]) -> Chart:
    """Who leads, a row for each statistic and a column for each number of runs."""
    budgets = budgets_of(tree)
    rows = tuple(entry.label for entry in found)
    ends = (-0.5, len(budgets) - 0.5)
    ticks = tuple((float(place), grouped(budget)) for place, budget in enumerate(budgets))
    best = [(entry.label, entry.contests[-1][0].split()) for entry in found]
    said = [f"{label}: {joined(names)}" for label, names in best if names]
    return Chart(
        title=f"Who leads in {called(tree, output)}",
        summary=f"Nearest to the reference at {grouped(budgets[-1])} runs: "
        f"{'; '.join(said) or 'none'}. Sentences below tell the others.",
        x=Axis("runs", ends, ticks=ticks),
        y=Axis("", rows=rows),
        traces=tuple(_markers(method, found) for method in methods_of(tree, SINGLE)),
        height=_FRAME + _ROW * len(rows),
    )


def _markers(method: Method, found: list[Entry]) -> Trace:
    """Where a method leads, or is level."""
    marks: list[tuple[float, float, str, float, str]] = []
    for row, entry in enumerate(found):
        texts = entry.of(VERDICTS, "_verdict").values[0].tolist()
        for column, (level, lowest) in enumerate(entry.contests):
            names = level.split()
            mark = standing(method.source, level, lowest)
            if mark in _SAID:
                step = min(_APART, 0.8 / len(names))
                place = column + (names.index(method.source) - (len(names) - 1) / 2) * step
                symbol = f"{method.marker}-open" if mark == IS_DOUBTFUL else method.marker
                size = _TOGETHER if mark == IS_LEVEL else _ALONE
                text = f"{entry.label}: {texts[column]}"
                marks.append((place, float(row), symbol, size, text))
    x, y, symbols, sizes, hovers = zip(*marks, strict=True) if marks else ((), (), (), (), ())
    trace = points(
        x, y, method.series, hover="%{text}", name=method.source, texts=hovers, opacity=1.0
    )
    outlines = [2 if symbol.endswith("-open") else 0 for symbol in symbols]
    trace["marker"] |= {"symbol": list(symbols), "size": list(sizes), "line": {"width": outlines}}
    return trace


def _verdicts(tree: xr.DataTree) -> Iterator[Block]:
    """The verdicts in words, output by output."""
    lines: dict[str, list[str]] = {}
    for contest in contests(tree):
        entry = contest.entry
        line = f"{entry.label}: {'; '.join(contest.verdicts)}."
        lines.setdefault(entry.output, []).append(line)
    for output, found in lines.items():
        yield Remarks(f"In words: {called(tree, output)}", tuple(found), is_folded=True)
