"""The main results of several models: how they differ, before what each says alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names
from uqpen.charts.chart import Block
from uqpen.charts.distributions import model_chart
from uqpen.core.labels import DIFFERENCES, THRESHOLD
from uqpen.core.units import DIMENSIONLESS
from uqpen.report.blocks import Alerts, Columns, Finding, Findings, Fold, Table, Text
from uqpen.report.sections.alerts import alerts
from uqpen.report.sections.failures import missing_run_sentences
from uqpen.report.sections.fields import first_curves
from uqpen.report.sections.main_outputs import main_outputs
from uqpen.report.sections.quoted_statistics import (
    QuotedStatistic,
    default_statistic,
    moments,
    no_break,
    output_name,
    requested_statistics,
)
from uqpen.results.acceptance import Acceptance, AcceptanceVerdict
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import estimate_text, percent_texts
from uqpen.results.output_tables import tolerance_cell
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import NOTHING, OutputTable, conversion, label_with_unit
from uqpen.results.texts import capitalized, join_names, plain_text, typeset_quantity, unit_suffix

__all__ = ["caveat_text", "model_answer"]
# Verdicts on a limit, the gravest first.
_VERDICTS = (AcceptanceVerdict.NOT_MET, AcceptanceVerdict.NOT_DECIDED, AcceptanceVerdict.MET)
# The ends that a tolerance limit states, and the place of its bound.
_BOUNDS = {"at most": 2, "at least": 1}
_SCOPE = (
    "Each model counts the same. They are no sample of all models: another one can lie outside "
    "them."
)


def model_answer(view: ArchiveView) -> Iterator[Block]:
    """Yield what the models say of the study's limits, how they differ, and a table of results."""
    views = view.model_views
    design = view.leading_design
    if design is None:
        return
    yield from first_curves(view)
    main = main_outputs(view)
    entries = tuple(_differences(view, design))
    verdicts = tuple(each for output in main for each in _verdicts(views, output, design))
    limits = (each for output in main for each in _limits(views, output, design))
    form = (*limits, *_model_form_findings(view, main, design))
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
    missing = []
    for each in views:
        own = each.leading_design
        failed = "no run completed." if own is None else next(missing_run_sentences(each, own))
        missing.append(f"{each.model}: {failed}")
    yield Findings((Finding("Did all runs succeed?", " ".join(missing)),))
    yield Alerts(tuple(alerts(view, design, ())))


def _differences(view: ArchiveView, design: str) -> Iterator[Finding]:
    """Yield the mean difference of each model from the first, for the main outputs."""
    for other in group_names(view.archive, DIFFERENCES):
        statistics = SourceStatistics.of_differences(view.archive, other)
        texts = []
        for output in view.numeric_outputs:
            mean, _ = moments(view, output)
            array = statistics.get(design, output, mean.statistic.name)
            if array is None or not np.isfinite(array.values[0]):
                continue
            convert = conversion(mean.statistic, view.scale(output), is_difference=True)
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
    array = replace(quantity, view=view).estimate(design)
    if quantity.statistic.shown.ends:
        return tolerance_cell(table, quantity.statistic, array, view.scale(quantity.output))
    return table.cell(array, view.conversion(quantity.output, quantity.statistic))


def _verdicts(views: Sequence[ArchiveView], output: str, design: str) -> Iterator[Finding]:
    """Yield what the models say of each limit of the study on a probability of an output."""
    for quantity in requested_statistics(views[0], output, design):
        if quantity.statistic.shown.event:
            own = (
                (view.model, replace(quantity, view=view).leading_estimate(design))
                for view in views
                if quantity.output in view.numeric_outputs
            )
            found = {model: array for model, array in own if array is not None}
            if finding := _verdict(quantity, found):
                yield finding


def _limits(views: Sequence[ArchiveView], output: str, design: str) -> Iterator[Finding]:
    """Yield the tolerance limits of an output by each model, the smallest first.

    They are those of the first content, and of the largest that all models have a bound for.
    """
    for beyond, end in _BOUNDS.items():
        found = [
            (quantity, bounds)
            for quantity in requested_statistics(views[0], output, design)
            if quantity.statistic.shown.ends == beyond
            and (bounds := _bounds(views, quantity, design, end)) is not None
        ]
        found.sort(key=lambda each: each[0].entry)
        for quantity, bounds in (*found[:1], *found[1:][-1:]):
            named = [f"{text} by {model}" for _, text, model in sorted(bounds)]
            yield Finding(
                quantity.heading,
                f"{capitalized(beyond)} {join_names(named)}: bounds that allow for the finite "
                "number of runs.",
            )


