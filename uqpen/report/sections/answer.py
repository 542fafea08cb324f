"""The main results: verdicts, sentences to quote, one picture, and what to mind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.charts.chart import Block, Charts
from uqpen.charts.distributions import bound_charts, model_chart
from uqpen.charts.histograms import histogram
from uqpen.charts.sweeps import sweep_charts
from uqpen.core.labels import DIFFERENCES, OUTCOME_OUTPUT, RUNS, SURROGATES, THRESHOLD
from uqpen.core.sampling import Sampling
from uqpen.core.statistic import AcceptanceVerdict
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.core.units import DIMENSIONLESS
from uqpen.execution import run_count, status_counts
from uqpen.report.blocks import Alerts, Columns, Finding, Findings, Fold, Quote, Table, Text
from uqpen.report.sections.failures import missing_run_sentences
from uqpen.report.sections.fields import field_sentences, first_curves
from uqpen.report.sections.findings import (
    agreement_sentences,
    alerts,
    driver_sentences,
    published_sentences,
)
from uqpen.report.sections.sentences import (
    OutputSentences,
    QuotedStatistic,
    bound_findings,
    decision_findings,
    default_statistic,
    joint_findings,
    main_outputs,
    measurement_findings,
    moments,
    no_break,
    ordered_outputs,
    outcome_sentences,
    output_name,
    output_sentences,
    rare_event_findings,
    requested_statistics,
)
from uqpen.results.acceptance import Acceptance
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import count_text, estimate_text, grouped_number, percent_texts
from uqpen.results.error_statement import MAIN, error_tables
from uqpen.results.failed_runs import FailedRuns, failed_runs
from uqpen.results.output_tables import runs_spent, tolerance_cell
from uqpen.results.repeats import noise_sentences
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.sweeps import sweep_tables
from uqpen.results.table import NOTHING, OutputTable, conversion, label_with_unit
from uqpen.results.texts import capitalized, join_names, plain_text, typeset_quantity, unit_suffix

# Outputs with sentences, and sentences that are not folded.
_MOST_OUTPUTS = 6
_MOST_SENTENCES = 3
# Bounds that are not folded, those of events first.
_MOST_BOUNDS = 4
# Reasons of failed runs.
_MOST_REASONS = 3


def answer(view: ArchiveView) -> Iterator[Block]:
    """The main results of a study; of several models, their differences first."""
    errors = _error_blocks(view)
    if not view.model:
        yield from _answer(view)
        yield from errors
        return
    yield from model_answer(view)
    for each in view.model_views:
        yield Fold(f"By {each.model} alone", tuple(_answer(each)))
    yield from errors


def _error_blocks(view: ArchiveView) -> Iterator[Block]:
    """Yield what errors are made of: of the first output with more than runs and surrogates say."""
    tables = [*error_tables(view.archive)]
    if tables and any(label.startswith(MAIN) for label, _ in tables[0].rows):
        yield Table(tables.pop(0))
    if tables:
        yield Fold("What the errors are made of", tuple(map(Table, tables)))


def _answer(view: ArchiveView) -> Iterator[Block]:
    """Verdicts and sentences by the leading design, what drives them, what to mind."""
    design = view.leading_design
    if design is None:
        yield from _answer_without_sample(view)
        return
    outputs = ordered_outputs(view, design)
    shown = [
        entry
        for output in outputs[:_MOST_OUTPUTS]
        if (entry := output_sentences(view, output, design)) is not None
    ]
    stated = tuple(_stated_blocks(view, design, shown, len(outputs) - _MOST_OUTPUTS))
    main = main_outputs(view)
    if view.numeric_outputs:
        # The runs of the first main output in bins, with the study's limits.
        first = next(each for each in main if each in view.numeric_outputs)
        chart = histogram(view, first, design)
        title = f"{capitalized(output_title(view, first))}: {chart.title}"
        yield Columns(stated, replace(chart, title=title))
    else:
        yield from stated
    if not view.model:
        yield from first_curves(view)
    quantities = [each for entry in shown for each in entry.quantities]
    findings = {
        "What drives it?": chain(*(driver_sentences(view, output) for output in main)),
        "How much of it is noise?": chain(*(noise_sentences(view, output) for output in main)),
        "Did all runs succeed?": chain(
            missing_run_sentences(view, design), outcome_sentences(view, design)
        ),
        "Does it agree with published values?": published_sentences(view, design),
        "Do the other methods agree?": agreement_sentences(quantities, design),
    }
    texts = ((head, " ".join(sentences)) for head, sentences in findings.items())
    yield Findings(tuple(Finding(head, text) for head, text in texts if text))
    yield Alerts(tuple(alerts(view, design, [each for each in quantities if each.output in main])))


def _stated_blocks(
    view: ArchiveView, design: str, shown: Sequence[OutputSentences], left: int
) -> Iterator[Block]:
    """Yield the verdicts on limits, the sentences, and the design behind them."""
    verdicts = [each for entry in shown for each in entry.verdicts]
    of_events = (
        *measurement_findings(view),
        *joint_findings(view, design),
        *rare_event_findings(view),
        *bound_findings(view),
    )
    if every := (*decision_findings(view), *verdicts, *of_events):
        yield Findings(every, is_verdict=True)
    if caveat := caveat_text(view, main_outputs(view), design):
        yield Text(caveat)
    main = main_outputs(view)
    of_main = [entry.sentences for entry in shown if entry.output in main]
    # How often runs end with an outcome is said with how many of them failed.
    rest = [
        each
        for entry in shown
        if entry.output not in (*main, OUTCOME_OUTPUT)
        for each in entry.sentences
    ]
    first = [each for sentences in of_main for each in sentences[:1]]
    second = [each for sentences in of_main for each in sentences[1:]]
    room = max(_MOST_SENTENCES - len(first), 0)
    stated, further = (*first, *second[:room]), (*second[room:], *rest)
    if stated:
        yield Quote(stated)
    if further:
        title = f"{count_text(len(further), 'more sentence')} to quote"
        yield Fold(title, (Quote(further),))
    if asked := tuple(each for entry in shown for each in entry.further):
        yield Findings(asked)
    if of_fields := tuple(field_sentences(view, design)):
        yield Quote(of_fields)
    omitted = sum(entry.omitted for entry in shown)
    parts = []
    if omitted:
        parts.append(f"{count_text(omitted, 'more estimate')} of these outputs")
    if left > 0:
        parts.append(count_text(left, "more output"))
    runs = view.design(design).runs
    completed, count = status_counts(runs)[Status.OK], run_count(runs)
    known = [str(view.tree.attrs.get(name, "")) for name in ("model_name", "model_version")]
    model = plain_text(" ".join(filter(None, known)))
    some = "all" if completed == count else grouped_number(completed)
    returned = f"{some} of {count_text(count, 'run')} of the model {model} completed"
    if count == 1:
        returned = f"a single run of the model {model}"
    sentences = (
        f"By {design}, {_leading_reason(view, design)}: {returned}.",
        *_correction_sentences(view, shown),
        f"Further down: {' and '.join(parts)}." if parts else "",
    )
    yield Text(" ".join(filter(None, sentences)))


def _correction_sentences(view: ArchiveView, shown: Sequence[OutputSentences]) -> Iterator[str]:
    """Yield which surrogates the sentences quote, and by how many runs they are corrected."""
    found = (each.leading_surrogate for entry in shown for each in entry.quantities)
    for name in dict.fromkeys(filter(None, found)):
        runs = count_text(runs_spent(view.tree, name) or 0, "run")
        yield f"Figures “as from plain runs” are by {name}, corrected by {runs}."


def _leading_reason(view: ArchiveView, design: str) -> str:
    if not view.is_sample_design(design):
        return (
            "a design for sensitivity indices; two of its matrices are a sample of the inputs, and "
            "no other sample of the study has a completed run"
        )
    earlier = [each for each in view.sample_designs if view.is_sample_design(each)]
    text = "" if earlier[0] == design else " with completed runs"
    taken = "presumed " if view.design(design).sampling is Sampling.GIVEN else ""
    return f"the first {taken}sample of the inputs in the study{text}"


def _answer_without_sample(view: ArchiveView) -> Iterator[Block]:
    """Yield what an archive says whose designs give no distribution, and the reason."""
    measured = (*measurement_findings(view),)
    if measured:
        yield Findings(measured, is_verdict=True)
    if of_events := (*rare_event_findings(view), *bound_findings(view)):
        yield Findings(of_events[:_MOST_BOUNDS], is_verdict=True)
    if further := of_events[_MOST_BOUNDS:]:
        yield Fold(f"{count_text(len(further), 'more answer')}", (Findings(further),))
    failed = [each for design in view.designs for each in failed_runs(view.tree, design)]
    every = [read_group(view.tree, RUNS, design) for design in view.designs]
    if not any(status_counts(runs)[Status.OK] for runs in every):
        runs = sum(map(run_count, every))
        count = "The only run failed." if runs == 1 else f"All {grouped_number(runs)} runs failed."
        yield Text(
            f"No run completed, so there are no estimates. {count} {_failure_reasons(failed)} "
            "Mend the model, raise its time limit, or change the inputs to values that it allows; "
            "then run the study again. The archive has the inputs of every failed run, so you can "
            "try a single one."
        )
        return
    if view.sample_designs:
        yield Text(
            f"No run of {', '.join(view.sample_designs)} completed, so the distributions of the "
            f"outputs are unknown. {_failure_reasons(failed)}"
        )
    elif not measured:
        yield from _reason_without_sample(view, has_events=bool(of_events))
    if means := tuple(_quadrature_means(view)):
        yield Quote(means)
    if SURROGATES in view.tree.children:
        yield Text(
            "Estimates by surrogates have no interval of their own, so they are not quoted here."
        )


def _reason_without_sample(view: ArchiveView, *, has_events: bool) -> Iterator[Block]:
    """Yield why the outputs have no distribution, with the charts of bounds."""
    samplings = {view.design(each).sampling for each in view.designs}
    if samplings == {Sampling.TOWARDS_BOUNDS}:
        yield Text("An input that is an interval has no distribution, so the outputs have none.")
        yield from bound_charts(view)
    elif samplings == {Sampling.OVER_BOX}:
        yield Text(
            "Parameters of the inputs are intervals, so the outputs have no one distribution: the "
            "bounds are the least and the largest answer of all that are possible."
        )
        yield from bound_charts(view)
    else:
        yield Text(
            "No design of this study is a sample of its inputs, so the distributions of the "
            f"outputs and all {'other ' * has_events}probabilities are unknown. The results "
            "of its designs are further down."
        )


def _quadrature_means(view: ArchiveView) -> Iterator[str]:
    rules = [each for each in view.designs if view.design(each).sampling is Sampling.QUADRATURE]
    for output in view.numeric_outputs[:_MOST_OUTPUTS]:
        quantity = moments(view, output)[0]
        for design in rules:
            array = quantity.estimate(design)
            if array is not None:
                name = output_name(view, output)
                stated = f"{quantity.texts(array)[0]} {quantity.interval(array)}"
                yield f"By the integration rule {design}, the mean of {name} is {stated}."
                break


def _failure_reasons(failed: Sequence[FailedRuns]) -> str:
    counts: Counter[tuple[Status, str]] = Counter()
    for each in failed:
        counts[each.status, each.reason] += each.runs
    texts = [
        f"“{plain_text(reason, 160)}” ({STATUS_TEXT[status]}, {count_text(number, 'run')})"
        for (status, reason), number in counts.most_common(_MOST_REASONS)
    ]
    more = len(counts) - len(texts)
    rest = f"; and {grouped_number(more)} other reasons" if more > 0 else ""
    head = "The reason" if len(counts) == 1 else "The most frequent reasons"
    return f"{head}: {'; '.join(texts)}{rest}." if texts else ""


# The main results of several models: how they differ, before what each says alone.
# Verdicts on a limit, the gravest first.
_VERDICTS = (AcceptanceVerdict.NOT_MET, AcceptanceVerdict.NOT_DECIDED, AcceptanceVerdict.MET)
# The ends that a tolerance limit states, and the place of its bound.
_TOLERANCE_BOUNDS = {"at most": 2, "at least": 1}
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
    limits = (each for output in main for each in _tolerance_limits(views, output, design))
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
    swept = (
        replace(each, title=f"{capitalized(output_title(view, each.of))}: {each.title}")
        for each in sweep_charts(view)
        if each.of in main
    )
    if found := tuple(swept):
        yield Charts(found)
    tables = (*sweep_tables(view.archive),) or _model_tables(views, design)
    for table in tables:
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


def _tolerance_limits(views: Sequence[ArchiveView], output: str, design: str) -> Iterator[Finding]:
    """Yield the tolerance limits of an output by each model, the smallest first.

    They are those of the first content, and of the largest that all models have a bound for.
    """
    for beyond, end in _TOLERANCE_BOUNDS.items():
        found = [
            (quantity, bounds)
            for quantity in requested_statistics(views[0], output, design)
            if quantity.statistic.shown.ends == beyond
            and (bounds := _tolerance_bounds(views, quantity, design, end)) is not None
        ]
        found.sort(key=lambda each: each[0].entry)
        for quantity, bounds in (*found[:1], *found[1:][-1:]):
            named = [f"{text} by {model}" for _, text, model in sorted(bounds)]
            yield Finding(
                quantity.heading,
                f"{capitalized(beyond)} {join_names(named)}: bounds that allow for the finite "
                "number of runs.",
            )


def _tolerance_bounds(
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
    if texts := list(model_form_texts(view, outputs, design)):
        yield Finding("How much is model form?", " ".join([*texts, _SCOPE]))


def model_form_texts(view: ArchiveView, outputs: Sequence[str], design: str) -> Iterator[str]:
    """Yield a sentence on the spread of each output, and of its events with limits."""
    statistics = SourceStatistics.of_model_form(view.archive)
    for output in outputs:
        arrays = statistics.statistics(design, output)
        if "model_form_share" not in arrays or np.isnan(arrays["model_form_share"].values[0]):
            continue
        parts = _parts_text(arrays["model_form_share"], arrays["parameter_share"])
        yield f"Of the variance of {output_name(view, output)}, {parts}."
        yield from _event_texts(arrays)


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
