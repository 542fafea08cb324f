"""An archive of a benchmark of methods as tables, with its verdicts in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import xarray as xr

from uqpen.core.labels import KIND, REPLICATED, SINGLE, VARIANT
from uqpen.results.digits import grouped_number, with_half_width
from uqpen.results.estimate_json import entries_json, estimate_json, json_value
from uqpen.results.json import archive_identity
from uqpen.results.method_comparison import ComparedEntry, MethodComparison
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import join_names

__all__ = [
    "IS_DOUBTFUL",
    "IS_LEVEL",
    "LEGEND",
    "WINS",
    "benchmark_json",
    "entry_table",
    "methods_table",
    "percentage_text",
    "reference_remarks",
    "replicated_verdicts",
    "single_set_verdicts",
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


# An archive of a benchmark of methods, as JSON for scripts.


def benchmark_json(tree: xr.DataTree) -> dict[str, Any]:
    """Return a benchmark as nested dicts of plain numbers and texts.

    Parameters
    ----------
    tree : DataTree
        An archive of a benchmark of methods.

    Returns
    -------
    dict
        ``methods.<name>`` with ``runs`` and ``replicates`` by budget; ``outputs.<output>`` with
        ``mean``, ``std``, ``quantiles.<p>`` and ``exceedance.<threshold>``, each with
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
