"""Runs as datasets: joined, compared, counted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, ROUND, RUN, STATUS
from uqpen.core.status import Status

__all__ = ["join_rounds", "status_counts", "worst_status_runs"]


def join_rounds(rounds: Sequence[xr.Dataset]) -> xr.Dataset:
    """Join the runs of one or more rounds of a design, and number them consecutively.

    If there are several, each run gets the number of its round as a coordinate.
    """
    if len(rounds) == 1:
        return rounds[0]
    sizes = [runs.sizes[RUN] for runs in rounds]
    starts = np.cumsum([0, *sizes[:-1]])
    along_run = [runs.drop_vars([FAILED_RUN, FAILURE_REASON], errors="ignore") for runs in rounds]
    joined = xr.concat(along_run, RUN, data_vars="minimal", coords="minimal", compat="equals")
    joined = joined.assign_coords({RUN: np.arange(sum(sizes))})
    joined[RUN].attrs = rounds[0][RUN].attrs
    joined = joined.assign_coords({ROUND: (RUN, np.repeat(np.arange(len(rounds)), sizes))})
    joined[ROUND].attrs = {"units": "1", "long_name": "round that the run was made in"}
    failed = [
        runs[[FAILURE_REASON]].assign_coords({FAILED_RUN: runs[FAILED_RUN] + start})
        for runs, start in zip(rounds, starts, strict=True)
        if FAILURE_REASON in runs
    ]
    return joined.merge(xr.concat(failed, FAILED_RUN)) if failed else joined


def worst_status_runs(runs: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return the runs of the first of several models, failed where the run of any model failed.

    All models have runs at the same points. A run that is inadmissible to one model is
    inadmissible; others have the highest status.
    """
    first, *others = runs
    if not others:
        return first
    statuses = np.stack([each[STATUS].values for each in runs])
    worst = statuses.max(axis=0)
    worst[(statuses == Status.INADMISSIBLE).any(axis=0)] = Status.INADMISSIBLE
    return first.assign({STATUS: first[STATUS].copy(data=worst)})


def status_counts(runs: xr.Dataset | BlockedRuns) -> dict[Status, int]:
    """Count the runs with each status."""
    found = LoadedDataset.of(runs).column(STATUS)
    return {status: int(np.count_nonzero(found == status)) for status in Status}
