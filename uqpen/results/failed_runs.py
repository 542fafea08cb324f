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

__all__ = ["FailedRuns", "failed_runs", "has_failed_design"]


class FailedRuns(NamedTuple):
    """Number of runs of one design that failed for one reason."""

    design: str
    status: Status
    reason: str
    runs: int


def failed_runs(tree: xr.DataTree, design: str) -> Iterator[FailedRuns]:
    """Yield the failed runs of a design by reason, the most frequent first."""
    runs = read_group(tree, RUNS, design)
    if FAILURE_REASON in runs:
        at = np.searchsorted(runs[RUN].values, runs[FAILED_RUN].values)
        statuses = runs[STATUS].values[at].tolist()
        counted = Counter(zip(statuses, runs[FAILURE_REASON].values.tolist(), strict=True))
        for (status, reason), count in counted.most_common():
            yield FailedRuns(design, Status(status), str(reason), count)


def has_failed_design(tree: xr.DataTree) -> bool:
    """Return whether some design has no completed run."""
    designs = (
        read_group(model, RUNS, design)
        for model in model_trees(tree).values()
        for design in group_names(model, RUNS)
    )
    return any(not status_counts(runs)[Status.OK] for runs in designs)