def _bounds(
    views: Sequence[ArchiveView], quantity: QuotedStatistic, design: str, end: int
) -> tuple[tuple[float, str, str], ...] | None:
    """Return the bound of a limit by each model, as number and as text; None if one has none."""
    found = []
    for view in views:
        own = replace(quantity, view=view)
        array = own.estimate(design) if quantity.output in view.numeric_outputs else None
        if array is None or not np.isfinite(array.values[end]):
            return None
        found.append((float(array.values[end]), own.texts(array)[end], view.model))
    return tuple(found)


def _verdict(quantity: QuotedStatistic, found: Mapping[str, xr.DataArray]) -> Finding | None:
    """Return what the models say of a limit; None where the study accepts any probability."""
    every = {name: Acceptance.from_array(array) for name, array in found.items()}
    accepted = {name: each for name, each in every.items() if each is not None}
    if not accepted:
        return None
    parts = []
    for verdict in _VERDICTS:
        names = [name for name, each in accepted.items() if each.verdict is verdict]
        if names:
            listed = "; ".join(f"{name} {_share(quantity, found[name])}" for name in names)
            parts.append(f"{verdict} by {len(names)} of {len(accepted)} models ({listed})")
    limit = no_break(str(next(iter(accepted.values()))))
    threshold = no_break(typeset_quantity(plain_text(quantity.entry)))
    name = capitalized(output_name(quantity.view, quantity.output))
    return Finding(
        f"{name} {quantity.statistic.shown.event} {threshold}",
        f"The limit of the study, {limit} of cases, is {', and '.join(parts)}.",
    )


def _share(quantity: QuotedStatistic, array: xr.DataArray) -> str:
    """Return a probability with its interval; of an event that no run has shown, its upper end."""
    estimate, lower, upper = quantity.texts(array)
    if not np.isfinite(array.values[1:]).all():
        return estimate
    if array.values[0] == 0:
        return no_break(f"at most {upper}")
    if array.values[0] == 1:
        return no_break(f"at least {lower}")
    return f"{estimate}, {no_break(f'{lower} to {upper}')}"


def _model_form_findings(
    view: ArchiveView, outputs: Sequence[str], design: str
) -> Iterator[Finding]:
    """Yield how much of the spread of each output is model form, and how much is its inputs."""
    statistics = SourceStatistics.of_model_form(view.archive)
    texts = []
    for output in outputs:
        arrays = statistics.statistics(design, output)
        if "model_form_share" not in arrays or np.isnan(arrays["model_form_share"].values[0]):
            continue
        parts = _parts_text(arrays["model_form_share"], arrays["parameter_share"])
        texts.append(f"Of the variance of {output_name(view, output)}, {parts}.")
        texts += _event_texts(arrays)
    if texts:
        yield Finding("How much is model form?", " ".join([*texts, _SCOPE]))


def _event_texts(arrays: Mapping[str, xr.DataArray]) -> Iterator[str]:
    """Yield the same of the events with acceptance limits."""
    form, inputs = (
        arrays.get(f"exceedance_{name}") for name in ("model_form_share", "parameter_share")
    )
    if form is None or inputs is None:
        return
    for of_form, of_inputs in zip(form, inputs, strict=True):
        if Acceptance.from_array(of_form) is not None and np.isfinite(of_form.values[0]):
            threshold = no_break(typeset_quantity(plain_text(str(of_form[THRESHOLD].item()))))
            yield f"Of whether it is above {threshold}, {_parts_text(of_form, of_inputs)}."


def _parts_text(form: xr.DataArray, inputs: xr.DataArray) -> str:
    of_models, of_inputs = map(_with_interval, (form, inputs))
    return f"{of_models} is between the models, and {of_inputs} between inputs"


def _with_interval(array: xr.DataArray) -> str:
    estimate, lower, upper = map(no_break, percent_texts(*array.values.tolist()))
    if not np.isfinite(array.values[1:]).all():
        return f"{estimate} (without an interval)"
    return f"{estimate} ({no_break(f'{lower} to {upper}')})"


def caveat_text(view: ArchiveView, outputs: Sequence[str], design: str) -> str:
    """Return what the study says that a reader has to mind of outputs; empty for nothing."""
    found = (view.statistics.caveat(design, output) for output in outputs)
    return " ".join(dict.fromkeys(plain_text(each, 1_000) for each in found if each))
