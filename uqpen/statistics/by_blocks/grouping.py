"""Groups of runs: parts of a design that are samples by themselves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import IntArray
from uqpen.core.blocks import BlockedRuns, block_ranges
from uqpen.core.labels import REPLICATE, SAMPLING
from uqpen.core.sampling import Sampling
from uqpen.statistics.convergence import part_sizes

__all__ = ["Grouping"]

# More replicates are joined, as each group has counts of its own: 67 MB for an input.
_MOST_GROUPS = 1024


@dataclass(frozen=True, eq=False)
class Grouping:
    """Division of the runs of a design.

    A group is a replicate, or as many consecutive ones in each; of other designs, the runs from one
    end of a growing part to the next. So each growing part is the first groups.

    Parameters
    ----------
    points : int
        Number of runs of the design.
    sampling : Sampling
    replicates : ndarray of int, shape (group,)
        Number of the first replicate of each group, ascending; empty where the design has one
        replicate at the most.
    sizes : ndarray of int, shape (group,)
        Points of each group.
    """

    points: int
    sampling: Sampling
    replicates: IntArray
    sizes: IntArray

    @classmethod
    def of_runs(cls, runs: BlockedRuns) -> Grouping:
        """Return the grouping of a design's runs."""
        sampling, counts = Sampling(runs.attrs[SAMPLING]), np.zeros(0, dtype=np.int64)
        if sampling is Sampling.STRATIFIED and REPLICATE in runs.template.coords:
            for start, stop in block_ranges(runs.size):
                more = np.bincount(runs.part(start, stop, [REPLICATE])[REPLICATE])
                longer = max(len(counts), len(more))
                counts = np.pad(counts, (0, longer - len(counts)))
                counts[: len(more)] += more
        numbers = np.flatnonzero(counts)
        if numbers.size < 2:
            return cls(runs.size, sampling, numbers[:0], counts[:0])
        firsts = np.arange(0, numbers.size, -(-numbers.size // _MOST_GROUPS))
        return cls(runs.size, sampling, numbers[firsts], np.add.reduceat(counts[numbers], firsts))

    @property
    def is_replicated(self) -> bool:
        """True if the groups are of replicates."""
        return self.replicates.size > 0

    @cached_property
    def parts(self) -> list[int]:
        """Number of groups in each growing part; the last is the whole."""
        if self.is_replicated:
            return part_sizes(self.points, self.replicates.size)
        return list(range(1, self._group_ends.size + 1))

    @cached_property
    def part_points(self) -> list[int]:
        """Number of points of each growing part."""
        if self.is_replicated:
            return [int(self.sizes[:groups].sum()) for groups in self.parts]
        return [int(end) for end in self._group_ends]

    @property
    def groups(self) -> int:
        """Number of groups."""
        return self.parts[-1]

    def grouped_runs(
        self, start: int, stop: int, replicate: npt.NDArray[Any] | None
    ) -> Iterator[tuple[int, Any]]:
        """Yield each group of the runs from one number to another, and their places among these.

        Parameters
        ----------
        start, stop : int
            The first run, and the one after the last.
        replicate : ndarray of int, shape (run,), optional
            Their replicates.
        """
        if self.is_replicated and replicate is not None:
            groups = np.searchsorted(self.replicates, replicate, side="right") - 1
            for group in np.flatnonzero(np.bincount(groups)).tolist():
                rows = np.flatnonzero(groups == group)
                yield group, slice(None) if rows.size == stop - start else rows
            return
        first = start
        ends = np.append(self._group_ends, stop)
        for end in np.unique(ends[(ends > start) & (ends <= stop)]).tolist():
            group = int(np.searchsorted(self._group_ends, end))
            yield group, slice(first - start, end - start)
            first = end

    @cached_property
    def _group_ends(self) -> IntArray:
        has_parts = self.sampling is Sampling.INDEPENDENT
        return np.array(part_sizes(self.points, 0) if has_parts else [self.points])
