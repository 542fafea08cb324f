"""The failed runs of an archive, and their reasons."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, RUN, RUNS, STATUS
from uqpen.core.status import Status
from uqpen.execution import status_counts
from uqpen.results.failure_reasons import common_reasons

__all__ = ["FailedRuns", "failed_runs", "has_failed_design"]


class FailedRuns(NamedTuple):
    """Number of runs of one design that failed for one reason.

    Attributes
    ----------
    reason : str
        With ``#`` for each number, where many reasons differ in their numbers alone.
    example : str
        One of these reasons as it stands; empty for a single reason.
    """

    design: str
    status: Status
    reason: str
    runs: int
    example: str = ""

    @property
    def text(self) -> str:
        """The reason, with its example if it has one."""
        return f"{self.reason}, such as: {self.example}" if self.example else self.reason


def failed_runs(tree: xr.DataTree, design: str) -> Iterator[FailedRuns]:
    """Yield the failed runs of a design by reason, the most frequent first."""
    runs = read_group(tree, RUNS, design)
    if FAILURE_REASON not in runs:
        return
    at = np.searchsorted(runs[RUN].values, runs[FAILED_RUN].values)
    reasons = runs[FAILURE_REASON].values.tolist()
    common = _common_reasons(tree)
    keys = [
        (status, common[reason])
        for status, reason in zip(runs[STATUS].values[at].tolist(), reasons, strict=True)
    ]
    examples = dict(zip(reversed(keys), reversed(reasons), strict=True))
    for (status, reason), count in Counter(keys).most_common():
        example = str(examples[status, reason])
        is_masked = example != reason
        yield FailedRuns(design, Status(status), str(reason), count, example * is_masked)


def _common_reasons(tree: xr.DataTree) -> dict[str, str]:
    """Return the text of each reason of a model's failed runs; the same for all of its designs."""
    designs = (read_group(tree, RUNS, design) for design in group_names(tree, RUNS))
    return common_reasons(
        reason
        for runs in designs
        if FAILURE_REASON in runs
        for reason in runs[FAILURE_REASON].values.tolist()
    )


def has_failed_design(tree: xr.DataTree) -> bool:
    """Return whether some design has no completed run."""
    designs = (
        read_group(model, RUNS, design)
        for model in model_trees(tree).values()
        for design in group_names(model, RUNS)
    )
    return any(not status_counts(runs)[Status.OK] for runs in designs)
