"""An archive of a benchmark of methods as tables, with its verdicts in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.labels import BUDGET, METHODS, REPLICATED, SINGLE
from uqpen.results.benchmark_entries import BenchmarkEntry, entries, reference_attributes
from uqpen.results.digits import grouped_number
from uqpen.results.table import NOTHING, OutputTable

__all__ = [
    "IS_DOUBTFUL",
    "IS_LEVEL",
    "LEGEND",
    "WINS",
    "EntryComparison",
    "entry_comparisons",
    "has_reference",
    "join_names",
    "methods_table",
    "percentage_text",
    "standing_mark",
    "standings_table",
]

WINS, IS_LEVEL, IS_DOUBTFUL = "*", "=", "?"

LEGEND = (
    "Figures are root mean squares of errors in % of the reference (of the standard deviation, "
    f"where that is about 0). {WINS} leads all other single sets by more than the noise, "
    f"{IS_LEVEL} is level with the best, {IS_DOUBTFUL} is ahead for reasons that leave a doubt; "
    "a factor's 95 % interval is in brackets."
)


@dataclass(frozen=True)
class EntryComparison:
    """The comparison of methods for one entry of a statistic.

    Parameters
    ----------
    entry : BenchmarkEntry
    table : OutputTable
        A row for each method, a column for each budget, the slope last.
    verdicts : tuple of str
        Those among single sets.
    notes : tuple of str
        What must be known of them.
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
        """All of them, as they stand below the table."""
        return (*self.verdicts, *self.notes, *self.replicated_verdicts)


def methods_table(tree: xr.DataTree) -> OutputTable:
    """Return the table of the runs that each method makes of each budget."""
    methods = read_group(tree, METHODS)
    repeats, reference = (int(methods.attrs[name]) for name in ("repeats", "reference_runs"))
    title = (
        f"runs made of each budget, {repeats} times; reference: {grouped_number(reference)} runs"
    )
    table = OutputTable(title, [grouped_number(int(budget)) for budget in methods[BUDGET].values])
    for position, label in enumerate(_labels(tree)):
        shapes = zip(
            methods["runs"].values[position].tolist(),
            methods["replicates"].values[position].tolist(),
            strict=True,
        )
        table.rows.append((label, [_runs_text(*shape) for shape in shapes]))
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
    methods = read_group(tree, METHODS)
    budgets = methods[BUDGET].values
    title = f"of {len(found)} statistics: led by more than the noise + level with the best"
    table = OutputTable(title, [grouped_number(int(budget)) for budget in budgets])
    for source, variants in zip(methods["source"].values, methods["contests"].values, strict=True):
        if SINGLE not in str(variants).split():
            continue
        marks = [
            [standing_mark(str(source), *level_and_bound) for level_and_bound in standings]
            for standings in found
        ]
        columns = [[row[column] for row in marks] for column in range(len(budgets))]
        cells = [f"{marked.count(WINS)} + {marked.count(IS_LEVEL)}" for marked in columns]
        table.rows.append((str(source), cells))
    return table


def _entry_comparison(entry: BenchmarkEntry) -> EntryComparison:
    errors, slopes = entry.variable("error"), entry.variable("slope")
    budgets = errors[BUDGET].values.tolist()
    title = f"{entry.output}, {entry.label}: {entry.reference_text}"
    table = OutputTable(title, [*map(grouped_number, budgets), "slope"])
    methods = read_group(entry.tree, METHODS)
    for position, label in enumerate(_labels(entry.tree)):
        name = str(methods["source"].values[position])
        is_single = SINGLE in str(methods["contests"].values[position]).split()
        cells = [
            percentage_text(float(error))
            + (standing_mark(name, *level_and_bound) if is_single else " ")
            for error, level_and_bound in zip(
                errors.values[position, :, 0], entry.single_set_standings, strict=True
            )
        ]
        table.rows.append((label, [*cells, _slope_text(slopes.values[position].tolist())]))
    levels, texts, notes = (
        entry.variable(name).values.tolist() for name in ("level", "verdict", "remark")
    )
    has_replicates = methods["contests"].isin([REPLICATED]).any()
    return EntryComparison(
        entry,
        table,
        tuple(_single_set_verdicts(levels[0], texts[0], budgets)),
        tuple(_notes(notes[0], budgets)),
        tuple(_replicated_verdicts(levels[1], budgets)) if has_replicates else (),
    )


def _notes(notes: list[str], budgets: list[int]) -> Iterator[str]:
    """Yield what the reference's own error means for the verdicts, a sentence a remark."""
    for note, where in _group_budgets([(note,) if note else () for note in notes], budgets):
        if note:
            yield f"at {_list_budgets(where)} runs, {note[0]}"


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
    sentences = [
        (where[0], f"at {_list_budgets(where)} runs {join_names(names)} are level")
        for names, where in ties
    ]
    sentences += [
        (budget, text) for budget, text in zip(budgets, texts, strict=True) if budget not in tied
    ]
    yield from (text for _, text in sorted(sentences))


def _group_budgets(keys: list[Any], budgets: list[int]) -> list[tuple[tuple[str, ...], list[int]]]:
    """Budgets with the same verdict together, in the order of the first of each."""
    found: dict[frozenset[str], tuple[tuple[str, ...], list[int]]] = {}
    for key, budget in zip(keys, budgets, strict=True):
        names = tuple(key.split()) if isinstance(key, str) else key
        found.setdefault(frozenset(names), (names, []))[1].append(budget)
    return list(found.values())


def _labels(tree: xr.DataTree) -> list[str]:
    """The first column: a replicated design stands below its single set, where there is one."""
    methods = read_group(tree, METHODS)
    found: list[str] = []
    for source, variants in zip(
        methods["source"].values.tolist(), methods["contests"].values.tolist(), strict=True
    ):
        if SINGLE in variants.split():
            found.append(source)
        else:
            is_below = bool(found) and found[-1] == source
            found.append(f"  {REPLICATED}" if is_below else f"{source} {REPLICATED}")
    return found


def _runs_text(runs: int, replicates: int) -> str:
    if not runs:
        return NOTHING
    return (
        grouped_number(runs)
        if replicates == 1
        else f"{replicates} × {grouped_number(runs // replicates)}"
    )


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
    name : str
        The method's.
    level : str
        The names of all that are level with the best, the best first.
    lowest : float
        The lower bound of the lead of a single best; NaN where that is in doubt.
    """
    names = level.split()
    if name not in names:
        return " "
    if len(names) > 1:
        return IS_LEVEL
    return IS_DOUBTFUL if math.isnan(lowest) else WINS


def _slope_text(bounds: list[float]) -> str:
    estimate, lower, upper = bounds
    if math.isnan(estimate):
        return NOTHING
    half = (upper - lower) / 2
    return f"{estimate:.2f}" if math.isnan(half) else f"{estimate:.2f} ± {half:.2f}"


def _list_budgets(budgets: list[int]) -> str:
    return ", ".join(map(grouped_number, budgets))


def join_names(names: Sequence[str]) -> str:
    """Names as a sentence lists them."""
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last
