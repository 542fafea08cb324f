"""The main results of several models: how they differ, before what each says alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uqpen.archive.read import group_names
from uqpen.charts.chart import Block
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import DIFFERENCES
from uqpen.core.units import DIMENSIONLESS
from uqpen.report.blocks import Alerts, Columns, Finding, Findings, Fold, Table, Text
from uqpen.report.sections.alerts import alerts
from uqpen.report.sections.curve_overview import first_curves
from uqpen.report.sections.leading_design import leading_design
from uqpen.report.sections.main_outputs import main_outputs
from uqpen.report.sections.missing_runs import missing_run_sentences
from uqpen.report.sections.model_comparison import model_chart
from uqpen.report.sections.model_verdicts import (
    caveat_text,
    model_form_findings,
    model_limits,
    model_verdicts,
)
from uqpen.report.sections.quoted_statistics import (
    QuotedStatistic,
    default_statistic,
    no_break,
    output_name,
    requested_statistics,
)
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import estimate_text
from uqpen.results.output_tables import tolerance_cell
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import NOTHING, OutputTable, conversion, label_with_unit
from uqpen.results.texts import capitalized, unit_suffix

__all__ = ["model_answer"]


def model_answer(view: ArchiveView) -> Iterator[Block]:
    """Yield what the models say of the study's limits, how they differ, and a table of results."""
    views = view.model_views
    design = leading_design(view)
    if design is None:
        return
    yield from first_curves(view)
    main = main_outputs(view)
    entries = tuple(_differences(view, design))
    verdicts = tuple(each for output in main for each in model_verdicts(views, output, design))
    limits = (each for output in main for each in model_limits(views, output, design))
    form = (*limits, *model_form_findings(view, main, design))
    blocks: tuple[Block, ...] = (Text("The archive has no differences of its models."),)
    if entries or verdicts:
        blocks = (Findings(verdicts or entries, is_verdict=True),)
    if caveat := caveat_text(view, main, design):
        blocks = (*blocks, Text(caveat))
    if form:
        blocks = (*blocks, Findings(form))
    charts = (model_chart(view, output, design) for output in main)
    if (chart := next(filter(None, charts), None)) is not None:
        yield Columns(blocks, chart)
    else:
        yield from blocks
    for table in _model_tables(views, design):
        yield Table(table)
    if verdicts and entries:
        yield Fold("How the means differ", (Findings(entries),))
    yield Findings((Finding("Did all runs succeed?", " ".join(_missing(views))),))
    yield Alerts(tuple(alerts(view, design, ())))


def _missing(views: list[ArchiveView]) -> Iterator[str]:
    """Yield the failed runs of each model by its leading design."""
    for each in views:
        if (design := leading_design(each)) is None:
            yield f"{each.model}: no run completed."
        else:
            yield f"{each.model}: {next(missing_run_sentences(each, design))}"


def _differences(view: ArchiveView, design: str) -> Iterator[Finding]:
    """Yield the mean difference of each model from the first, for the main outputs."""
    for other in group_names(view.archive, DIFFERENCES):
        statistics = SourceStatistics.of_differences(view.archive, other)
        texts = []
        for output in view.numeric_outputs:
            array = statistics.get(design, output, "mean")
            if array is None or not np.isfinite(array.values[0]):
                continue
            convert = conversion("mean", view.scale(output), is_difference=True)
            bounds = np.asarray(convert(array.values), dtype=np.float64)
            size = no_break(f"{estimate_text(*bounds.tolist())}{unit_suffix(view.unit(output))}")
            texts.append(f"{output_name(view, output)} {size}")
        if texts:
            first = statistics.minus(design) or view.model_views[0].model
            yield Finding(f"{other} minus {first}", f"Mean difference: {'; '.join(texts)}.")


def _model_tables(views: list[ArchiveView], design: str) -> Iterator[OutputTable]:
    """Yield the requested and the usual statistics of outputs, with a column a model.

    Each main output has a table of its own.
    """
    main = main_outputs(views[0])
    for output in main:
        if output in views[0].numeric_outputs:
            title = f"{capitalized(output_title(views[0], output))} by model, {design}"
            table = OutputTable(title, [each.model for each in views])
            _add_rows(table, views, output, design)
            yield table
    if others := [each for each in views[0].numeric_outputs if each not in main]:
        table = OutputTable(f"Other outputs by model, {design}", [each.model for each in views])
        for output in others:
            _add_rows(table, views, output, design, is_named=True)
        yield table


def _add_rows(
    table: OutputTable,
    views: list[ArchiveView],
    output: str,
    design: str,
    *,
    is_named: bool = False,
) -> None:
    """Add the statistics of an output; its name goes before each where there are several."""
    asked = requested_statistics(views[0], output, design)
    usual = default_statistic(views[0], output, design)
    every = [*asked, *([usual] if usual is not None else [])]
    for quantity in sorted(every, key=lambda each: not each.is_probability):
        cells = [_cell(table, each, quantity, design) for each in views]
        unit = DIMENSIONLESS if quantity.is_probability else views[0].unit(output)
        label = quantity.heading if is_named else capitalized(quantity.label)
        table.rows.append((label_with_unit(label, unit), cells))


def _cell(table: OutputTable, view: ArchiveView, quantity: QuotedStatistic, design: str) -> str:
    if quantity.output not in view.numeric_outputs:
        return NOTHING
    own = QuotedStatistic(view, quantity.output, quantity.statistic, quantity.entry)
    array = own.estimate(design)
    statistic = CATALOGUE[quantity.statistic]
    if statistic.shown.ends:
        return tolerance_cell(table, statistic, array, view.scale(quantity.output))
    return table.cell(array, view.conversion(quantity.output, quantity.statistic))
