"""A pass over runs: each block is read once, in order, and handed on in chunks of one group."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.blocks import BlockedRuns, block_ranges
from uqpen.core.labels import ABSENT, REPLICATE, STATUS
from uqpen.core.status import Status
from uqpen.statistics.by_blocks.grouping import Grouping
from uqpen.statistics.input_columns import InputColumns

__all__ = ["Chunk", "RunTable"]

# Stretches of the runs from which cells are made.
_STRETCHES = 16


@dataclass(frozen=True, eq=False)
class Chunk:
    """Completed runs of one group and one batch.

    Parameters
    ----------
    group, batch : int
    columns : dict of str to ndarray, shape (run,)
        Of the completed runs that have a value of each output.
    missing : int
        Number of failed runs, but for those at inadmissible points.
    """

    group: int
    batch: int
    columns: dict[str, FloatArray]
    missing: int


@dataclass(frozen=True, eq=False)
class RunTable:
    """Inputs and some outputs of runs that can be read by blocks.

    Parameters
    ----------
    runs : BlockedRuns
    grouping : Grouping
    outputs : tuple of str
        Outputs that have a value in the same runs.
    """

    runs: BlockedRuns
    grouping: Grouping
    outputs: tuple[str, ...]

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """The random inputs."""
        return InputColumns.from_runs(self.runs).names

    def some_columns(self, names: Sequence[str]) -> dict[str, FloatArray]:
        """Return columns of some completed runs, from which cells are made.

        They are as many as a block, in pieces all over the design: a table may be sorted.
        """
        parts: list[dict[str, FloatArray]] = []
        _, block = next(block_ranges(self.runs.size))
        for number in range(_STRETCHES):
            start = number * self.runs.size // _STRETCHES
            stop = start + block // _STRETCHES
            read = self._read(start, min(stop, self.runs.size), names)
            used = self._used(read)
            parts.append({name: _floats(read[name][used]) for name in names})
        return {name: np.concatenate([part[name] for part in parts]) for name in names}

    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """Yield columns chunk after chunk, in the order of the runs."""
        for start, stop in block_ranges(self.runs.size):
            read = self._read(start, stop, names)
            used, status = self._used(read), read[STATUS]
            is_missing = (status != Status.OK) & (status != Status.INADMISSIBLE)
            for group, batch, rows in self.grouping.grouped_runs(start, stop, read.get(REPLICATE)):
                mine = used[rows]
                taken = slice(None) if mine.all() else mine
                columns = {name: _floats(read[name][rows][taken]) for name in names}
                yield Chunk(group, batch, columns, int(is_missing[rows].sum()))

    def _read(self, start: int, stop: int, names: Sequence[str]) -> dict[str, npt.NDArray[Any]]:
        labels = [STATUS, *([REPLICATE] if self.grouping.is_replicated else [])]
        return self.runs.part(start, stop, [*labels, *{*names, *self._with_gaps}])

    @cached_property
    def _with_gaps(self) -> list[str]:
        """The outputs that some completed runs may have no value of."""
        return [name for name in self.outputs if ABSENT in self.runs.template[name].attrs]

    def _used(self, read: dict[str, npt.NDArray[Any]]) -> BoolArray:
        used: BoolArray = read[STATUS] == Status.OK
        for name in self._with_gaps:
            used = used & ~np.isnan(read[name])
        return used


def _floats(values: npt.NDArray[Any] | IntArray) -> FloatArray:
    return np.ascontiguousarray(values, dtype=np.float64)
