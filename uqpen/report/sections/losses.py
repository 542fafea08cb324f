"""How many runs were lost, to what, and where among the inputs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from uqpen.analyses.where_lost import LOSSES
from uqpen.archive.read import group, names_in
from uqpen.figures.losses import lost_of
from uqpen.figures.part import Part
from uqpen.figures.texts import plain
from uqpen.labels import INTERVAL_LEVEL, RUN, RUNS, STATUS_TEXT, STATUSES, Status
from uqpen.report.blocks import Block, Table, Text
from uqpen.report.counting import counted, in_percent
from uqpen.report.sections.loss_charts import chances, places
from uqpen.summary.digits import grouped, percent
from uqpen.summary.loss_tables import loss_tables
from uqpen.summary.losses import losses as losses_of
from uqpen.summary.table import NOTHING, OutputTable

__all__ = ["losses"]

# Reasons in the table, and charts of inputs.
_MOST_REASONS = 20
_MOST_CHARTS = 6


def losses(part: Part) -> Iterator[Block]:
    """Which runs were lost, to what, and where among the inputs."""
    lost = [design for design in part.designs if lost_of(part, design)]
    if not lost:
        yield Text(_none_lost(part))
        return
    yield Table(_reasons(part, lost))
    yield chances(part, lost)
    yield from _places(part)


def _none_lost(part: Part) -> str:
    """That nothing was lost, and how likely it is at most."""
    runs = sum(group(part.tree, RUNS, design).sizes[RUN] for design in part.designs)
    told = f"None of the {grouped(runs)} runs was lost."
    if runs == 1:
        told = "The only run came back."
    for design in part.samples:
        chance = group(part.tree, STATUSES, design).get(Status.FAILED.meaning)
        if chance is not None and np.isfinite(chance.values[2]):
            upper = in_percent(*chance.values)[2]
            level = percent(float(chance.attrs[INTERVAL_LEVEL]))
            return (
                f"{told} By {design}, the probability that the model fails at a random point is at "
                f"most {upper}, the upper end of its {level} interval."
            )
    return told


def _reasons(part: Part, designs: Sequence[str]) -> OutputTable:
    """How many runs of each design were lost to each reason, the most frequent first."""
    counts: dict[tuple[Status, str], Counter[str]] = {}
    for design in designs:
        for each in losses_of(part.tree, design):
            counts.setdefault((each.status, each.reason), Counter())[design] += each.runs
    ordered = sorted(counts.items(), key=lambda entry: -entry[1].total())
    table = OutputTable("Runs lost, by status and reason", [_of(part, name) for name in designs])
    for (status, reason), found in ordered[:_MOST_REASONS]:
        _add(
            table, f"{STATUS_TEXT[status]}: {plain(reason, 200)}", [found[each] for each in designs]
        )
    if rest := ordered[_MOST_REASONS:]:
        left = [sum(found[design] for _, found in rest) for design in designs]
        _add(table, f"{grouped(len(rest))} less frequent reasons", left)
    if len(ordered) > 1:
        _add(table, "all", [sum(lost_of(part, design).values()) for design in designs])
    return table


def _of(part: Part, design: str) -> str:
    return f"{design}\nof {counted(group(part.tree, RUNS, design).sizes[RUN], 'run')}"


def _add(table: OutputTable, label: str, counts: Sequence[int]) -> None:
    table.rows.append((label, [grouped(count) if count else NOTHING for count in counts]))


def _places(part: Part) -> Iterator[Block]:
    """Where among the inputs the lost runs lie, of each design that lost some."""
    told = list(zip(names_in(part.tree, LOSSES), loss_tables(part.tree), strict=True))
    for design, table in told[:_MOST_CHARTS]:
        yield places(part, design, table) or Table(table)
    if more := told[_MOST_CHARTS:]:
        yield Text(f"Of {len(more)} more designs there are tables alone.")
        yield from (Table(table, is_folded=True) for _, table in more)
