"""Failed runs: their number, their reasons, and their inputs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.charts.chart import Block
from uqpen.charts.failed_runs import (
    failed_designs,
    failed_run_counts,
    failure_association_chart,
    failure_probability_chart,
)
from uqpen.charts.marks import has_interval
from uqpen.core.labels import INPUT, INTERVAL_LEVEL, RUNS
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.execution import run_count, status_counts
from uqpen.report.blocks import Fold, Table, Text
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import count_text, grouped_number, percent_text, percent_texts
from uqpen.results.failed_runs import failed_runs as losses_of
from uqpen.results.failed_runs import failure_tables
from uqpen.results.input_measures import input_label
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import plain_text

# Reasons in the table, and charts of inputs.
_MOST_REASONS = 20
_MOST_CHARTS = 6
# An input is named if it is so in a failed run with this probability more than one half.
_CLEAR = 0.25
# Inputs that are named, at the most.
_MOST_NAMED = 2


def failures(view: ArchiveView) -> Iterator[Block]:
    """Yield the failed runs, their reasons, and their inputs."""
    failed = failed_designs(view)
    if not failed:
        yield Text(_no_failure_text(view))
        return
    counts: dict[tuple[Status, str], Counter[str]] = {}
    examples: dict[tuple[Status, str], str] = {}
    for design in failed:
        for each in losses_of(view.tree, design):
            counts.setdefault((each.status, each.reason), Counter())[design] += each.runs
            examples.setdefault((each.status, each.reason), each.example)
    ordered = sorted(counts.items(), key=lambda entry: -entry[1].total())
    columns = [
        f"{name}\nof {count_text(run_count(read_group(view.tree, RUNS, name)), 'run')}"
        for name in failed
    ]
    table = OutputTable("Failed runs, by status and reason", columns)
    for (status, reason), found in ordered[:_MOST_REASONS]:
        example = plain_text(examples[status, reason], 200)
        mark = table.note_mark(f"such as: {example}" if example else "")
        label = f"{STATUS_TEXT[status]}: {plain_text(reason, 200)}{mark}"
        _add(table, label, [found[each] for each in failed])
    if rest := ordered[_MOST_REASONS:]:
        left = [sum(found[design] for _, found in rest) for design in failed]
        _add(table, f"{grouped_number(len(rest))} less frequent reasons", left)
    if len(ordered) > 1:
        _add(table, "all", [sum(failed_run_counts(view, design).values()) for design in failed])
    yield Table(table)
    associations = list(_association_blocks(view))
    yield from associations[:1]
    yield Fold("By design", (failure_probability_chart(view, failed), *associations[1:]))


def _no_failure_text(view: ArchiveView) -> str:
    runs = sum(run_count(read_group(view.tree, RUNS, design)) for design in view.designs)
    text = f"All {grouped_number(runs)} runs completed."
    if runs == 1:
        text = "The only run completed."
    for design in view.sample_designs:
        chance = view.statistics.status_probabilities(design).get(Status.FAILED.meaning)
        if chance is not None and np.isfinite(chance.values[2]):
            upper = percent_texts(*chance.values)[2]
            level = percent_text(float(chance.attrs[INTERVAL_LEVEL]))
            return (
                f"{text} By {design}, the model fails at a random point with a probability of at "
                f"most {upper}, the upper end of its {level} interval."
            )
    return text


def _add(table: OutputTable, label: str, counts: Sequence[int]) -> None:
    table.rows.append((label, [grouped_number(count) if count else NOTHING for count in counts]))


def _association_blocks(view: ArchiveView) -> Iterator[Block]:
    """Yield the inputs of failed runs: by the design of the main results, then by the others."""
    statistics = view.statistics
    designs = [each for each in view.designs if "larger" in statistics.failures(each)]
    pairs = dict(zip(designs, failure_tables(view.tree), strict=True))
    first = view.leading_design
    ordered = sorted(pairs, key=lambda name: name != first)
    for design in ordered[:_MOST_CHARTS]:
        table = pairs[design]
        chart = failure_association_chart(view, design)
        yield Table(table) if chart is None else replace(chart, tables=(table,))
    if more := ordered[_MOST_CHARTS:]:
        yield Text(f"The other {len(more)} designs have tables only.")
        yield from (Table(pairs[design], is_folded=True) for design in more)


def missing_count(view: ArchiveView, design: str) -> int:
    """Return the number of runs without a result at an admissible point."""
    counts = status_counts(view.design(design).runs)
    done = counts[Status.OK] + counts[Status.INADMISSIBLE]
    return int(run_count(view.design(design).runs) - done)


def missing_run_sentences(view: ArchiveView, design: str) -> Iterator[str]:
    """Yield the number of failed and of inadmissible runs, and the inputs of the failed."""
    runs = run_count(view.design(design).runs)
    counts = status_counts(view.design(design).runs)
    missing, excluded = missing_count(view, design), counts[Status.INADMISSIBLE]
    if not missing:
        every = "The only run" if runs == 1 else f"All {grouped_number(runs - excluded)} runs"
        admissible = " at admissible points" * bool(excluded)
        yield f"{every}{admissible} completed."
    else:
        found = view.statistics.failures(design)
        clear = {
            **_associations(found.get("further_out"), "far from its median", ""),
            **_associations(found.get("larger"), "high", "low"),
        }
        strongest = sorted(clear, key=lambda name: -clear[name][0])[:_MOST_NAMED]
        inputs = " and ".join(
            f"{input_label(view, name)} is {clear[name][1]}" for name in strongest
        )
        share = f"{grouped_number(missing)} of {grouped_number(runs)}"
        yield f"{share} runs failed{', mainly where ' * bool(inputs)}{inputs}."
        yield (
            "Intervals of probabilities hold even if all of these were beyond a limit, or none; "
            f"all other numbers describe the {count_text(counts[Status.OK], 'completed run')}."
        )
    if excluded:
        were = "was" if excluded == 1 else "were"
        yield f"{count_text(excluded, 'point')} of {grouped_number(runs)} {were} inadmissible."


def _associations(
    array: xr.DataArray | None, above: str, below: str
) -> dict[str, tuple[float, str]]:
    """Return the strength and the word of each clear association, by input."""
    found = {}
    for chance in () if array is None else array:
        strength = float(chance.values[0]) - 0.5
        word = above if strength > 0 else below
        if word and abs(strength) >= _CLEAR and _is_known(chance):
            found[str(chance[INPUT].item())] = abs(strength), word
    return found


def _is_known(chance: xr.DataArray) -> bool:
    """Return whether the interval excludes one half; without one, all failed runs lie apart."""
    if not has_interval(chance.values):
        return bool(np.isclose(abs(chance.values[0] - 0.5), 0.5))
    return not chance.values[1] <= 0.5 <= chance.values[2]
