"""A benchmark of methods in an archive: its methods, budgets and statistics; tables, JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.estimates import array_entries, unpack
from uqpen.archive.read import group_names, is_benchmark, read_group
from uqpen.archive.structure import reference_name
from uqpen.core.catalogue import BENCHMARK_STATISTICS
from uqpen.core.labels import (
    BUDGET,
    COMPARISON_GROUP,
    KIND,
    REPEAT,
    REPLICATED,
    REPLICATES_OF_BUDGET,
    RUNS_OF_BUDGET,
    RUNS_SPENT,
    SINGLE,
    SOURCE,
    STATISTICS_GROUP,
    VARIANT,
    VARIANTS,
)
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text, grouped_number, with_half_width
from uqpen.results.json import archive_identity
from uqpen.results.source_style import source_slots
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    conversion,
    entries_json,
    entry_label,
    estimate_json,
    json_value,
)
from uqpen.results.texts import join_names
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.intervals import clopper_pearson


class ComparedMethod(NamedTuple):
    """A method of a benchmark."""

    group: str  # name of its source in the archive
    source: str  # the name of its design or surrogate in the study
    # The comparisons that it is in: of single sets of points, of replicated sets, or both.
    variants: Sequence[str]
    # Number of its colour and marker; the same for a design as one set and in replicates.
    series: int
    runs: Sequence[int]  # at each budget; empty where it takes no part
    replicates: Sequence[int]  # at each budget

    @property
    def name(self) -> str:
        """Name in tables and JSON; with a space if it is not a name in the study."""
        return self.source if SINGLE in self.variants else f"{self.source} {REPLICATED}"


@dataclass(frozen=True)
class MethodComparison:
    """The methods of a benchmark, and what they are compared by."""

    view: ArchiveView  # an archive of a benchmark of methods, or one output of it
    # By group and name: to take an array out of its group takes its time.
    _arrays: dict[tuple[str, ...], list[xr.DataArray]] = field(
        default_factory=dict, compare=False, repr=False
    )

    @classmethod
    def of(cls, tree: xr.DataTree) -> MethodComparison:
        """Return the whole of an archive."""
        return cls(ArchiveView(tree, ""))

    @cached_property
    def reference(self) -> str:
        """The source that errors are measured from."""
        return reference_name(self.view.tree)

    @cached_property
    def methods(self) -> list[ComparedMethod]:
        """All methods, in the order of the archive."""
        if not is_benchmark(self.view.tree):
            return []
        described = {
            name: read_group(self.view.tree, STATISTICS_GROUP, name).attrs
            for name in self.view.sources
            if name != self.reference
        }
        text = str(self.view.archive.attrs.get("study_text", ""))
        slots = source_slots(text, (str(each[SOURCE]) for each in described.values()))
        found = []
        for name, attributes in described.items():
            by_budget = self._of_budgets(name)
            runs, replicates = (
                by_budget[each].values.tolist() for each in (RUNS_OF_BUDGET, REPLICATES_OF_BUDGET)
            )
            source, variants = str(attributes[SOURCE]), str(attributes[VARIANTS]).split()
            found.append(ComparedMethod(name, source, variants, slots[source], runs, replicates))
        return found

    def _of_budgets(self, method: str) -> xr.Dataset:
        """Return what a method has of the first output."""
        return read_group(self.view.tree, STATISTICS_GROUP, method, self.view.outputs[0])

    def methods_in(self, variant: str) -> list[ComparedMethod]:
        """Return the methods of one of the comparisons."""
        return [method for method in self.methods if variant in method.variants]

    @property
    def variants(self) -> list[str]:
        """The comparisons that differ: only one where no method has replicates."""
        has_replicates = any(SINGLE not in each.variants for each in self.methods)
        return [SINGLE, REPLICATED] if has_replicates else [SINGLE]

    @cached_property
    def by_output(self) -> dict[str, list[ComparedEntry]]:
        """The entries of all statistics of each output."""
        found: dict[str, list[ComparedEntry]] = {}
        for output in group_names(self.view.tree, COMPARISON_GROUP):
            verdicts = read_group(self.view.tree, COMPARISON_GROUP, output)
            for statistic in BENCHMARK_STATISTICS if self.view.output in (None, output) else ():
                if f"{statistic.name}_verdict" in verdicts:
                    sizes = [verdicts.sizes[dimension] for dimension in statistic.dims]
                    positions = range(sizes[0] if sizes else 1)
                    entries = (ComparedEntry(self, output, statistic, at) for at in positions)
                    found.setdefault(output, []).extend(entries)
        return found

    @property
    def entries(self) -> list[ComparedEntry]:
        """All entries of all statistics, output by output."""
        return [entry for entries in self.by_output.values() for entry in entries]

    @cached_property
    def budgets(self) -> list[int]:
        """The numbers of runs that the methods are given."""
        budgets: list[int] = self._of_budgets(self.methods[0].group)[BUDGET].values.tolist()
        return budgets

    @cached_property
    def repeats(self) -> int:
        """The number of repeats of each method at each budget."""
        return int(self._of_budgets(self.methods[0].group).sizes[REPEAT])

    @property
    def reference_runs(self) -> int:
        """The number of runs of the reference."""
        return int(read_group(self.view.tree, STATISTICS_GROUP, self.reference).attrs[RUNS_SPENT])

    @property
    def reference_runs_used(self) -> int:
        """The number of completed runs of the reference, which all outputs share."""
        return int(self.entries[0].reference.attrs["runs_used"])


@dataclass(frozen=True)
class ComparedEntry:
    """One entry of a statistic of an output, of all methods."""

    comparison: MethodComparison
    output: str
    statistic: Statistic  # of the catalogue
    position: int  # among the entries; 0 for a statistic with a single one

    def of(self, method: ComparedMethod, what: str) -> xr.DataArray:
        """Return the ``"error"`` of a method, its ``"coverage"`` or its ``"slope"``."""
        return self._archived(STATISTICS_GROUP, method.group, self.output, what=f"_{what}")

    def finding(self, what: str) -> xr.DataArray:
        """Return what is said of all methods: ``"verdict"``, say, along variant and budget."""
        return self._archived(COMPARISON_GROUP, self.output, what=f"_{what}")

    @property
    def reference(self) -> xr.DataArray:
        """The reference's estimate, as its analysis made it."""
        return self._archived(STATISTICS_GROUP, self.comparison.reference, self.output)

    def _archived(self, *path: str, what: str = "") -> xr.DataArray:
        name, along = f"{self.statistic.name}{what}", self.statistic.dims
        if (*path, name) not in self.comparison._arrays:
            array = unpack(read_group(self.comparison.view.tree, *path), name)
            assert array is not None, name
            found = array_entries(array.transpose(*along, ...)) if along else [array]
            self.comparison._arrays[*path, name] = found
        return self.comparison._arrays[*path, name][self.position]

    @property
    def entry_name(self) -> str | float:
        """The coordinate that identifies it within its statistic; empty for a single one."""
        if not self.statistic.dims:
            return ""
        entry: str | float = self.reference[self.statistic.dims[0]].values.tolist()
        return entry

    @property
    def label(self) -> str:
        """The statistic as a table of a study calls it."""
        return entry_label(self.statistic, self.entry_name)

    @property
    def units(self) -> str:
        """The unit of its estimates."""
        return str(self.reference.attrs["units"])

    @property
    def display_units(self) -> str:
        """The unit that the study shows."""
        has_unit = self.statistic.unit is not UnitRule.NONE
        return self.comparison.view.unit(self.output) if has_unit else DIMENSIONLESS

    @property
    def error_scale(self) -> float:
        """The size that errors are relative to."""
        return float(self.finding("scale"))

    @property
    def reference_error(self) -> float:
        """Half the reference's interval, in per cent of the scale of errors; NaN for none."""
        _, lower, upper = self.reference.values.tolist()
        relative_to = self.error_scale
        return 100 * (upper - lower) / 2 / relative_to if relative_to > 0 else float("nan")

    @property
    def single_set_standings(self) -> list[tuple[str, float]]:
        """The methods that are level, and the lower bound of the lead, of single sets by budget."""
        levels, leads = self.finding("level"), self.finding("lead")
        return list(zip(levels.values[0].tolist(), leads.values[0, :, 1].tolist(), strict=True))

    @property
    def reference_text(self) -> str:
        """The reference's estimate in the unit that the study shows."""
        unit = self.display_units
        convert = conversion(self.statistic, scale(unit))
        text = estimate_text(*(float(value) for value in convert(self.reference.values)))
        return text if unit == DIMENSIONLESS else f"{text} {unit}"


