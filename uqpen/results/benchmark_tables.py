"""An archive of a benchmark of methods as tables, with its verdicts in words."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.labels import BUDGET, METHODS, REPLICATED, SINGLE
from uqpen.results.benchmark_entries import BenchmarkEntry, entries, reference_attributes
from uqpen.results.digits import grouped_number, with_half_width
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import join_names

__all__ = [
    "IS_DOUBTFUL",
    "IS_LEVEL",
    "LEGEND",
    "WINS",
    "EntryComparison",
    "entry_comparisons",
    "has_reference",
    "methods_table",
    "percentage_text",
    "standing_mark",
    "standings_table",
]

WINS, IS_LEVEL, IS_DOUBTFUL = "*", "=", "?"

LEGEND = (
    "Numbers are root mean square errors in % of the reference (of the standard deviation, where "
    f"the reference is about 0). {WINS} leads all other single sets by more than the noise, "
    f"{IS_LEVEL} is level with the best, {IS_DOUBTFUL} is ahead without certainty. Brackets "
    "contain the 95 % interval of a factor."
)


@dataclass(frozen=True)
class EntryComparison:
    """The comparison of methods for one entry of a statistic.

    Parameters
    ----------
    entry : BenchmarkEntry
        An entry of a statistic.
    table : OutputTable
        A row for each method, a column for each budget, the slope last.
    verdicts, notes : tuple of str
        The verdicts among single sets, and remarks on them.
    replicated_verdicts : tuple of str
        The verdicts among replicated sets in one sentence; none where there are no replicates.
    """

    entry: BenchmarkEntry
    table: OutputTable
    verdicts: tuple[str, ...]
    notes: tuple[str, ...]
    replicated_verdicts: tuple[str, ...]

    @property
    def sentences(self) -> tuple[str, ...]:
        """All sentences below the table, in order."""
        return (*self.verdicts, *self.notes, *self.replicated_verdicts)


def methods_table(tree: xr.DataTree) -> OutputTable:
    """Return the table of the runs that each method makes of each budget."""
    methods = read_group(tree, METHODS)
    repeats, reference = (int(methods.attrs[name]) for name in ("repeats", "reference_runs"))
    made = f"runs made of each budget, {repeats} times"
    title = f"{made}; reference: {grouped_number(reference)} runs"
    table = OutputTable(title, [grouped_number(int(budget)) for budget in methods[BUDGET].values])
    counts = (methods[name].values.tolist() for name in ("runs", "replicates"))
    for label, *of_method in zip(_labels(tree), *counts, strict=True):
        table.rows.append((label, list(map(_runs_text, *of_method))))
    return table


def has_reference(tree: xr.DataTree) -> bool:
    """Return whether a run of the reference completed."""
    return bool(reference_attributes(tree)["runs_used"])


def entry_comparisons(tree: xr.DataTree) -> Iterator[EntryComparison]:
    """A table with verdicts for each entry of each statistic of each output."""
    yield from map(_entry_comparison, entries(tree))


def standings_table(tree: xr.DataTree) -> OutputTable:
    """Return the table of how often each method leads, and is level with the best."""
    found = [entry.single_set_standings for entry in entries(tree)]
    budgets = read_group(tree, METHODS)[BUDGET].values
    title = f"of {len(found)} statistics: led by more than the noise + level with the best"
    table = OutputTable(title, [grouped_number(int(budget)) for budget in budgets])
    for source, variants in _methods(tree):
        if SINGLE in variants:
            marks = [
                [standing_mark(source, *each) for each in at] for at in zip(*found, strict=True)
            ]
            cells = [f"{marked.count(WINS)} + {marked.count(IS_LEVEL)}" for marked in marks]
            table.rows.append((source, cells))
    return table


def _entry_comparison(entry: BenchmarkEntry) -> EntryComparison:
    errors, slopes = entry.variable("error"), entry.variable("slope")
    budgets = errors[BUDGET].values.tolist()
    title = f"{entry.output}, {entry.label}: {entry.reference_text}"
    table = OutputTable(title, [*map(grouped_number, budgets), "slope"])
    methods, standings = _methods(entry.tree), entry.single_set_standings
    for position, (label, (source, variants)) in enumerate(
        zip(_labels(entry.tree), methods, strict=True)
    ):
        marks = [standing_mark(source, *each) if SINGLE in variants else " " for each in standings]
        texts = map(percentage_text, errors.values[position, :, 0].tolist())
        cells = [f"{text}{mark}" for text, mark in zip(texts, marks, strict=True)]
        table.rows.append((label, [*cells, _slope_text(*slopes.values[position].tolist())]))
    levels, verdicts, notes = (
        entry.variable(name).values.tolist() for name in ("level", "verdict", "remark")
    )
    has_replicates = any(variants == [REPLICATED] for _, variants in methods)
    return EntryComparison(
        entry,
        table,
        tuple(_single_set_verdicts(levels[0], verdicts[0], budgets)),
        tuple(_notes(notes[0], budgets)),
        tuple(_replicated_verdicts(levels[1], budgets)) if has_replicates else (),
    )


def _notes(notes: list[str], budgets: list[int]) -> Iterator[str]:
    """Yield the consequences of the reference's own error for the verdicts, a sentence each."""
    for note in dict.fromkeys(filter(None, notes)):
        where = [budget for budget, each in zip(budgets, notes, strict=True) if each == note]
        yield f"at {_list_budgets(where)} runs, {note}"


