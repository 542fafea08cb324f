"""Blocks of a pick-freeze design: their parts, and the labels of their rows.

A block of the first round has a row of each of the matrices A and B, whose points are drawn, and of
those that mix their columns: AB_i is A with input i of B, BA_i is B with input i of A. Sobol'
indices compare points that share some inputs and are independent in the others. For a distribution
conditional on admissible draws, the others must be drawn given the shared inputs. So a block is
read as *parts*; each names another part, and the inputs shared with it. If no draw was
inadmissible, the rows of the first round serve as all parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.labels import BLOCK_NUMBER, MATRIX, ROUND

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MATRIX_A", "MATRIX_B", "BlockLayout", "PickFreezePart"]


MATRIX_A, MATRIX_B = 0, 1

# Prefixes of the flag meanings of mixed matrices, before the name of the input.
_AB_PREFIX, _BA_PREFIX = "AB_", "BA_"


@dataclass(frozen=True)
class PickFreezePart:
    """Part of a block: one of its points.

    Parameters
    ----------
    matrix : int
        Label of the rows of later rounds that were drawn for it.
    first : int
        The matrix whose row of the first round serves if none had to be drawn again.
    anchor : int or None
        The `matrix` of the part with shared inputs; None for a point of its own.
    shared : tuple of int
        Columns of the shared inputs.
    rest : int
        The matrix whose first row gives the other inputs of the first proposal.
    """

    matrix: int
    first: int
    anchor: int | None = None
    shared: tuple[int, ...] = ()
    rest: int = MATRIX_A


@dataclass(frozen=True)
class BlockLayout:
    """The matrices and parts of a design over some inputs.

    Parameters
    ----------
    inputs : tuple of str
        The random inputs, in the order of the columns.
    second_order : bool
        Whether there are BA_i, for indices of pairs of inputs.
    """

    inputs: tuple[str, ...]
    second_order: bool

    @classmethod
    def from_runs(cls, runs: xr.Dataset) -> BlockLayout:
        """Read the layout of a design from its runs."""
        meanings = str(runs[MATRIX].attrs["flag_meanings"]).split()
        inputs = [text.removeprefix(_AB_PREFIX) for text in meanings if text.startswith(_AB_PREFIX)]
        return cls(tuple(inputs), any(text.startswith(_BA_PREFIX) for text in meanings))

    @property
    def dimension(self) -> int:
        """Number of random inputs."""
        return len(self.inputs)

    @property
    def rows_per_block(self) -> int:
        """Number of rows of a block of the first round."""
        return 2 + (2 if self.second_order else 1) * self.dimension

    @cached_property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Pairs of inputs with second-order indices."""
        return tuple(combinations(range(self.dimension), 2)) if self.second_order else ()

    @cached_property
    def parts(self) -> dict[int, PickFreezePart]:
        """All parts by their matrix; those that others share inputs with come before them."""
        drawn = [PickFreezePart(MATRIX_A, MATRIX_A), PickFreezePart(MATRIX_B, MATRIX_B)]
        each = range(self.dimension)
        if self.second_order:
            drawn += [PickFreezePart(2 + self.dimension + i, 2 + self.dimension + i) for i in each]
        sharing = [
            *(self.part_sharing_one(i) for i in each),
            *(self.part_sharing_others(i) for i in each),
            *(self.part_sharing_pair(number) for number in range(len(self.pairs))),
        ]
        return {part.matrix: part for part in [*drawn, *sharing]}

    def part_sharing_one(self, i: int) -> PickFreezePart:
        """Return the part that shares input `i` alone with B."""
        return PickFreezePart(2 + 2 * self.dimension + i, 2 + i, MATRIX_B, (i,), MATRIX_A)

    def part_sharing_others(self, i: int) -> PickFreezePart:
        """Return the part that shares all inputs but `i` with A."""
        others = tuple(j for j in range(self.dimension) if j != i)
        return PickFreezePart(2 + 3 * self.dimension + i, 2 + i, MATRIX_A, others, MATRIX_B)

    def part_sharing_pair(self, number: int) -> PickFreezePart:
        """Return the part that shares a pair of inputs with BA_i, where i is the first of them."""
        i, j = self.pairs[number]
        anchor = 2 + self.dimension + i
        return PickFreezePart(2 + 4 * self.dimension + number, 2 + j, anchor, (i, j), MATRIX_A)

    def matrices(self, A: FloatArray, B: FloatArray) -> FloatArray:
        """Return the points of the first round, shape (block, matrix, input), from A and B."""
        each = range(self.dimension)
        matrices = [A, B, *(_exchange_column(A, B, i) for i in each)]
        if self.second_order:
            matrices += [_exchange_column(B, A, i) for i in each]
        return np.stack(matrices, axis=1)

    def flag_attributes(self) -> dict[str, Any]:
        """Return the CF flag attributes for the matrix of a row."""
        meanings = ["A", "B", *(f"{_AB_PREFIX}{name}" for name in self.inputs)]
        numbers = list(range(2 + self.dimension))
        if self.second_order:
            meanings += [f"{_BA_PREFIX}{name}" for name in self.inputs]
            numbers = list(range(2 + 2 * self.dimension))
        numbers += [part.matrix for part in self.parts.values() if part.anchor is not None]
        meanings += [f"redrawn_sharing_{name}" for name in self.inputs]
        meanings += [f"redrawn_sharing_all_but_{name}" for name in self.inputs]
        meanings += [f"redrawn_sharing_{self.inputs[i]}+{self.inputs[j]}" for i, j in self.pairs]
        return {
            "long_name": "matrix of the run's block",
            "flag_values": np.array(numbers, dtype=np.int16),
            "flag_meanings": " ".join(meanings),
        }

    def run_numbers(self, runs: xr.Dataset) -> dict[int, IntArray]:
        """Return the last run of each part of each block, from all runs of the design.

        Returns
        -------
        dict of int to ndarray of int, shape (block,)
            Positions along ``run`` by the part's `matrix`; -1 where no run was made.
        """
        block, matrix = runs[BLOCK_NUMBER].values, runs[MATRIX].values
        round_number = runs[ROUND].values if ROUND in runs.coords else np.zeros_like(block)
        in_order = np.argsort(round_number, kind="stable")
        rows: dict[int, IntArray] = {}
        for number, part in self.parts.items():
            serves = np.where(round_number == 0, matrix == part.first, matrix == number)
            if part.anchor is not None:
                # A row of the first round shares nothing with an anchor that was drawn again.
                redrawn = (rows[part.anchor] < 0) | (round_number[rows[part.anchor]] > 0)
                serves &= (round_number > 0) | ~redrawn[block]
            chosen = in_order[serves[in_order]]
            rows[number] = np.full(int(block.max()) + 1, -1)
            rows[number][block[chosen]] = chosen
        return rows


def _exchange_column(points: FloatArray, others: FloatArray, i: int) -> FloatArray:
    """Return points with one column replaced by that of others."""
    mixed = points.copy()
    mixed[:, i] = others[:, i]
    return mixed
