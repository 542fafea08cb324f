"""Failed runs of an archive: how many failed, why, and at which inputs."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.blocks import block_ranges
from uqpen.core.labels import (
    CAUSE,
    CAUSE_EXAMPLE,
    CAUSE_RUNS,
    CAUSE_STATUS,
    CAUSE_TEXT,
    FAILED_RUN,
    FAILURE_REASON,
    INPUT,
    RUN,
    RUNS,
    STATUS,
)
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.status import Status, divide_place, mask_numbers
from uqpen.core.units import scale
from uqpen.execution import status_counts
from uqpen.results.digits import number_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import OutputTable, estimate_json, json_value, label_with_unit, shown_unit

# Reasons that differ in their numbers alone and stay apart, at the most: there are few exit codes.
_MOST_APART = 3

# What an archive without runs has of its causes: variables, their types and their titles.
_RECORDED: dict[str, tuple[Any, str]] = {
    CAUSE_STATUS: (np.int8, "what became of the runs that failed for one cause"),
    CAUSE_TEXT: (object, "why they failed"),
    CAUSE_EXAMPLE: (object, "reason of the first of them"),
    CAUSE_RUNS: (np.int64, "number of them"),
}

# Statistics of the inputs of failed runs: estimates, and the range of their values.
_ASSOCIATIONS, _ENDS = ("larger", "further_out"), ("lowest", "highest")
# The names of the estimates, and notes that say what they are.
_PROBABILITIES = {
    "P(larger)": "probability of superiority: the input is larger in a failed run than in a "
    "completed one; 0.5 without an association",
    "P(further out)": "the input is further from its median in a failed run than in a completed "
    "one; 0.5 without an association",
}


class FailedRuns(NamedTuple):
    """Runs that failed for one reason, or for many that differ in their numbers alone."""

    status: Status  # what became of the runs
    reason: str  # with ``#`` for each number, where many reasons differ in their numbers alone
    runs: int  # how many they are
    example: str = ""  # the reason of the first of them; empty where that is `reason`
    design: str = ""  # the only design that they are of; empty for several

    @property
    def text(self) -> str:
        """The reason, with its example if it has one; both name the same line of code."""
        example, place = divide_place(self.example)
        text = self.reason.removesuffix(place)
        return f"{text}, such as: {example}{place}" if example else self.reason


def failed_runs(tree: xr.DataTree, design: str) -> Iterator[FailedRuns]:
    """Yield the failed runs of a design by reason, the most frequent first."""
    every = [read_group(tree, RUNS, name) for name in group_names(tree, RUNS)]
    # The text of a reason is the same for all designs of a model.
    for each in failure_causes([read_group(tree, RUNS, design)], among=every):
        yield each._replace(design=design)


def has_failed_design(tree: xr.DataTree) -> bool:
    """Return whether some design has no completed run."""
    designs = (
        read_group(model, RUNS, design)
        for model in model_trees(tree).values()
        for design in group_names(model, RUNS)
    )
    return any(not status_counts(runs)[Status.OK] for runs in designs)


def failure_causes(
    designs: Sequence[xr.Dataset], among: Sequence[xr.Dataset] | None = None
) -> list[FailedRuns]:
    """Return the failed runs of some designs by reason, the most frequent first.

    Reasons are grouped together among the designs counted, or those of `among`.
    """
    texts = common_reasons(
        reason
        for runs in (designs if among is None else among)
        for _, reasons in _failed_parts(runs)
        for reason in reasons
    )
    counts: Counter[tuple[Status, str]] = Counter()
    examples: dict[tuple[Status, str], str] = {}
    for runs in designs:
        # An archive without runs has recorded their causes.
        recorded = [runs[name].values.tolist() for name in _RECORDED if CAUSE_RUNS in runs]
        for status, text, example, count in zip(*recorded, strict=True):
            key = Status(status), str(text)
            counts[key] += count
            examples.setdefault(key, str(example))
        for statuses, reasons in _failed_parts(runs):
            for each, reason in zip(statuses, reasons, strict=True):
                key = Status(each), texts[reason]
                counts[key] += 1
                examples.setdefault(key, reason)
    return [
        FailedRuns(status, reason, count, example * (example != reason))
        for (status, reason), count in counts.most_common()
        for example in (examples[status, reason],)
    ]


def common_reasons(reasons: Iterable[str]) -> dict[str, str]:
    """Return for each reason the text that it is counted under.

    Where many reasons differ in their numbers alone, these are masked. All others stay as they are.

    >>> common_reasons(["no root", *(f"residual {n}e-3 after {n} steps" for n in range(4))])[
    ...     "residual 2e-3 after 2 steps"
    ... ]
    'residual # after # steps'
    """
    alike: dict[str, list[str]] = defaultdict(list)
    for reason in dict.fromkeys(reasons):
        alike[mask_numbers(reason)].append(reason)
    return {
        reason: masked if len(found) > _MOST_APART else reason
        for masked, found in alike.items()
        for reason in found
    }


def record_causes(described: xr.Dataset, runs: xr.Dataset) -> xr.Dataset:
    """Return what an archive has of a design without its runs, with the causes of failed ones.

    `described` is the result of `omit_runs`.
    """
    causes = failure_causes([runs])
    if not causes:
        return described
    rows = [(each.status, each.reason, each.example or each.reason, each.runs) for each in causes]
    columns = zip(_RECORDED.items(), zip(*rows, strict=True), strict=True)
    return described.assign(
        {
            name: (CAUSE, np.array(column, dtype=kind), {"long_name": title})
            for (name, (kind, title)), column in columns
        }
    )


def _failed_parts(runs: xr.Dataset) -> Iterator[tuple[list[int], list[str]]]:
    """Yield the statuses and the reasons of failed runs, part by part, as they may be in a file."""
    if FAILURE_REASON not in runs:
        return
    at = runs[FAILED_RUN].values
    if runs.sizes[RUN] <= RUNS_IN_MEMORY:  # else they are all runs, numbered from 0
        at = np.searchsorted(runs[RUN].values, at)
    for start, stop in block_ranges(at.size):
        reasons = runs.variables[FAILURE_REASON][start:stop].values
        statuses = runs.variables[STATUS][at[start:stop]].values
        yield statuses.tolist(), [*map(str, reasons)]


def failure_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield a table for each design of a model with failed runs.

    The inputs that are associated most with the failures come first.
    """
    statistics = SourceStatistics(tree)
    for design in group_names(tree, RUNS):
        failures, runs = statistics.failures(design), read_group(tree, RUNS, design)
        if not all(name in failures for name in (*_ASSOCIATIONS, *_ENDS)):
            continue
        table = OutputTable(f"{design}: inputs of failed runs", ["failed from", "to"])
        table.columns += [name + table.note_mark(note) for name, note in _PROBABILITIES.items()]
        measures = np.stack([failures[name].values[:, 0] for name in _ASSOCIATIONS])
        strength = np.nan_to_num(np.abs(measures - 0.5)).max(axis=0)
        names = list(map(str, failures[_ASSOCIATIONS[0]][INPUT].values))
        for position in np.argsort(-strength, kind="stable").tolist():
            unit = shown_unit(runs[names[position]].attrs)
            ends = scale(unit).from_si(np.array([failures[end][position] for end in _ENDS]))
            chances = [table.cell(failures[each][position]) for each in _ASSOCIATIONS]
            cells = [*(number_text(end) for end in ends), *chances]
            table.rows.append((label_with_unit(names[position], unit), cells))
        yield table


def failure_json(statistics: SourceStatistics, design: str) -> dict[str, Any]:
    """Return the shares of failed runs, and how they lie relative to the others by input."""
    failures, inputs = statistics.failures(design), dict[str, Any]()
    for key in (*_ASSOCIATIONS, *_ENDS):
        for entry in failures.get(key, ()):
            value = json_value(entry.values) if key in _ENDS else estimate_json(entry)
            inputs.setdefault(str(entry[INPUT].item()), {})[key] = value
    chances = statistics.status_probabilities(design)
    lost = {status: estimate_json(chance) for status, chance in chances.items()}
    return {"lost": lost, "where_lost": inputs}
