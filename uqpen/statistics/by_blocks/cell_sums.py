"""Sums of variables over the cells of an input, and the share of their variance it explains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics.by_blocks.locate import Cells
from uqpen.statistics.by_blocks.sums_by_cell import sums_by_cell

__all__ = ["INPUT_SPLITTERS", "CellSums", "Totals", "sum_neighbours"]

_Numbers = npt.NDArray[Any]

# Of an input. A jump between two of them hides from an index what its probability there decides.
INPUT_SPLITTERS = 4096
# A splitter is a cell of its own if it has this part of a cell's mean number of runs.
_SHARED = 4
# Runs of a batch in one of its bins, at least.
_RUNS_IN_A_BIN = 8


@dataclass(frozen=True, eq=False)
class Totals:
    """Sums of variables and of their squares, by batch; shape (batch, variable)."""

    sizes: IntArray
    sums: FloatArray
    squares: FloatArray

    @classmethod
    def empty(cls, batches: int, variables: int) -> Totals:
        """Return the sums of no runs."""
        shape = (batches, variables)
        return cls(np.zeros(batches, dtype=np.int64), np.zeros(shape), np.zeros(shape))

    def add(self, batch: int, variables: FloatArray) -> None:
        """Add runs to a batch, in place; their variables are rows."""
        self.sizes[batch] += variables.shape[1]
        self.sums[batch] += variables.sum(axis=1)
        self.squares[batch] += np.einsum("vr,vr->v", variables, variables)


@dataclass(frozen=True, eq=False)
class CellSums:
    """Sums of variables over the cells of an input, and over bins of each batch.

    The bins of all batches together are as many as the intervals between splitters, so that the
    noise of the products of two runs in a bin is that of these.

    Parameters
    ----------
    counts : ndarray of int, shape (cell,)
    sums : ndarray, shape (variable, cell)
    batch_counts : ndarray of int, shape (batch, bin)
    batch_sums : ndarray, shape (batch, variable, bin)
    """

    counts: IntArray
    sums: FloatArray
    batch_counts: IntArray
    batch_sums: FloatArray

    @classmethod
    def empty(cls, cells: int, variables: int, batches: int, runs: int) -> CellSums:
        """Return the sums of no runs, for a number of runs to come."""
        bins = max(min(cells, INPUT_SPLITTERS // batches, runs // (_RUNS_IN_A_BIN * batches)), 2)
        return cls(
            np.zeros(cells, dtype=np.int64),
            np.zeros((variables, cells)),
            np.zeros((batches, bins), dtype=np.int64),
            np.zeros((batches, variables, bins)),
        )

    def add(self, batch: int, cells: Cells, count: IntArray, variables: FloatArray) -> None:
        """Add runs to a batch, in place, by their cells; their variables are rows.

        `count` is how many of them each cell has.
        """
        bins = self.batch_counts.shape[1]
        self.counts[:] += count
        self.batch_counts[batch] += sum_neighbours(count, bins)
        added = sums_by_cell(cells, variables, self.counts.size)
        self.sums[:] += added.T
        self.batch_sums[batch] += sum_neighbours(added, bins).T

    def shares(self, totals: Totals, joined: int = 1) -> FloatArray:
        """Share of the variance of each variable that the cells explain, shape (variable,).

        Parameters
        ----------
        totals : Totals
        joined : int
            Number of neighbours taken as one.
        """
        starts = self._starts[::joined]
        counts = np.add.reduceat(self.counts, starts)[np.newaxis]
        sums = np.add.reduceat(self.sums, starts, axis=1)[np.newaxis]
        whole = Totals(*(np.sum(e, axis=0, keepdims=True) for e in vars(totals).values()))
        left, total = _parts(counts, sums, whole, whole.sums / np.maximum(whole.sizes, 1))
        found: FloatArray = 1 - _ratio(left[0], total[0])
        return found

    @property
    def _starts(self) -> IntArray:
        """First cells of what is taken as one: a splitter that few runs share joins those below."""
        is_own = self.counts * (_SHARED * self.counts.size) >= self.counts.sum()
        is_own[::2] = True
        return np.flatnonzero(is_own)

    def errors(self, totals: Totals) -> FloatArray:
        """Standard errors of these shares, from the scatter of the batches."""
        mean = totals.sums.sum(axis=0) / max(totals.sizes.sum(), 1)
        left, total = _parts(self.batch_counts, self.batch_sums, totals, mean)
        batches, whole = len(left), total.sum(axis=0)
        excess = left - _ratio(left.sum(axis=0), whole) * total
        variance = (excess**2).sum(axis=0) * batches / max(batches - 1, 1)
        return _ratio(np.sqrt(variance), whole)


def _ratio(part: FloatArray, whole: FloatArray) -> FloatArray:
    """Return parts of sums of squares; NaN where a variable does not vary."""
    return np.divide(part, whole, out=np.full(whole.shape, np.nan), where=whole > 0)


def sum_neighbours(by_cell: _Numbers, bins: int) -> _Numbers:
    """Return the sums of the cells, which are rows, in each of as many bins, of as many each."""
    if bins == len(by_cell):
        return by_cell
    found: _Numbers = np.add.reduceat(by_cell, np.arange(bins) * len(by_cell) // bins)
    return found


def _parts(
    counts: IntArray, sums: FloatArray, totals: Totals, mean: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the sums of squares about the bins, unbiased, and about a mean; (batch, variable)."""
    sizes = totals.sizes[:, np.newaxis].astype(np.float64)
    filled = np.maximum(counts, 1)[:, np.newaxis, :]
    explained = (sums**2 / filled).sum(axis=-1)
    freedom = sizes - (counts > 0).sum(axis=-1, keepdims=True)
    left = (totals.squares - explained) * sizes / np.maximum(freedom, 1)
    total = totals.squares - 2 * mean * totals.sums + sizes * mean**2
    unbiased = np.maximum(sizes.sum(), 2) / np.maximum(sizes.sum() - 1, 1)
    return left, total * unbiased