def lowest_expected_coverage(level: float, repeats: int) -> float:
    """Return the least share of intervals of a nominal level that 95 % chance scatter allows."""
    covered = np.arange(repeats + 1)
    _, upper = clopper_pearson(covered, repeats, LEVEL)
    return float(covered[upper >= level][0] / repeats)


# Tables, with the verdicts in words.

WINS, IS_LEVEL, IS_DOUBTFUL = "*", "=", "?"

LEGEND = (
    "Numbers are root mean square errors in % of the reference (of the standard deviation, where "
    f"the reference is about 0). {WINS} leads all other single sets by more than the noise, "
    f"{IS_LEVEL} is level with the best, {IS_DOUBTFUL} is ahead without certainty. Brackets "
    "contain the 95 % interval of a factor."
)


def methods_table(comparison: MethodComparison) -> OutputTable:
    """Return the table of the runs that each method makes of each budget."""
    made = f"runs made of each budget, {comparison.repeats} times"
    title = f"{made}; reference: {grouped_number(comparison.reference_runs)} runs"
    table = OutputTable(title, list(map(grouped_number, comparison.budgets)))
    for label, method in zip(_labels(comparison), comparison.methods, strict=True):
        table.rows.append((label, list(map(_runs_text, method.runs, method.replicates))))
    return table


