"""Failed runs: their number, their reasons, and their inputs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from uqpen.archive.read import read_group
from uqpen.charts.chart import Block
from uqpen.core.labels import INTERVAL_LEVEL, RUNS
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.execution import run_count
from uqpen.figures.failure_panels import failed_run_counts
from uqpen.report.blocks import Fold, Table, Text
from uqpen.report.counting import count_text
from uqpen.report.sections.failure_charts import (
    failure_association_chart,
    failure_probability_chart,
)
from uqpen.report.sections.leading_design import leading_design
from uqpen.report.sections.view_statistics import status_probability
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number, percent_text, percent_texts
from uqpen.results.failed_runs import failed_runs as losses_of
from uqpen.results.failed_runs import failure_tables
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import plain_text

__all__ = ["failures"]

# Reasons in the table, and charts of inputs.
_MOST_REASONS = 20
_MOST_CHARTS = 6


def failures(view: ArchiveView) -> Iterator[Block]:
    """Yield the failed runs, their reasons, and their inputs."""
    failed = [design for design in view.designs if failed_run_counts(view, design)]
    if not failed:
        yield Text(_no_failure_text(view))
        return
    yield Table(_reason_table(view, failed))
    associations = list(_association_blocks(view))
    yield from associations[:1]
    yield Fold("By design", (failure_probability_chart(view, failed), *associations[1:]))


def _no_failure_text(view: ArchiveView) -> str:
    runs = sum(run_count(read_group(view.tree, RUNS, design)) for design in view.designs)
    text = f"All {grouped_number(runs)} runs completed."
    if runs == 1:
        text = "The only run completed."
    for design in view.sample_designs:
        chance = status_probability(view, design, Status.FAILED)
        if chance is not None and np.isfinite(chance.values[2]):
            upper = percent_texts(*chance.values)[2]
            level = percent_text(float(chance.attrs[INTERVAL_LEVEL]))
            return (
                f"{text} By {design}, the model fails at a random point with a probability of at "
                f"most {upper}, the upper end of its {level} interval."
            )
    return text


def _reason_table(view: ArchiveView, designs: Sequence[str]) -> OutputTable:
    counts: dict[tuple[Status, str], Counter[str]] = {}
    examples: dict[tuple[Status, str], str] = {}
    for design in designs:
        for each in losses_of(view.tree, design):
            counts.setdefault((each.status, each.reason), Counter())[design] += each.runs
            examples.setdefault((each.status, each.reason), each.example)
    ordered = sorted(counts.items(), key=lambda entry: -entry[1].total())
    columns = [
        f"{name}\nof {count_text(run_count(read_group(view.tree, RUNS, name)), 'run')}"
        for name in designs
    ]
    table = OutputTable("Failed runs, by status and reason", columns)
    for (status, reason), found in ordered[:_MOST_REASONS]:
        example = plain_text(examples[status, reason], 200)
        mark = table.note_mark(f"such as: {example}" if example else "")
        label = f"{STATUS_TEXT[status]}: {plain_text(reason, 200)}{mark}"
        _add(table, label, [found[each] for each in designs])
    if rest := ordered[_MOST_REASONS:]:
        left = [sum(found[design] for _, found in rest) for design in designs]
        _add(table, f"{grouped_number(len(rest))} less frequent reasons", left)
    if len(ordered) > 1:
        _add(table, "all", [sum(failed_run_counts(view, design).values()) for design in designs])
    return table


def _add(table: OutputTable, label: str, counts: Sequence[int]) -> None:
    table.rows.append((label, [grouped_number(count) if count else NOTHING for count in counts]))


def _association_blocks(view: ArchiveView) -> Iterator[Block]:
    """Yield the inputs of failed runs: by the design of the main results, then by the others."""
    statistics = view.statistics
    designs = [each for each in view.designs if "larger" in statistics.failures(each)]
    pairs = dict(zip(designs, failure_tables(view.tree), strict=True))
    first = leading_design(view)
    ordered = sorted(pairs, key=lambda name: name != first)
    for design in ordered[:_MOST_CHARTS]:
        table = pairs[design]
        yield failure_association_chart(view, design, table) or Table(table)
    if more := ordered[_MOST_CHARTS:]:
        yield Text(f"The other {len(more)} designs have tables only.")
        yield from (Table(pairs[design], is_folded=True) for design in more)
