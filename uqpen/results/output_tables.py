"""An archive as tables: one for each output, a column for each source of estimates."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.core.catalogue import MEAN, MODEL_FORM_STATISTICS, REQUESTED, STD
from uqpen.core.labels import (
    AGREEMENT,
    CODED_INPUTS,
    CONDITIONAL,
    CONFIDENCE_LEVEL,
    DIFFERENCES,
    DISTANT_VALUES,
    DROPPED_ROWS,
    INTERVAL_LEVEL,
    MISSING,
    MODELS,
    OF_EXCEEDANCE,
    PROBABILITY,
    REWEIGHTED,
    RUNS,
    RUNS_ABSENT,
    RUNS_SPENT,
    SURROGATES,
    THRESHOLD,
)
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.core.units import DIMENSIONLESS, Scale, scale
from uqpen.execution import run_count, status_counts
from uqpen.results.acceptance import add_verdicts, stopping_text
from uqpen.results.archive_view import is_logarithmic, linear_scale_note
from uqpen.results.design_groups import group_tables
from uqpen.results.digits import (
    grouped_number,
    lower_tolerance_limit_text,
    percent_text,
    range_text,
    tolerance_interval_texts,
    tolerance_limit_text,
)
from uqpen.results.error_statement import error_tables
from uqpen.results.input_measures import generalized_table, named_tables, noise_tables
from uqpen.results.source_statistics import (
    SHOWN,
    SourceStatistics,
    described_statistics,
    labelled_entries,
    source_entries,
    user_defined,
)
from uqpen.results.surrogate_tables import correction_tables, fit_table, missing_run_tables
from uqpen.results.sweeps import sweep_tables
from uqpen.results.table import (
    NOTHING,
    Conversion,
    OutputTable,
    conversion,
    estimate_remark,
    exceedance_label,
    headed_models,
    identity,
    label_with_unit,
)

# What the failed runs of a design mean for its statistics, by the attribute that says how.
_QUALIFICATIONS = {
    CONDITIONAL: "statistics are conditional on {}",
    MISSING: "statistics use the completed runs; {} failed",
}

# The shares of the variance over several models, of an output and of its exceeding a value.
_MODEL_FORM = [each for each in MODEL_FORM_STATISTICS.values() if not each.of]
_OF_EVENTS = [each.name for each in MODEL_FORM_STATISTICS.values() if each.prefix == OF_EXCEEDANCE]
_EQUAL_WEIGHT = (
    "models of equal weight, which are no sample of all models: the share of model form is of these"
)


def output_tables(tree: xr.DataTree, *, everything: bool = False) -> Iterator[OutputTable]:
    """Yield the tables of each output of each model of an archive, with its sensitivity tables.

    These have all measures with `everything`.
    """
    level = _level_text(tree)
    for table in sweep_tables(tree):
        yield replace(table, title=f"{table.title}{level}")
    for head, model in headed_models(tree).items():
        for table in _model_tables(model, everything=everything):
            yield replace(table, title=f"{head}{table.title}{level}")
        for surrogate in group_names(model, SURROGATES):
            table = fit_table(surrogate, model.children[SURROGATES].children[surrogate])
            yield replace(table, title=head + table.title)
            for table in correction_tables(model, surrogate):
                yield replace(table, title=f"{head}{table.title}{level}")
            for table in missing_run_tables(model, surrogate):
                yield replace(table, title=head + table.title)
    for table in error_tables(tree):
        yield replace(table, title=f"{table.title}{level}")
    yield from group_tables(tree, is_of_model=False)


def statistics_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the statistics of each output of each model of an archive."""
    level = _level_text(tree)
    for head, model in headed_models(tree).items():
        statistics = SourceStatistics(model)
        for output in statistics.scalar_outputs:
            if table := statistics_table(statistics, output):
                yield replace(table, title=f"{head}{table.title}{level}")


