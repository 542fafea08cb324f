"""How many runs were lost, to what, and where among the inputs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from uqpen.archive.read import group_names, read_group
from uqpen.core.labels import INTERVAL_LEVEL, RUN, RUNS, STATUS_TEXT, STATUSES, Status
from uqpen.figures.archive_view import ArchiveView
from uqpen.figures.failure_panels import failed_run_counts
from uqpen.figures.texts import plain_text
from uqpen.report.blocks import Block, Table, Text
from uqpen.report.counting import count_text, percent_texts
from uqpen.report.sections.failure_charts import (
    failure_association_chart,
    failure_probability_chart,
)
from uqpen.results.digits import grouped_number, percent_text
from uqpen.results.failed_runs import failed_runs as losses_of
from uqpen.results.failure_tables import failure_tables
from uqpen.results.table import NOTHING, OutputTable
from uqpen.statistics.failure_analysis import FAILURES

__all__ = ["failures"]

# Reasons in the table, and charts of inputs.
_MOST_REASONS = 20
_MOST_CHARTS = 6


def failures(view: ArchiveView) -> Iterator[Block]:
    """Which runs were lost, to what, and where among the inputs."""
    failed = [design for design in view.designs if failed_run_counts(view, design)]
    if not failed:
        yield Text(_no_failure_text(view))
        return
    yield Table(_reason_table(view, failed))
    yield failure_probability_chart(view, failed)
    yield from _association_blocks(view)


def _no_failure_text(view: ArchiveView) -> str:
    """That nothing was lost, and how likely it is at most."""
    runs = sum(read_group(view.tree, RUNS, design).sizes[RUN] for design in view.designs)
    text = f"None of the {grouped_number(runs)} runs was lost."
    if runs == 1:
        text = "The only run came back."
    for design in view.sample_designs:
        chance = read_group(view.tree, STATUSES, design).get(Status.FAILED.meaning)
        if chance is not None and np.isfinite(chance.values[2]):
            upper = percent_texts(*chance.values)[2]
            level = percent_text(float(chance.attrs[INTERVAL_LEVEL]))
            return (
                f"{text} By {design}, the probability that the model fails at a random point is at "
                f"most {upper}, the upper end of its {level} interval."
            )
    return text


def _reason_table(view: ArchiveView, designs: Sequence[str]) -> OutputTable:
    """How many runs of each design were lost to each reason, the most frequent first."""
    counts: dict[tuple[Status, str], Counter[str]] = {}
    for design in designs:
        for each in losses_of(view.tree, design):
            counts.setdefault((each.status, each.reason), Counter())[design] += each.runs
    ordered = sorted(counts.items(), key=lambda entry: -entry[1].total())
    table = OutputTable(
        "Runs lost, by status and reason", [_design_text(view, name) for name in designs]
    )
    for (status, reason), found in ordered[:_MOST_REASONS]:
        _add(
            table,
            f"{STATUS_TEXT[status]}: {plain_text(reason, 200)}",
            [found[each] for each in designs],
        )
    if rest := ordered[_MOST_REASONS:]:
        left = [sum(found[design] for _, found in rest) for design in designs]
        _add(table, f"{grouped_number(len(rest))} less frequent reasons", left)
    if len(ordered) > 1:
        _add(table, "all", [sum(failed_run_counts(view, design).values()) for design in designs])
    return table


def _design_text(view: ArchiveView, design: str) -> str:
    return f"{design}\nof {count_text(read_group(view.tree, RUNS, design).sizes[RUN], 'run')}"


def _add(table: OutputTable, label: str, counts: Sequence[int]) -> None:
    table.rows.append((label, [grouped_number(count) if count else NOTHING for count in counts]))


def _association_blocks(view: ArchiveView) -> Iterator[Block]:
    """Where among the inputs the lost runs lie, of each design that lost some."""
    pairs = list(zip(group_names(view.tree, FAILURES), failure_tables(view.tree), strict=True))
    for design, table in pairs[:_MOST_CHARTS]:
        yield failure_association_chart(view, design, table) or Table(table)
    if more := pairs[_MOST_CHARTS:]:
        yield Text(f"Of {len(more)} more designs there are tables alone.")
        yield from (Table(table, is_folded=True) for _, table in more)