def _replicated_verdicts(levels: list[str], budgets: list[int]) -> Iterator[str]:
    """All verdicts among replicated sets in one sentence, where there is one."""
    texts = [
        f"{join_names(level)} {'are level' if len(level) > 1 else 'is ahead'} at "
        f"{_list_budgets(where)}"
        for level, where in _group_budgets(levels, budgets)
        if level
    ]
    if texts:
        yield f"{REPLICATED}: {'; '.join(texts)} runs"


def _single_set_verdicts(levels: list[str], texts: list[str], budgets: list[int]) -> Iterator[str]:
    """A sentence for each budget that has a winner, and one for all with the same ones level."""
    ties = [(names, where) for names, where in _group_budgets(levels, budgets) if len(names) > 1]
    tied = {budget for _, where in ties for budget in where}
    sentences = {
        budget: text for budget, text in zip(budgets, texts, strict=True) if budget not in tied
    }
    for names, where in ties:
        sentences[where[0]] = f"at {_list_budgets(where)} runs {join_names(names)} are level"
    yield from (sentences[budget] for budget in sorted(sentences))


def _group_budgets(levels: list[str], budgets: list[int]) -> list[tuple[list[str], list[int]]]:
    """Return the budgets at which the same methods are level, in the order of the first of each."""
    found: dict[frozenset[str], tuple[list[str], list[int]]] = {}
    for level, budget in zip(levels, budgets, strict=True):
        names = level.split()
        found.setdefault(frozenset(names), (names, []))[1].append(budget)
    return list(found.values())


def _methods(tree: xr.DataTree) -> list[tuple[str, list[str]]]:
    """Return the source of each method, and the variants that it is in."""
    methods = read_group(tree, METHODS)
    variants = [str(text).split() for text in methods["contests"].values]
    return list(zip(map(str, methods["source"].values), variants, strict=True))


def _labels(tree: xr.DataTree) -> list[str]:
    """Return the first column: a replicated design stands below its single set, if any."""
    found: list[str] = []
    for source, variants in _methods(tree):
        if SINGLE in variants:
            found.append(source)
        else:
            is_below = bool(found) and found[-1] == source
            found.append(f"  {REPLICATED}" if is_below else f"{source} {REPLICATED}")
    return found


def _runs_text(runs: int, replicates: int) -> str:
    if not runs:
        return NOTHING
    each = grouped_number(runs // replicates)
    return each if replicates == 1 else f"{replicates} × {each}"


def percentage_text(error: float) -> str:
    """A relative error in per cent, in two digits."""
    value = 100 * error
    if math.isnan(value):
        return NOTHING
    return f"{value:.0f}" if value >= 9.95 else f"{value:#.2g}"


def standing_mark(name: str, level: str, lowest: float) -> str:
    """Return the mark behind a method's error, as the legend has it; a space for none.

    Parameters
    ----------
    name, level : str
        The method, and all that are level with the best, the best first.
    lowest : float
        Lower bound of the lead of a single best; NaN for a doubtful lead.
    """
    names = level.split()
    if name not in names:
        return " "
    if len(names) > 1:
        return IS_LEVEL
    return IS_DOUBTFUL if math.isnan(lowest) else WINS


def _slope_text(estimate: float, lower: float, upper: float) -> str:
    if math.isnan(estimate):
        return NOTHING
    half = (upper - lower) / 2
    shown = f"{estimate:.2f}"
    return shown if math.isnan(half) else with_half_width(shown, f"{half:.2f}")


def _list_budgets(budgets: list[int]) -> str:
    return ", ".join(map(grouped_number, budgets))