def _level_text(tree: xr.DataTree) -> str:
    """Return the confidence level for a title, where it is not the usual one."""
    level = tree.attrs.get(CONFIDENCE_LEVEL)
    return "" if level is None else f", {percent_text(float(level))} intervals"


def _model_tables(model: xr.DataTree, *, everything: bool) -> Iterator[OutputTable]:
    statistics = SourceStatistics(model)
    fields = statistics.fields
    # Of several fields, each has a line of its own first; who selects one sees its shares.
    for output in fields if everything or len(fields) == 1 else ():
        if table := generalized_table(model, output):
            yield table
    for output in statistics.scalar_outputs:
        if table := statistics_table(statistics, output):
            yield table
        unit = statistics.unit(output)
        measures = named_tables(statistics, output, unit, everything=everything)
        yield from (table for _, table in measures)
        if everything:
            yield from (table for _, table in noise_tables(statistics, output, unit))
    yield from group_tables(model, is_of_model=True)


def difference_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the differences of the other models from the first, a table for each output."""
    for other in group_names(tree, DIFFERENCES):
        statistics = SourceStatistics.of_differences(tree, other)
        for name in statistics.scalar_outputs:
            if sources := list(statistics.by_source(name, MEAN.name)):
                title = f"{other} minus {statistics.minus(sources[0])}: {name}"
                title = label_with_unit(title, statistics.unit(name)) + _level_text(tree)
                table = OutputTable(title, sources)
                _add_statistics(table, statistics, name)
                yield table


def model_form_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the shares of each output's variance over all models, for each design.

    The first row is of the output itself, the others of its exceeding the study's thresholds.
    """
    statistics = SourceStatistics.of_model_form(tree)
    count = len(group_names(tree, MODELS))
    for design in statistics.sources:
        for output in statistics.outputs:
            found = statistics.statistics(design, output)
            if _MODEL_FORM[0].name not in found:
                continue
            title = f"{output} by {count} models: shares of its variance, {design}"
            table = OutputTable(title, [each.shown.label for each in _MODEL_FORM])
            mark = table.note_mark(_EQUAL_WEIGHT)
            shares = [table.cell(found[each.name]) for each in _MODEL_FORM]
            table.rows.append((f"value{mark}", shares))
            events = {name: found[name] for name in _OF_EVENTS if name in found}
            for threshold, entries in source_entries(events, THRESHOLD):
                cells = [table.cell(entry) for entry in entries.values()]
                table.rows.append((exceedance_label(str(threshold)), cells))
            yield table


# The statistics of one output by all sources


def statistics_table(statistics: SourceStatistics, name: str) -> OutputTable | None:
    """Return the statistics of one output from all sources; None where no source has any."""
    is_categorical = "flag_meanings" in statistics.attributes(name)
    sources = list(statistics.by_source(name, "share" if is_categorical else MEAN.name))
    # Designs that have values far out of an output, and no mean.
    tails = {source for each in REQUESTED for source in statistics.by_source(name, each.name)}
    tails.difference_update(sources)
    sources += [
        each for each in statistics.sources if each in tails and statistics.kind(each) == "design"
    ]
    if not sources:
        return None
    table = OutputTable(statistics.label(name), sources)
    table.title += table.note_mark(statistics.caveat(sources[0], name))
    cells = []
    for source in table.columns:
        runs, spent = read_group(statistics.tree, RUNS, source), runs_spent(statistics.tree, source)
        of_file = (REWEIGHTED, AGREEMENT, DROPPED_ROWS, DISTANT_VALUES, CODED_INPUTS)
        notes = [stopping_text(runs), *(str(runs.attrs.get(each, "")) for each in of_file)]
        if (cost := statistics.cost_spent(source)) is not None:
            notes.append(f"with the runs of the stand-ins, the cost of {cost:.4g} runs")
        text = NOTHING if spent is None else grouped_number(spent)
        cells.append(text + table.note_mark(*notes))
    table.rows.append(("runs", cells))
    _add_failed_runs(table, statistics)
    absences = [statistics.absence(source, name) for source in table.columns]
    if any(absences):
        cells = [
            grouped_number(each[RUNS_ABSENT])
            + table.note_mark(_QUALIFICATIONS[CONDITIONAL].format(each[CONDITIONAL]))
            if each
            else NOTHING
            for each in absences
        ]
        table.rows.append(("without a value", cells))
    if is_categorical:
        add_shares(table, statistics, name)
    else:
        _add_statistics(table, statistics, name, is_log=is_logarithmic(statistics, name))
        table.title += table.note_mark(linear_scale_note(statistics, name))
        decisions = [statistics.decision(source) for source in table.columns]
        of_output = (each for each in decisions if each and each.output == name)
        for claim in dict.fromkeys(each.claim for each in of_output):
            cells = [
                each.verdict_text + table.note_mark(each.guarantee)
                if each and each.claim == claim
                else NOTHING
                for each in decisions
            ]
            table.rows.append((claim, cells))
    _add_user_defined(table, statistics, name)
    return table


