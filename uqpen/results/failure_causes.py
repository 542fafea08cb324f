"""Reasons of failed runs, grouped by what they have in common."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, RUN, STATUS
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.status import Status
from uqpen.results.failure_reasons import common_reasons

__all__ = ["FailureCause", "common_texts", "failure_causes"]


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
        str(reason)
        for runs in designs
        if FAILURE_REASON in runs
        for reason in runs[FAILURE_REASON].values.tolist()
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
        if FAILURE_REASON not in runs:
            continue
        at = runs[FAILED_RUN].values
        if runs.sizes[RUN] <= RUNS_IN_MEMORY:  # else they are all runs, numbered from 0
            at = np.searchsorted(runs[RUN].values, at)
        statuses = runs[STATUS].values[at].tolist()
        for status, reason in zip(statuses, runs[FAILURE_REASON].values.tolist(), strict=True):
            key = Status(status), texts[str(reason)]
            counts[key] += 1
            examples.setdefault(key, str(reason))
    return [FailureCause(*key, examples[key], count) for key, count in counts.most_common()]
