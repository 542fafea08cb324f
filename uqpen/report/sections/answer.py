"""The main results: verdicts, sentences to quote, one picture, and what to mind."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from uqpen.charts.chart import Block, Chart
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.execution import run_count, status_counts
from uqpen.report.blocks import Alerts, Columns, Finding, Findings, Fold, Quote, Text
from uqpen.report.counting import count_text
from uqpen.report.sections.alerts import alerts
from uqpen.report.sections.answer_without_sample import answer_without_sample
from uqpen.report.sections.curve_overview import first_curves
from uqpen.report.sections.decision_findings import decision_findings
from uqpen.report.sections.drivers import driver_sentences
from uqpen.report.sections.field_sentences import field_sentences
from uqpen.report.sections.histograms import histogram
from uqpen.report.sections.joint_findings import joint_findings, rare_event_findings
from uqpen.report.sections.leading_design import leading_design
from uqpen.report.sections.main_outputs import main_outputs, ordered_outputs
from uqpen.report.sections.method_agreement import agreement_text
from uqpen.report.sections.missing_runs import missing_run_sentences
from uqpen.report.sections.model_answer import model_answer
from uqpen.report.sections.model_verdicts import caveat_text
from uqpen.report.sections.published_agreement import published_sentences
from uqpen.report.sections.sentences import OutputSentences, output_sentences
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import grouped_number
from uqpen.results.output_tables import runs_spent
from uqpen.results.texts import capitalized, plain_text

__all__ = ["answer"]

# Outputs with sentences, and sentences that are not folded.
_MOST_OUTPUTS = 6
_MOST_SENTENCES = 3


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
    design = leading_design(view)
    if design is None:
        yield from answer_without_sample(view)
        return
    outputs = ordered_outputs(view, design)
    shown = [
        entry
        for output in outputs[:_MOST_OUTPUTS]
        if (entry := output_sentences(view, output, design)) is not None
    ]
    stated = tuple(_stated_blocks(view, design, shown, len(outputs) - _MOST_OUTPUTS))
    if view.numeric_outputs:
        yield Columns(stated, _picture(view, design))
    else:
        yield from stated
    if not view.model:
        yield from first_curves(view)
    quantities = [each for entry in shown for each in entry.quantities]
    findings = (
        Finding("What drives it?", _driver_text(view)),
        Finding("Did all runs succeed?", " ".join(missing_run_sentences(view, design))),
        Finding(
            "Does it agree with published values?", " ".join(published_sentences(view, design))
        ),
        Finding("Do the other methods agree?", agreement_text(quantities, design)),
    )
    yield Findings(tuple(each for each in findings if each.text))
    main = main_outputs(view)
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
    stated, further = _ordered_sentences(shown, main_outputs(view))
    if stated:
        yield Quote(stated)
    if further:
        title = f"{count_text(len(further), 'more sentence')} to quote"
        yield Fold(title, (Quote(further),))
    if asked := tuple(each for entry in shown for each in entry.further):
        yield Findings(asked)
    if of_fields := tuple(field_sentences(view, design)):
        yield Quote(of_fields)
    sentences = (
        _origin_sentence(view, design),
        *_correction_sentences(view, shown),
        _omissions(shown, left),
    )
    yield Text(" ".join(filter(None, sentences)))


def _ordered_sentences(
    shown: Sequence[OutputSentences], main: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the sentences that are seen at once, and the others: one on each main output first."""
    of_main = [entry.sentences for entry in shown if entry.output in main]
    rest = [each for entry in shown if entry.output not in main for each in entry.sentences]
    first = [each for sentences in of_main for each in sentences[:1]]
    second = [each for sentences in of_main for each in sentences[1:]]
    room = max(_MOST_SENTENCES - len(first), 0)
    return (*first, *second[:room]), (*second[room:], *rest)


def _omissions(shown: Sequence[OutputSentences], outputs: int) -> str:
    omitted = sum(entry.omitted for entry in shown)
    parts = []
    if omitted:
        parts.append(f"{count_text(omitted, 'more estimate')} of these outputs")
    if outputs > 0:
        parts.append(count_text(outputs, "more output"))
    return f"Further down: {' and '.join(parts)}." if parts else ""


def _origin_sentence(view: ArchiveView, design: str) -> str:
    runs = view.design(design).runs
    completed, every = status_counts(runs)[Status.OK], run_count(runs)
    known = [str(view.tree.attrs.get(name, "")) for name in ("model_name", "model_version")]
    model = plain_text(" ".join(filter(None, known)))
    some = "all" if completed == every else grouped_number(completed)
    returned = f"{some} of {count_text(every, 'run')} of the model {model} completed"
    if every == 1:
        returned = f"a single run of the model {model}"
    return f"By {design}, {_leading_reason(view, design)}: {returned}."


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


def _picture(view: ArchiveView, design: str) -> Chart:
    """Return the runs of the first main output in bins, with the study's limits."""
    (output, *_) = [each for each in main_outputs(view) if each in view.numeric_outputs]
    chart = histogram(view, output, design)
    title = f"{capitalized(output_title(view, output))}: {chart.title}"
    return replace(chart, title=title)


def _driver_text(view: ArchiveView) -> str:
    found = (driver_sentences(view, output) for output in main_outputs(view))
    return " ".join(text for sentences in found for text in sentences)