def runs_spent(tree: xr.DataTree, source: str) -> int | None:
    """Return the runs of a design, or those that a surrogate took; None without any."""
    surrogate = read_group(tree, SURROGATES, source)
    if RUNS_SPENT in surrogate.attrs:
        return int(surrogate.attrs[RUNS_SPENT])
    runs = read_group(tree, RUNS, source)
    return run_count(runs) if runs else None


def _add_failed_runs(table: OutputTable, statistics: SourceStatistics) -> None:
    """Add a row of the failed runs of each design, and their probability for each status."""
    groups = {source: read_group(statistics.tree, RUNS, source) for source in table.columns}
    counts = {source: status_counts(runs) for source, runs in groups.items() if runs}
    chances = {source: statistics.status_probabilities(source) for source in table.columns}
    cells = []
    for source in table.columns:
        failed = [f"{n} {STATUS_TEXT[s]}" for s, n in counts.get(source, {}).items() if n and s]
        accounts = statistics.run_accounts(source)
        notes = (_QUALIFICATIONS[key].format(text) for key, text in accounts.items())
        text = (", ".join(failed) or "0") + table.note_mark(*notes)
        cells.append(text if source in counts else NOTHING)
    table.rows.append(("lost", cells))
    for status in Status:
        if status is not Status.OK and any(each[status] for each in counts.values()):
            meaning = status.meaning
            found = {source: each[meaning] for source, each in chances.items() if meaning in each}
            table.rows.append((f"P({STATUS_TEXT[status]})", table.cells(found)))


def add_shares(table: OutputTable, statistics: SourceStatistics, name: str) -> None:
    """Add a row for each category of an output."""
    arrays = statistics.by_source(name, "share", table.columns)
    for label, found in source_entries(arrays, "category_label"):
        table.rows.append((f"share {label}", table.cells(found)))


def _add_statistics(
    table: OutputTable, statistics: SourceStatistics, output: str, *, is_log: bool = False
) -> None:
    """Add a row for each number that the archive has an estimate of."""
    # Shares have rows of all outputs with categories, and bands a table of their own.
    left_out = {"share", "tolerance_band"}
    stds = statistics.by_source(output, STD.name, table.columns).values()
    if not any(math.isnan(std.values[1]) and std.values[0] > 0 for std in stds):
        left_out.add("half_spread")
    every = (*SHOWN, *described_statistics(statistics, output))
    shown = [each for each in every if each.name not in left_out]
    shown.sort(key=lambda each: each.shown.row)
    if is_log:
        # A mean over tenfolds is that of few runs, so quantiles come before the moments.
        shown.sort(
            key=lambda each: each.shown.row >= MEAN.shown.row and PROBABILITY not in each.dims
        )
    unjudged = [
        each for each in table.columns if statistics.kind(each) not in ("design", "surrogate")
    ]
    for statistic in shown:
        arrays = statistics.by_source(output, statistic.name, table.columns)
        for label, entries in labelled_entries(statistic, arrays):
            cells = _cells(table, statistics, output, (statistic, entries), is_log=is_log)
            if statistic.shown.ends or any(cell != NOTHING for cell in cells):
                table.rows.append((label, cells))
            if statistic.shown.has_verdict:
                add_verdicts(table, entries, without=unjudged)


