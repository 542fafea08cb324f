"""Runs as datasets: joined, compared, counted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.blocks import BlockedRuns, LoadedDataset, block_ranges
from uqpen.core.labels import (
    REPLICATE,
    REPLICATES_MADE,
    ROUND,
    RUN,
    RUNS_MADE,
    STATUS,
    STATUS_COUNTS,
)
from uqpen.core.status import Status

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "bytes_of_a_run",
    "common_runs",
    "replicate_count",
    "run_count",
    "status_counts",
    "worst_status_runs",
]


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


def common_runs(runs: Sequence[xr.Dataset]) -> list[xr.Dataset]:
    """Return the runs of several models in the rounds of a design that all of them have run.

    Their runs are then at the same points.
    """
    if all(ROUND not in each.coords for each in runs):
        return [*runs]
    numbers = [np.unique(each[ROUND].values) for each in runs]
    common = reduce(np.intersect1d, numbers)
    return [each.isel({RUN: np.isin(each[ROUND].values, common)}) for each in runs]


def bytes_of_a_run(runs: xr.Dataset) -> int:
    """Return how many bytes an archive needs for each run of a design that did not fail."""
    of_runs = (each for each in runs.variables.values() if RUN in each.dims)
    return sum(each.dtype.itemsize * math.prod(each.shape[1:]) for each in of_runs)


def run_count(runs: xr.Dataset) -> int:
    """Return the number of runs of a design, whether or not an archive has kept them."""
    return int(runs.attrs.get(RUNS_MADE, runs.sizes.get(RUN, 0)))


def status_counts(runs: xr.Dataset | BlockedRuns) -> dict[Status, int]:
    """Count the runs with each status."""
    if STATUS_COUNTS in runs.attrs:
        return dict(zip(Status, np.asarray(runs.attrs[STATUS_COUNTS]).tolist(), strict=True))
    handle, counts = LoadedDataset.of(runs), np.zeros(len(Status), dtype=np.int64)
    for start, stop in block_ranges(handle.size):
        found = handle.part(start, stop, [STATUS])[STATUS]
        counts += [np.count_nonzero(found == status) for status in Status]
    return dict(zip(Status, counts.tolist(), strict=True))


def replicate_count(runs: xr.Dataset) -> int:
    """Return the number of replicates of a design, 1 without any; its runs may not be kept."""
    if REPLICATES_MADE in runs.attrs:
        return int(runs.attrs[REPLICATES_MADE])
    if REPLICATE not in runs.variables:
        return 1
    column, found = runs.variables[REPLICATE], set[int]()
    for start, stop in block_ranges(runs.sizes[RUN]):
        found.update(np.unique(column[start:stop].values).tolist())
    return len(found)
