"""Sums of variables over the cells of an input by replicate, and the share that it explains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics.by_blocks.cell_sums import Totals, sum_neighbours
from uqpen.statistics.by_blocks.locate import Cells
from uqpen.statistics.by_blocks.sums_by_cell import sums_by_cell

__all__ = ["ReplicateSums"]

# Numbers in the sums of all inputs, which take 128 MB.
_MOST = 2**24


@dataclass(frozen=True, eq=False)
class ReplicateSums:
    """Sums of variables over the cells of an input, by replicate of a stratified design.

    The points of a replicate avoid each other, so two of them in a cell are not independent. Runs
    of different replicates are: their products alone show what the input explains.

    Parameters
    ----------
    cells : int
        Number of cells of the input.
    counts : ndarray of int, shape (replicate, bin)
        A bin is some neighbouring cells, one where memory allows.
    sums : ndarray, shape (replicate, variable, bin)
    """

    cells: int
    counts: IntArray
    sums: FloatArray

    @classmethod
    def empty(cls, cells: int, variables: int, replicates: int, inputs: int) -> ReplicateSums:
        """Return the sums of no runs, for an input of several."""
        bins = max(min(cells, _MOST // (variables * replicates * inputs)), 2)
        shape = (replicates, variables, bins)
        return cls(cells, np.zeros((replicates, bins), dtype=np.int64), np.zeros(shape))

    def add(self, batch: int, cells: Cells, count: IntArray, variables: FloatArray) -> None:
        """Add runs to a replicate, in place; see `CellSums.add`."""
        bins = self.counts.shape[1]
        self.counts[batch] += sum_neighbours(count, bins)
        added = sums_by_cell(cells, variables, self.cells)
        self.sums[batch] += sum_neighbours(added, bins).T

    def shares(self, totals: Totals, joined: int = 1) -> FloatArray:
        """Share of the variance of each variable that the bins explain; see `CellSums.shares`."""
        starts = np.arange(0, self.counts.shape[1], joined)
        counts = np.add.reduceat(self.counts, starts, axis=1)
        sums = np.add.reduceat(self.sums, starts, axis=2)
        return _share(*_crossed(counts, sums), _summed(totals))

    def errors(self, totals: Totals) -> FloatArray:
        """Standard errors of these shares, by leaving out one replicate after the other."""
        counts, sums = self.counts.sum(axis=0), self.sums.sum(axis=0)
        count_squares, squares = (self.counts**2).sum(axis=0), (self.sums**2).sum(axis=0)
        whole, found = _summed(totals), []
        for r in np.flatnonzero(totals.sizes):
            left = Totals(
                *(
                    all_ - own[r]
                    for all_, own in zip(vars(whole).values(), vars(totals).values(), strict=True)
                )
            )
            own = counts - self.counts[r], count_squares - self.counts[r] ** 2
            cross = (sums - self.sums[r]) ** 2 - (squares - self.sums[r] ** 2)
            found.append(_share(own[0], own[0] ** 2 - own[1], cross, left))
        replicates = len(found)
        if replicates < 3:
            return np.full(self.sums.shape[1], np.nan)
        deviations = np.array(found) - np.mean(found, axis=0)
        error: FloatArray = np.sqrt((deviations**2).sum(axis=0) * (replicates - 1) / replicates)
        return error


def _crossed(counts: IntArray, sums: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the runs of each bin, its pairs of two replicates, and the sums of their products."""
    runs = counts.sum(axis=0)
    pairs = runs**2 - (counts**2).sum(axis=0)
    return runs, pairs, sums.sum(axis=0) ** 2 - (sums**2).sum(axis=0)


def _share(runs: IntArray, pairs: IntArray, products: FloatArray, totals: Totals) -> FloatArray:
    known = pairs > 0
    explained = (products[:, known] / pairs[known] * runs[known]).sum(axis=-1)
    # Bins that one replicate alone has met stand for no pair; the others stand for all.
    scale = totals.sizes / max(runs[known].sum(), 1)
    square_of_mean = totals.sums**2 / totals.sizes
    whole = np.asarray(totals.squares - square_of_mean)
    none = np.full(whole.shape, np.nan)
    return np.divide(explained * scale - square_of_mean, whole, out=none, where=whole > 0)


def _summed(totals: Totals) -> Totals:
    return Totals(*(np.sum(each, axis=0) for each in vars(totals).values()))