def standings_table(comparison: MethodComparison) -> OutputTable:
    """Return the table of how often each method leads, and is level with the best."""
    found = [entry.single_set_standings for entry in comparison.entries]
    title = f"of {len(found)} statistics: led by more than the noise + level with the best"
    table = OutputTable(title, list(map(grouped_number, comparison.budgets)))
    for method in comparison.methods_in(SINGLE):
        marks = [
            [standing_mark(method.source, *each) for each in at] for at in zip(*found, strict=True)
        ]
        cells = [f"{marked.count(WINS)} + {marked.count(IS_LEVEL)}" for marked in marks]
        table.rows.append((method.source, cells))
    return table


def entry_table(entry: ComparedEntry) -> OutputTable:
    """Return the errors of an entry: a row for each method, a column for each budget, the slope."""
    comparison, standings = entry.comparison, entry.single_set_standings
    title = f"{entry.output}, {entry.label}: {entry.reference_text}"
    table = OutputTable(title, [*map(grouped_number, comparison.budgets), "slope"])
    for label, method in zip(_labels(comparison), comparison.methods, strict=True):
        is_single = SINGLE in method.variants
        marks = [standing_mark(method.source, *each) if is_single else " " for each in standings]
        texts = map(percentage_text, entry.of(method, "error").values[:, 0].tolist())
        cells = [f"{text}{mark}" for text, mark in zip(texts, marks, strict=True)]
        slope = _slope_text(*entry.of(method, "slope").values.tolist())
        table.rows.append((label, [*cells, slope]))
    return table


def reference_remarks(entry: ComparedEntry) -> Iterator[str]:
    """Yield the consequences of the reference's own error for the verdicts, a sentence each."""
    remarks, budgets = entry.finding("remark").values[0].tolist(), entry.comparison.budgets
    for remark in dict.fromkeys(filter(None, remarks)):
        where = [budget for budget, each in zip(budgets, remarks, strict=True) if each == remark]
        yield f"at {_list_budgets(where)} runs, {remark}"


