"""Counts of cells of normal scores of outputs by classes of inputs, from which delta follows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics.by_blocks.count_pairs import Classes, count_pairs
from uqpen.statistics.sensitivity.delta import SCORE_CELLS, class_count, score_cells

__all__ = ["ScoreTables"]

# Cells without runs have such a share below them, in place of 0.
_NONE = 1e-12


@dataclass(frozen=True, eq=False)
class ScoreTables:
    """Counts of the runs by class of an input and by cell of an output's normal score.

    Parameters
    ----------
    columns : dict of str to ndarray of int, shape (cell,)
        Class of each cell of an input, and score cell of each cell of an output.
    tables : dict
        Of shape (class, score cell), by input and output.
    """

    columns: dict[str, Classes]
    tables: dict[tuple[str, str], IntArray]

    @classmethod
    def empty(
        cls,
        shares: Mapping[str, FloatArray],
        inputs: Sequence[str],
        outputs: Sequence[str],
        runs: int,
    ) -> ScoreTables:
        """Return the counts of no runs.

        Parameters
        ----------
        shares : mapping of str to ndarray, shape (cell,)
            By column, the share of the runs below each of its cells.
        inputs, outputs : sequence of str
        runs : int
            Number of runs to come.
        """
        classes = class_count(runs)
        columns = {}
        for name in inputs:
            which = np.floor(shares[name] * classes).astype(np.int64)
            columns[name] = np.minimum(which, classes - 1)
        scored = {name: score_cells(np.clip(shares[name], _NONE, 1 - _NONE)) for name in outputs}
        shape = (classes, SCORE_CELLS)
        tables = {(i, o): np.zeros(shape, np.int64) for i in inputs for o in outputs}
        found = {name: each.astype(np.int16) for name, each in {**columns, **scored}.items()}
        return cls(found, tables)

    def add(self, cells: Mapping[str, npt.NDArray[np.int32]]) -> None:
        """Add runs, in place, by the cells of their columns."""
        # All cells are there: what takes them need not look for others, which takes as long.
        found = {n: of_cell.take(cells[n], mode="clip") for n, of_cell in self.columns.items()}
        for (one, other), table in self.tables.items():
            count_pairs(found[one], found[other], table)
