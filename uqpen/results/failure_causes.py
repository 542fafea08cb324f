"""Reasons of failed runs, grouped by what they have in common."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, RUN, STATUS
from uqpen.core.status import Status

__all__ = ["FailureCause", "failure_causes", "without_numbers"]

# A number that stands by itself: not the 2 of "x2".
_NUMBER = re.compile(r"(?<![\w.])[-+−]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?!\w)|\b(?:nan|inf)\b")


class FailureCause(NamedTuple):
    """Runs that failed for reasons that differ in their numbers alone.

    Attributes
    ----------
    status : Status
        What became of the runs.
    text : str
        The reason, with … in place of its numbers.
    example : str
        The reason of the first of them.
    runs : int
        How many they are.
    """

    status: Status
    text: str
    example: str
    runs: int


def failure_causes(designs: Iterable[xr.Dataset]) -> list[FailureCause]:
    """Return the causes of the failed runs of some designs, the most frequent first."""
    counts: Counter[tuple[Status, str]] = Counter()
    examples: dict[tuple[Status, str], str] = {}
    for runs in designs:
        if FAILURE_REASON not in runs:
            continue
        at = np.searchsorted(runs[RUN].values, runs[FAILED_RUN].values)
        statuses = runs[STATUS].values[at].tolist()
        for status, reason in zip(statuses, runs[FAILURE_REASON].values.tolist(), strict=True):
            key = Status(status), without_numbers(str(reason))
            counts[key] += 1
            examples.setdefault(key, str(reason))
    return [FailureCause(*key, examples[key], count) for key, count in counts.most_common()]


def without_numbers(reason: str) -> str:
    """Return a reason with … in place of its numbers.

    >>> without_numbers("Newton did not converge after 50 iterations (residual 5.3e-4)")
    'Newton did not converge after … iterations (residual …)'
    """
    return _NUMBER.sub("…", reason)