def replicated_verdicts(entry: ComparedEntry) -> Iterator[str]:
    """Yield all verdicts among replicated sets in one sentence, where methods have replicates."""
    if REPLICATED not in entry.comparison.variants:
        return
    levels = entry.finding("level").values[1].tolist()
    texts = [
        f"{join_names(level)} {'are level' if len(level) > 1 else 'is ahead'} at "
        f"{_list_budgets(where)}"
        for level, where in _group_budgets(levels, entry.comparison.budgets)
        if level
    ]
    if texts:
        yield f"{REPLICATED}: {'; '.join(texts)} runs"


def single_set_verdicts(entry: ComparedEntry) -> Iterator[str]:
    """Yield a sentence for each budget with a winner, and one for all with the same ones level."""
    budgets = entry.comparison.budgets
    levels, texts = (entry.finding(what).values[0].tolist() for what in ("level", "verdict"))
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


def _labels(comparison: MethodComparison) -> list[str]:
    """Return the first column: a replicated design stands below its single set, if any."""
    found: list[str] = []
    for method in comparison.methods:
        if SINGLE in method.variants:
            found.append(method.source)
        else:
            is_below = bool(found) and found[-1] == method.source
            found.append(f"  {REPLICATED}" if is_below else method.name)
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

    `level` are all that are level with the best, the best first; `lowest` is the lower bound of the
    lead of a single best, NaN for a doubtful lead.
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


# An archive of a benchmark of methods, as JSON for scripts.


def benchmark_json(tree: xr.DataTree) -> dict[str, Any]:
    """Return an archive of a benchmark of methods as nested dicts of plain numbers and texts.

    They are ``methods.<name>`` with ``runs`` and ``replicates`` by budget; ``outputs.<output>``
    with ``mean``, ``std``, ``quantiles.<p>`` and ``exceedance.<threshold>``, each with
    ``reference``, ``errors.<method>.<budget>``, ``slopes.<method>`` and
    ``verdicts.<variant>.<budget>``.
    """
    comparison = MethodComparison.of(tree)
    outputs: dict[str, dict[str, Any]] = {}
    for entry in comparison.entries:
        output, statistic = outputs.setdefault(entry.output, {}), entry.statistic
        if statistic.dims:
            output.setdefault(statistic.shown.json, {})[entry.entry_name] = _statistic_json(entry)
        else:
            output[statistic.name] = _statistic_json(entry)
    return {
        **archive_identity(tree),
        "kind": tree.attrs[KIND],
        "repeats": comparison.repeats,
        "reference_runs": comparison.reference_runs,
        "methods": {
            method.name: {
                "source": method.source,
                "contests": list(method.variants),
                "runs": _by_budget(comparison, method.runs),
                "replicates": _by_budget(comparison, method.replicates),
            }
            for method in comparison.methods
        },
        "outputs": outputs,
    }


def _by_budget(comparison: MethodComparison, counts: Sequence[int]) -> dict[str, int]:
    return {str(at): count for at, count in zip(comparison.budgets, counts, strict=True)}


def _statistic_json(entry: ComparedEntry) -> dict[str, Any]:
    methods = entry.comparison.methods
    errors = {method.name: entries_json(entry.of(method, "error")) for method in methods}
    for method in methods:
        shares = entry.of(method, "coverage").values
        for error, share in zip(errors[method.name].values(), shares, strict=True):
            error["coverage"] = json_value(share)
    return {
        "units": entry.units,
        "reference": estimate_json(entry.reference),
        "relative_to": entry.error_scale,
        "errors": errors,
        "slopes": {m.name: estimate_json(entry.of(m, "slope")) for m in methods},
        "verdicts": {
            str(variant): {
                str(budget): _verdict_json(entry, i, j)
                for j, budget in enumerate(entry.comparison.budgets)
            }
            for i, variant in enumerate(entry.finding("lead")[VARIANT].values)
        },
    }


def _verdict_json(entry: ComparedEntry, variant: int, budget: int) -> dict[str, Any]:
    def text(name: str) -> str:
        return str(entry.finding(name).values[variant, budget])

    return {
        "winner": text("winner") or None,
        "runner_up": text("runner_up") or None,
        "level": text("level").split(),
        "lead": estimate_json(entry.finding("lead")[variant, budget]),
        "verdict": text("verdict"),
        "note": text("remark"),
    }
