"""Samples of columns with few values, such as the status of a run, from one pass over the runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.blocks import BlockedRuns, block_ranges
from uqpen.core.labels import REPLICATE, STATUS
from uqpen.core.status import Status
from uqpen.statistics.by_blocks.blocked_sample import BlockedSample, PowerSums
from uqpen.statistics.by_blocks.cells import CellCounts, Splitters
from uqpen.statistics.by_blocks.grouping import Grouping

__all__ = ["Tabulated", "status_sample", "tabulated_samples"]

# Takes columns of runs; returns a column of few values, and the runs that have one.
Tabulated = Callable[[Mapping[str, npt.NDArray[Any]]], tuple[FloatArray, BoolArray]]


def status_sample(runs: BlockedRuns, level: float) -> BlockedSample:
    """Return the sample of the runs' statuses, in which no run is missing."""

    def statuses(read: Mapping[str, npt.NDArray[Any]]) -> tuple[FloatArray, BoolArray]:
        return read[STATUS].astype(np.float64), np.ones(read[STATUS].shape, dtype=np.bool_)

    values = np.array([*Status], dtype=np.float64)
    return tabulated_samples(runs, [], [statuses], values, level)[0]


def tabulated_samples(
    runs: BlockedRuns,
    names: Sequence[str],
    columns: Sequence[Tabulated],
    values: FloatArray,
    level: float,
) -> list[BlockedSample]:
    """Return the sample of each of some columns that follow from others.

    Parameters
    ----------
    runs : BlockedRuns
    names : sequence of str
        The columns that are read, besides the status.
    columns : sequence of callable
    values : ndarray, shape (value,)
        All values that they may have, ascending.
    level : float
        Confidence level of the intervals.
    """
    grouping, splitters = Grouping.of_runs(runs), Splitters(values)
    counted = [CellCounts.empty(splitters, grouping.groups) for _ in columns]
    powers = [PowerSums.empty(grouping.groups) for _ in columns]
    missing_counts = np.zeros((len(columns), grouping.groups), dtype=np.int64)
    labels = [STATUS, *([REPLICATE] if grouping.is_replicated else [])]
    for start, stop in block_ranges(runs.size):
        read = runs.part(start, stop, [*labels, *names])
        is_failed = (read[STATUS] != Status.OK) & (read[STATUS] != Status.INADMISSIBLE)
        found = [column(read) for column in columns]
        for group, rows in grouping.grouped_runs(start, stop, read.get(REPLICATE)):
            for k, (column, used) in enumerate(found):
                taken = column[rows][used[rows]]
                counted[k].add(group, splitters.locate(taken))
                powers[k].add(group, taken)
                missing_counts[k, group] += (is_failed[rows] & ~used[rows]).sum()
    return [
        BlockedSample.of_first(
            grouping.groups,
            cells,
            sums,
            missing,
            grouping.sampling,
            is_replicated=grouping.is_replicated,
            level=level,
        )
        for cells, sums, missing in zip(counted, powers, missing_counts, strict=True)
    ]
