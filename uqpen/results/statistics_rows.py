"""The rows of a table of statistics: runs, failed runs, moments, quantiles, probabilities."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    AGREEMENT,
    CONDITIONAL,
    MISSING,
    RUNS,
    RUNS_ABSENT,
    RUNS_SPENT,
    SURROGATES,
)
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.core.statistic_dimensions import PROBABILITY
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.core.units import Scale
from uqpen.execution import run_count, status_counts
from uqpen.results.acceptance import Acceptance
from uqpen.results.digits import grouped_number
from uqpen.results.source_statistics import SourceStatistics, source_entries
from uqpen.results.statistic_entries import SHOWN, described_statistics, labelled_entries
from uqpen.results.stopping_texts import stopping_text
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    conversion,
)
from uqpen.results.tolerance_rows import tolerance_cell

__all__ = [
    "StatisticsRows",
    "add_absent_runs",
    "add_decisions",
    "add_failed_runs",
    "add_runs",
    "add_shares",
    "runs_spent",
]


@dataclass(frozen=True)
class StatisticsRows:
    """Adds the rows of one output that is a number."""

    table: OutputTable
    statistics: SourceStatistics
    name: str
    measure: Scale
    is_logarithmic: bool = False

    def add(self) -> None:
        """Add all rows that the archive has an estimate for."""
        left_out = {*self._left_out()}
        described = described_statistics(self.statistics, self.name)
        shown = [each for each in (*SHOWN, *described) if each.name not in left_out]
        shown.sort(key=lambda each: each.shown.row)
        if self.is_logarithmic:
            # A mean over tenfolds is that of few runs, so quantiles come before the moments.
            moments = CATALOGUE["mean"].shown.row
            shown.sort(key=lambda each: each.shown.row >= moments and PROBABILITY not in each.dims)
        for statistic in shown:
            for label, arrays in labelled_entries(statistic, self._arrays(statistic.name)):
                self._add_row(label, statistic, arrays)

    def _left_out(self) -> Iterator[str]:
        """Yield the statistics without rows of their own here."""
        # Shares have rows of all outputs with categories, and bands a table of their own.
        yield from ("share", "tolerance_band")
        stds = self._arrays("std").values()
        if not any(math.isnan(std.values[1]) and std.values[0] > 0 for std in stds):
            yield "half_spread"

    def _add_verdicts(self, arrays: dict[str, xr.DataArray]) -> None:
        """Add a row of verdicts on a probability for which the study has acceptance limits."""
        found = {source: Acceptance.from_array(array) for source, array in arrays.items()}
        verdicts = {
            source: each.verdict
            for source, each in found.items()
            if each and self.statistics.kind(source) in ("design", "surrogate")
        }
        if first := next(filter(None, found.values()), None):
            cells = [str(verdicts.get(source, NOTHING)) for source in self.table.columns]
            self.table.rows.append((f"accepted: {first}", cells))

    def _arrays(self, statistic: str) -> dict[str, xr.DataArray]:
        return self.statistics.by_source(self.name, statistic, self.table.columns)

    def _add_row(self, label: str, statistic: Statistic, arrays: dict[str, xr.DataArray]) -> None:
        if statistic.shown.ends:
            cells = [
                tolerance_cell(self.table, statistic, arrays.get(each), self.measure)
                for each in self.table.columns
            ]
        else:
            is_difference = self.statistics.is_difference
            convert = conversion(statistic, self.measure, is_difference=is_difference)
            has_logarithm = self.is_logarithmic and statistic.unit is UnitRule.VALUE
            cells = self.table.cells(arrays, convert, is_logarithmic=has_logarithm)
        if statistic.asked.key and arrays:
            for place, source in enumerate(self.table.columns):
                if source not in arrays:
                    cells[place] += self.table.note_mark(self.statistics.reason_without(source))
        if statistic.shown.ends or any(cell != NOTHING for cell in cells):
            self.table.rows.append((label, cells))
        if statistic.shown.has_verdict:
            self._add_verdicts(arrays)


def runs_spent(tree: xr.DataTree, source: str) -> int | None:
    """Return the runs of a design, or those that a surrogate took; None without any."""
    surrogate = read_group(tree, SURROGATES, source)
    if RUNS_SPENT in surrogate.attrs:
        return int(surrogate.attrs[RUNS_SPENT])
    runs = read_group(tree, RUNS, source)
    return run_count(runs) if runs else None


def add_runs(table: OutputTable, statistics: SourceStatistics) -> None:
    """Add a row of the number of runs that each source took."""
    cells = []
    for source in table.columns:
        spent = runs_spent(statistics.tree, source)
        text = NOTHING if spent is None else grouped_number(spent)
        runs = read_group(statistics.tree, RUNS, source)
        cost = _cost_text(statistics.cost_spent(source))
        for note in (stopping_text(runs), str(runs.attrs.get(AGREEMENT, "")), cost):
            text += table.note_mark(note)
        cells.append(text)
    table.rows.append(("runs", cells))


def _cost_text(cost: float | None) -> str:
    """Return a note on what the runs of a model and its stand-ins cost; empty if unknown."""
    return "" if cost is None else f"with the runs of the stand-ins, the cost of {cost:.4g} runs"


def add_decisions(table: OutputTable, statistics: SourceStatistics, output: str) -> None:
    """Add a row for each claim on an output, with the verdict of each design that decided it."""
    found = {source: statistics.decision(source) for source in table.columns}
    concerned = [each for each in found.values() if each and each.output == output]
    for claim in dict.fromkeys(each.claim for each in concerned):
        cells = [
            each.verdict_text + table.note_mark(each.guarantee)
            if each and each.claim == claim
            else NOTHING
            for each in found.values()
        ]
        table.rows.append((claim, cells))


def add_failed_runs(table: OutputTable, statistics: SourceStatistics) -> None:
    """Add a row of the failed runs of each design, and their probability for each status."""
    groups = {source: read_group(statistics.tree, RUNS, source) for source in table.columns}
    counts = {source: status_counts(runs) for source, runs in groups.items() if runs}
    cells = []
    for source in table.columns:
        failed = [f"{n} {STATUS_TEXT[s]}" for s, n in counts.get(source, {}).items() if n and s]
        text = ", ".join(failed) or "0"
        for note in _qualifications(statistics, source):
            text += table.note_mark(note)
        cells.append(text if source in counts else NOTHING)
    table.rows.append(("lost", cells))
    for status in Status:
        if status is not Status.OK and any(each[status] for each in counts.values()):
            meaning = status.meaning
            chances = {source: statistics.status_probabilities(source) for source in table.columns}
            found = {source: each[meaning] for source, each in chances.items() if meaning in each}
            table.rows.append((f"P({STATUS_TEXT[status]})", table.cells(found)))


def add_absent_runs(table: OutputTable, statistics: SourceStatistics, output: str) -> None:
    """Add a row of the completed runs without a value of an output, where there are any."""
    found = [statistics.absence(source, output) for source in table.columns]
    if not any(found):
        return
    cells = []
    for absence in found:
        cells.append(grouped_number(absence[RUNS_ABSENT]) if absence else NOTHING)
        if absence:
            cells[-1] += table.note_mark(f"statistics are conditional on {absence[CONDITIONAL]}")
    table.rows.append(("without a value", cells))


def _qualifications(statistics: SourceStatistics, design: str) -> Iterator[str]:
    """Yield the consequences of failed runs for the statistics of a design."""
    accounts = statistics.run_accounts(design)
    if CONDITIONAL in accounts:
        yield f"statistics are conditional on {accounts[CONDITIONAL]}"
    if MISSING in accounts:
        yield f"statistics use the completed runs; {accounts[MISSING]} failed"


def add_shares(table: OutputTable, statistics: SourceStatistics, name: str) -> None:
    """Add a row for each category of an output."""
    arrays = statistics.by_source(name, "share", table.columns)
    for label, found in source_entries(arrays, "category_label"):
        table.rows.append((f"share {label}", table.cells(found)))
