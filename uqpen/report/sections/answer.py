"""The main results: sentences to quote for a decision, and their caveats."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from uqpen.archive.read import read_group
from uqpen.core.labels import RUN, RUNS, SURROGATES
from uqpen.core.sampling import Sampling
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.execution import status_counts
from uqpen.report.blocks import Block, Quote, Remarks, Text
from uqpen.report.counting import count_text
from uqpen.report.sections.caveats import caveats
from uqpen.report.sections.joint_sentences import joint_sentences
from uqpen.report.sections.leading_design import leading_design
from uqpen.report.sections.quoted_statistics import (
    QuotedStatistic,
    other_design_estimates,
    output_name,
    requested_statistics,
)
from uqpen.report.sections.sentences import OutputSentences, output_sentences
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number
from uqpen.results.failed_runs import FailedRuns, failed_runs
from uqpen.results.texts import plain_text

__all__ = ["answer"]

# Outputs with sentences, quantities with a comparison of designs, and reasons shown.
_MOST_OUTPUTS = 6
_MOST_COMPARED = 3
_MOST_REASONS = 3

_OTHERS = "Estimates by other designs, from runs of their own (intervals are further down)"


def answer(view: ArchiveView) -> Iterator[Block]:
    """Sentences on each output, the design behind them, and their caveats."""
    design = leading_design(view)
    if design is None:
        yield from _blocks_without_sample(view)
        return
    outputs = _ordered_outputs(view, design)
    shown = [
        entry
        for output in outputs[:_MOST_OUTPUTS]
        if (entry := output_sentences(view, output, design)) is not None
    ]
    for entry in shown:
        yield Quote(entry.sentences)
    if joint := tuple(joint_sentences(view, design)):
        yield Quote(joint)
    if left_out := _omissions_note(shown, len(outputs) - _MOST_OUTPUTS):
        yield Text(left_out)
    yield Text(_origin_sentence(view, design))
    if agreement := tuple(_agreement_remarks(shown, design)):
        yield Remarks(_OTHERS, agreement)
    notes = dict.fromkeys(note for entry in shown for note in entry.remarks)
    if lines := (*notes, *caveats(view, design)):
        yield Remarks("What to keep in mind", lines)


def _ordered_outputs(view: ArchiveView, design: str) -> list[str]:
    """All outputs, those with requested statistics first."""
    numbers = sorted(
        view.numeric_outputs, key=lambda output: not requested_statistics(view, output, design)
    )
    return [*numbers, *view.categorical_outputs]


def _omissions_note(shown: Sequence[OutputSentences], outputs: int) -> str:
    omitted = sum(entry.omitted for entry in shown)
    parts = []
    if omitted:
        parts.append(f"{count_text(omitted, 'more estimate')} of these outputs")
    if outputs > 0:
        parts.append(count_text(outputs, "more output"))
    return f"Further down: {' and '.join(parts)}." if parts else ""


def _origin_sentence(view: ArchiveView, design: str) -> str:
    runs = view.runs(design)
    completed, every = status_counts(runs)[Status.OK], runs.sizes[RUN]
    known = [str(view.tree.attrs.get(name, "")) for name in ("model_name", "model_version")]
    model = plain_text(" ".join(filter(None, known)))
    some = "all" if completed == every else grouped_number(completed)
    returned = f"Of its {grouped_number(every)} runs of the model {model}, {some} completed."
    if every == 1:
        returned = f"It is a single run of the model {model}."
    return (
        f"These estimates are by {design}, {_leading_reason(view, design)}. Its place in the study "
        f"decides, not its results. {returned}"
    )


def _leading_reason(view: ArchiveView, design: str) -> str:
    if not view.is_sample_design(design):
        return (
            "a design for sensitivity indices; two of its matrices are a sample of the inputs, and "
            "no other sample of the study has a completed run"
        )
    earlier = [each for each in view.sample_designs if view.is_sample_design(each)]
    text = "" if earlier[0] == design else " with completed runs"
    taken = "presumed " if view.sampling(design) is Sampling.USER_SUPPLIED else ""
    return f"the first design of the study that is a {taken}sample of the inputs{text}"


def _agreement_remarks(shown: Sequence[OutputSentences], design: str) -> Iterator[str]:
    """Yield the agreement of other designs, for the first quantities of the main results."""
    for quantity in [each for entry in shown for each in entry.quantities][:_MOST_COMPARED]:
        others = other_design_estimates(quantity, design)
        own = quantity.estimate(design)
        if others and own is not None:
            values = [float(quantity.bounds(array)[0]) for array in others.values()]
            here, _, _, lowest, highest = quantity.texts(own, min(values), max(values))
            span = lowest if lowest == highest else f"{lowest} to {highest}"
            by = count_text(len(others), "other design")
            yield f"{quantity.heading}: {span} by {by}, {here} by {design}."


def _blocks_without_sample(view: ArchiveView) -> Iterator[Block]:
    means = list(_quadrature_means(view))
    failed = [each for design in view.designs for each in failed_runs(view.tree, design)]
    every = [read_group(view.tree, RUNS, design) for design in view.designs]
    if not any(status_counts(runs)[Status.OK] for runs in every):
        yield Text(_no_completed_runs_text(view, failed))
        return
    if view.sample_designs:
        yield Text(
            f"No run of {', '.join(view.sample_designs)} completed, so the distributions of the "
            f"outputs are unknown. {_failure_reasons(failed)}"
        )
    else:
        yield Text(
            "No design of this study is a sample of its inputs, so the distributions of the "
            "outputs and all probabilities are unknown. The results of its designs are further "
            "down."
        )
    if means:
        yield Quote(tuple(means))
    if SURROGATES in view.tree.children:
        yield Text(
            "Estimates by surrogates have no interval of their own, so they are not quoted here."
        )


def _quadrature_means(view: ArchiveView) -> Iterator[str]:
    rules = [each for each in view.designs if view.sampling(each) is Sampling.QUADRATURE]
    for output in view.numeric_outputs[:_MOST_OUTPUTS]:
        quantity = QuotedStatistic(view, output, "mean")
        for design in rules:
            array = quantity.estimate(design)
            if array is not None:
                name = output_name(view, output)
                stated = f"{quantity.texts(array)[0]} {quantity.interval(array)}"
                yield f"By the integration rule {design}, the mean of {name} is {stated}."
                break


def _no_completed_runs_text(view: ArchiveView, failed: Sequence[FailedRuns]) -> str:
    runs = sum(read_group(view.tree, RUNS, design).sizes[RUN] for design in view.designs)
    count = "The only run failed." if runs == 1 else f"All {grouped_number(runs)} runs failed."
    return (
        f"No run completed, so there are no estimates. {count} {_failure_reasons(failed)} "
        "Mend the model, raise its time limit, or change the inputs to values that it allows; then "
        "run the study again. The archive has the inputs of every failed run, so you can try a "
        "single one."
    )


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
