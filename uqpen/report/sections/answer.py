"""The main results: verdicts, sentences to quote, one picture, and what to mind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

from uqpen.archive.read import read_group
from uqpen.charts.chart import Block
from uqpen.charts.histograms import histogram
from uqpen.core.labels import RUNS, SURROGATES
from uqpen.core.sampling import Sampling
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.execution import run_count, status_counts
from uqpen.report.blocks import Alerts, Columns, Finding, Findings, Fold, Quote, Text
from uqpen.report.sections.agreement import agreement_sentences, published_sentences
from uqpen.report.sections.alerts import alerts
from uqpen.report.sections.drivers import driver_sentences
from uqpen.report.sections.failures import missing_run_sentences
from uqpen.report.sections.fields import field_sentences, first_curves
from uqpen.report.sections.main_outputs import main_outputs, ordered_outputs
from uqpen.report.sections.model_answer import caveat_text, model_answer
from uqpen.report.sections.quoted_statistics import moments, output_name
from uqpen.report.sections.sentences import (
    OutputSentences,
    decision_findings,
    joint_findings,
    output_sentences,
    rare_event_findings,
)
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import count_text, grouped_number
from uqpen.results.failed_runs import FailedRuns, failed_runs
from uqpen.results.output_tables import runs_spent
from uqpen.results.texts import capitalized, plain_text

__all__ = ["answer"]

# Outputs with sentences, and sentences that are not folded.
_MOST_OUTPUTS = 6
_MOST_SENTENCES = 3
# Reasons of failed runs.
_MOST_REASONS = 3


def answer(view: ArchiveView) -> Iterator[Block]:
    """The main results of a study; of several models, their differences first."""
    if not view.model:
        yield from _answer(view)
        return
    yield from model_answer(view)
    for each in view.model_views:
        yield Fold(f"By {each.model} alone", tuple(_answer(each)))


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
        "Did all runs succeed?": missing_run_sentences(view, design),
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
    of_events = (*joint_findings(view, design), *rare_event_findings(view))
    if every := (*decision_findings(view), *verdicts, *of_events):
        yield Findings(every, is_verdict=True)
    if caveat := caveat_text(view, main_outputs(view), design):
        yield Text(caveat)
    main = main_outputs(view)
    of_main = [entry.sentences for entry in shown if entry.output in main]
    rest = [each for entry in shown if entry.output not in main for each in entry.sentences]
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
    if of_events := tuple(rare_event_findings(view)):
        yield Findings(of_events, is_verdict=True)
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
    else:
        yield Text(
            "No design of this study is a sample of its inputs, so the distributions of the "
            f"outputs and all {'other ' * bool(of_events)}probabilities are unknown. The results "
            "of its designs are further down."
        )
    if means := tuple(_quadrature_means(view)):
        yield Quote(means)
    if SURROGATES in view.tree.children:
        yield Text(
            "Estimates by surrogates have no interval of their own, so they are not quoted here."
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
