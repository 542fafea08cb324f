"""Reasons of failed runs, grouped by what they have in common."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.blocks import block_ranges
from uqpen.core.labels import (
    CAUSE,
    CAUSE_EXAMPLE,
    CAUSE_RUNS,
    CAUSE_STATUS,
    CAUSE_TEXT,
    FAILED_RUN,
    FAILURE_REASON,
    RUN,
    STATUS,
)
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.status import Status
from uqpen.results.failure_reasons import common_reasons

__all__ = ["FailureCause", "common_texts", "failure_causes", "record_causes"]

_TITLES = {
    CAUSE_STATUS: "what became of the runs that failed for one cause",
    CAUSE_TEXT: "why they failed",
    CAUSE_EXAMPLE: "reason of the first of them",
    CAUSE_RUNS: "number of them",
}


class FailureCause(NamedTuple):
    """Runs that failed for one reason, or for many that differ in their numbers alone.

    Attributes
    ----------
    status : Status
        What became of the runs.
    text : str
        The reason, with ``#`` in place of its numbers where many differ in them.
    example : str
        The reason of the first of the runs.
    runs : int
        How many they are.
    """

    status: Status
    text: str
    example: str
    runs: int


def common_texts(designs: Sequence[xr.Dataset]) -> dict[str, str]:
    """Return the text that each reason in some designs is counted under."""
    return common_reasons(
        reason for runs in designs for _, reasons in _failed_parts(runs) for reason in reasons
    )


def failure_causes(
    designs: Sequence[xr.Dataset], texts: Mapping[str, str] | None = None
) -> list[FailureCause]:
    """Return the causes of the failed runs of some designs, the most frequent first.

    Parameters
    ----------
    designs : sequence of Dataset
        Runs with their numbers.
    texts : mapping of str to str, optional
        The text of each reason; by default that of `common_texts`.
    """
    texts = common_texts(designs) if texts is None else texts
    counts: Counter[tuple[Status, str]] = Counter()
    examples: dict[tuple[Status, str], str] = {}
    for runs in designs:
        for cause in _recorded_causes(runs):
            key = cause.status, cause.text
            counts[key] += cause.runs
            examples.setdefault(key, cause.example)
        for statuses, reasons in _failed_parts(runs):
            for status, reason in zip(statuses, reasons, strict=True):
                key = Status(status), texts[reason]
                counts[key] += 1
                examples.setdefault(key, reason)
    return [FailureCause(*key, examples[key], count) for key, count in counts.most_common()]


def record_causes(described: xr.Dataset, runs: xr.Dataset) -> xr.Dataset:
    """Return what an archive has of a design without its runs, with the causes of failed ones.

    Parameters
    ----------
    described : Dataset
        The result of `omit_runs`.
    runs : Dataset
        The runs.
    """
    causes = failure_causes([runs])
    if not causes:
        return described
    statuses, texts, examples, counts = zip(*causes, strict=True)
    found = described.assign(
        {
            CAUSE_STATUS: (CAUSE, np.array(statuses, dtype=np.int8)),
            CAUSE_TEXT: (CAUSE, np.array(texts, dtype=object)),
            CAUSE_EXAMPLE: (CAUSE, np.array(examples, dtype=object)),
            CAUSE_RUNS: (CAUSE, np.array(counts, dtype=np.int64)),
        }
    )
    for name, title in _TITLES.items():
        found[name].attrs = {"long_name": title}
    return found


def _recorded_causes(runs: xr.Dataset) -> Iterator[FailureCause]:
    """Yield the causes that an archive without the runs of a design has."""
    if CAUSE_RUNS in runs:
        names = CAUSE_STATUS, CAUSE_TEXT, CAUSE_EXAMPLE, CAUSE_RUNS
        columns = (runs[name].values.tolist() for name in names)
        for status, text, example, count in zip(*columns, strict=True):
            yield FailureCause(Status(status), str(text), str(example), count)


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