def _cells(
    table: OutputTable,
    statistics: SourceStatistics,
    output: str,
    row: tuple[Statistic, Mapping[str, xr.DataArray]],
    *,
    is_log: bool,
) -> list[str]:
    """Return the cells of an entry of a statistic, with reasons where a study asks for it."""
    (statistic, entries), measure = row, scale(statistics.unit(output))
    if statistic.shown.ends:
        limits = (entries.get(source) for source in table.columns)
        cells = [tolerance_cell(table, statistic, each, measure) for each in limits]
    else:
        convert = conversion(statistic, measure, is_difference=statistics.is_difference)
        has_logarithm = is_log and statistic.unit is UnitRule.VALUE
        cells = table.cells(entries, convert, is_logarithmic=has_logarithm)
    if statistic.asked.key and entries:
        for place, source in enumerate(table.columns):
            if source not in entries:
                cells[place] += table.note_mark(statistics.reason_without(source))
    return cells


def tolerance_cell(
    table: OutputTable, statistic: Statistic, array: xr.DataArray | None, shown: Scale
) -> str:
    """Return the cell of a tolerance limit, a statistic that states an end."""
    if array is None:
        return NOTHING
    ends = statistic.shown.ends
    estimate, lower, upper = shown.from_si(array.values)
    if ends == "at most":
        text = tolerance_limit_text(estimate, upper)
    elif ends == "at least":
        text = lower_tolerance_limit_text(estimate, lower)
    else:
        has_ends = not math.isnan(lower)
        text = range_text(*tolerance_interval_texts(lower, upper)) if has_ends else NOTHING
    note = ""
    estimate, lower, upper = array.values.tolist()
    if lower < upper or lower < estimate or upper > estimate:
        confidence = f"{percent_text(array.attrs[INTERVAL_LEVEL])} confidence"
        note = f"{ends}: one-sided tolerance bound, {confidence}"
        if ends == "between":
            note = f"tolerance interval: contains its share of all cases with {confidence}"
    return text + table.note_mark(estimate_remark(array), note)


def _add_user_defined(table: OutputTable, statistics: SourceStatistics, output: str) -> None:
    """Add a row for each entry of the statistics without a record."""
    described = {each.name for each in described_statistics(statistics, output)}
    cells: dict[tuple[str, str], dict[str, str]] = {}
    for source in table.columns:
        for name, array in user_defined(statistics.statistics(source, output)).items():
            if name in described:
                continue
            title = str(array.attrs.get("long_name", name))
            convert, unit = _own_unit(array, statistics, output)
            dims = array.dims[:-1]
            for place in np.ndindex(array.shape[:-1]):
                at = zip(dims, place, strict=True)
                entry = ", ".join(f"{dim}={array[dim].values.tolist()[i]}" for dim, i in at)
                label = label_with_unit(f"{title} ({entry})" if entry else title, unit)
                cells.setdefault((name, label), {})[source] = table.cell(array[place], convert)
    for (_, label), by_source in cells.items():
        table.rows.append((label, [by_source.get(source, NOTHING) for source in table.columns]))


def _own_unit(
    array: xr.DataArray, statistics: SourceStatistics, output: str
) -> tuple[Conversion, str]:
    """Return the conversion of a statistic, and its unit where that is not the output's."""
    own, rule = (str(array.attrs.get(name, "")) for name in ("units", "unit_rule"))
    if own == statistics.si_unit(output) and rule in ("value", "difference"):
        shown = scale(statistics.unit(output))
        is_value = rule == "value" and not statistics.is_difference
        return shown.from_si if is_value else shown.difference_from_si, DIMENSIONLESS
    return identity, own or DIMENSIONLESS
