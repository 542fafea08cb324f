"""The main results of an archive without a sample of completed runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from uqpen.archive.read import read_group
from uqpen.charts.chart import Block
from uqpen.core.labels import RUNS, SURROGATES
from uqpen.core.sampling import Sampling
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.execution import run_count, status_counts
from uqpen.report.blocks import Findings, Quote, Text
from uqpen.report.counting import count_text
from uqpen.report.sections.joint_findings import rare_event_findings
from uqpen.report.sections.quoted_statistics import QuotedStatistic, output_name
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number
from uqpen.results.failed_runs import FailedRuns, failed_runs
from uqpen.results.texts import plain_text

__all__ = ["answer_without_sample"]

# Outputs with a sentence, and reasons shown.
_MOST_OUTPUTS = 6
_MOST_REASONS = 3


def answer_without_sample(view: ArchiveView) -> Iterator[Block]:
    """Yield what an archive says whose designs give no distribution, and the reason."""
    if of_events := tuple(rare_event_findings(view)):
        yield Findings(of_events, is_verdict=True)
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
            f"outputs and all {'other ' * bool(of_events)}probabilities are unknown. The results "
            "of its designs are further down."
        )
    if means:
        yield Quote(tuple(means))
    if SURROGATES in view.tree.children:
        yield Text(
            "Estimates by surrogates have no interval of their own, so they are not quoted here."
        )


def _quadrature_means(view: ArchiveView) -> Iterator[str]:
    rules = [each for each in view.designs if view.design(each).sampling is Sampling.QUADRATURE]
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
    runs = sum(run_count(read_group(view.tree, RUNS, design)) for design in view.designs)
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
