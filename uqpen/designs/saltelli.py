"""Saltelli's design: blocks of points that share inputs, for Sobol' indices."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.errors import Problem
from uqpen.core.labels import BLOCK_NUMBER, MATRIX, REPLICATE, ROUND
from uqpen.core.limits import MOST_REPLICATES
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count, flag
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Extension, Rounds
from uqpen.designs.quasi_monte_carlo import sobol_points
from uqpen.designs.replicated import nested_replicates, uneven_replicates
from uqpen.distributions.joint_distribution import JointDistribution, points_dataset

if TYPE_CHECKING:
    import xarray as xr

# Blocks of a pick-freeze design: their parts, and the labels of their rows.
#
# A block of the first round has a row of each of the matrices A and B, whose points are drawn, and
# of those that mix their columns: AB_i is A with input i of B, BA_i is B with input i of A. Sobol'
# indices compare points that share some inputs and are independent in the others. For a
# distribution conditional on admissible draws, the others must be drawn given the shared inputs. So
# a block is read as *parts*; each names another part, and the inputs shared with it. If no draw was
# inadmissible, the rows of the first round serve as all parts.


MATRIX_A, MATRIX_B = 0, 1

# Prefixes of the flag meanings of mixed matrices, before the name of the input.
_AB_PREFIX, _BA_PREFIX = "AB_", "BA_"
# Flag meaning of a further run at the points of A, of a model with noise of its own.
_REPEATED_A = "A_again"


@dataclass(frozen=True)
class PickFreezePart:
    """Part of a block: one of its points."""

    matrix: int  # label of the rows of later rounds that were drawn for it
    first: int  # the matrix whose row of the first round serves if none had to be drawn again
    # The `matrix` of the part with shared inputs; None for a point of its own.
    anchor: int | None = None
    shared: tuple[int, ...] = ()  # columns of the shared inputs
    rest: int = MATRIX_A  # the matrix whose first row gives the other inputs of the first proposal


@dataclass(frozen=True)
class BlockLayout:
    """The matrices and parts of a design over some inputs."""

    inputs: tuple[str, ...]  # the random inputs, in the order of the columns
    second_order: bool  # whether there are BA_i, for indices of pairs of inputs
    noise: bool = False  # whether the point of A has two runs

    @classmethod
    def from_runs(cls, runs: xr.Dataset) -> BlockLayout:
        """Read the layout of a design from its runs."""
        meanings = str(runs[MATRIX].attrs["flag_meanings"]).split()
        inputs = [text.removeprefix(_AB_PREFIX) for text in meanings if text.startswith(_AB_PREFIX)]
        second_order = any(text.startswith(_BA_PREFIX) for text in meanings)
        return cls(tuple(inputs), second_order, _REPEATED_A in meanings)

    @property
    def dimension(self) -> int:
        """Number of random inputs."""
        return len(self.inputs)

    @property
    def rows_per_block(self) -> int:
        """Number of rows of a block of the first round."""
        return 2 + (2 if self.second_order else 1) * self.dimension + self.noise

    @property
    def _first_redrawn(self) -> int:
        """The least label of a part that is drawn again; those below are of the first round."""
        return 2 + 2 * self.dimension + self.noise

    @property
    def repeated_matrix(self) -> int:
        """Matrix of the second runs at the points of A; the last of the first round."""
        return self.rows_per_block - 1

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
            *([self.part_sharing_all()] if self.noise else []),
        ]
        return {part.matrix: part for part in [*drawn, *sharing]}

    def part_sharing_one(self, i: int) -> PickFreezePart:
        """Return the part that shares input `i` alone with B."""
        return PickFreezePart(self._first_redrawn + i, 2 + i, MATRIX_B, (i,), MATRIX_A)

    def part_sharing_others(self, i: int) -> PickFreezePart:
        """Return the part that shares all inputs but `i` with A."""
        others = tuple(j for j in range(self.dimension) if j != i)
        label = self._first_redrawn + self.dimension + i
        return PickFreezePart(label, 2 + i, MATRIX_A, others, MATRIX_B)

    def part_sharing_pair(self, number: int) -> PickFreezePart:
        """Return the part that shares a pair of inputs with BA_i, where i is the first of them."""
        i, j = self.pairs[number]
        anchor = 2 + self.dimension + i
        label = self._first_redrawn + 2 * self.dimension + number
        return PickFreezePart(label, 2 + j, anchor, (i, j), MATRIX_A)

    def part_sharing_all(self) -> PickFreezePart:
        """Return the part that shares all inputs with A: a further run at its point."""
        label = self._first_redrawn + 2 * self.dimension + len(self.pairs)
        return PickFreezePart(label, self.repeated_matrix, MATRIX_A, tuple(range(self.dimension)))

    def matrices(self, A: FloatArray, B: FloatArray) -> FloatArray:
        """Return the points of the first round, shape (block, matrix, input), from A and B."""
        each = range(self.dimension)
        matrices = [A, B, *(_exchange_column(A, B, i) for i in each)]
        if self.second_order:
            matrices += [_exchange_column(B, A, i) for i in each]
        if self.noise:
            matrices.append(A)
        return np.stack(matrices, axis=1)

    def flag_attributes(self) -> dict[str, Any]:
        """Return the CF flag attributes for the matrix of a row."""
        meanings = ["A", "B", *(f"{_AB_PREFIX}{name}" for name in self.inputs)]
        numbers = list(range(2 + self.dimension))
        if self.second_order:
            meanings += [f"{_BA_PREFIX}{name}" for name in self.inputs]
            numbers = list(range(2 + 2 * self.dimension))
        if self.noise:
            meanings.append(_REPEATED_A)
            numbers.append(self.repeated_matrix)
        numbers += [part.matrix for part in self.parts.values() if part.anchor is not None]
        meanings += [f"redrawn_sharing_{name}" for name in self.inputs]
        meanings += [f"redrawn_sharing_all_but_{name}" for name in self.inputs]
        meanings += [f"redrawn_sharing_{self.inputs[i]}+{self.inputs[j]}" for i, j in self.pairs]
        meanings += ["redrawn_sharing_all"] if self.noise else []
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


# Most rounds of redrawing; afterwards, an inadmissible point stays so.
MOST_ROUNDS = 100


@dataclass(frozen=True)
class Saltelli(Design):
    """Pick-freeze blocks over scrambled Sobol' points, for Sobol' indices.

    Each block has a point of a matrix A, one of a matrix B, and for each input one of A with that
    input from B. Inadmissible points are drawn again, in further rounds, given the inputs that they
    share with other points; so the indices are those of the joint distribution conditional on
    admissible draws. Points of missing runs, which failed otherwise, are not drawn again.

    Parameters
    ----------
    base : int
        Number of blocks in all: `replicates` times a power of two. Each block takes two runs more
        than there are random inputs.
    replicates : int
        Number of sets, each scrambled by itself; their scatter shows the error. At most 10 000.
    second_order : bool
        Whether there are also points of B with one input from A, for indices of pairs of inputs. A
        block of d random inputs then takes 2 d + 2 runs.
    noise : bool
        Whether the point of A has two runs in each block, of a model with noise of its own. A block
        takes one run more, and the indices are also those of the mean given the inputs.

    References
    ----------
    Saltelli, A. (2002). Comput. Phys. Commun. 145, 280-297.
    Saltelli, A. et al. (2010). Comput. Phys. Commun. 181, 259-270.
    """

    sampling = Sampling.PICK_FREEZE
    assumes_independence = True

    base: int = count(minimum=2)
    replicates: int = count(minimum=2, maximum=MOST_REPLICATES, default=16)
    second_order: bool = flag(default=False)
    noise: bool = flag(default=False)

    def check_settings(self) -> Iterator[Problem]:
        return uneven_replicates(self.base, self.replicates, powers_of_two=True, setting="base")

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        layout = self._layout(joint)
        A, B = self._base_matrices(joint, stream)
        blocks, matrices = np.indices((self.base, layout.rows_per_block))
        points = layout.matrices(A, B).reshape(-1, layout.dimension)
        feedback = yield self._points(joint, points, blocks.ravel(), matrices.ravel())
        each = self.base // self.replicates
        redraws = _Redraws(layout, A, B, feedback.status.reshape(blocks.shape), each)
        for number in range(1, MOST_ROUNDS + 1):
            proposed = redraws.proposals(joint, stream.child("redraws", number))
            if not proposed:
                return
            points, block, matrix = (
                np.concatenate(column) for column in zip(*proposed, strict=True)
            )
            feedback = yield self._points(joint, points, block, matrix)
            redraws.record(points, block, matrix, feedback.status)

    @property
    def replicate_count(self) -> int:
        return self.replicates

    def run_count(self, joint: JointDistribution) -> int:
        return self.base * self._layout(joint).rows_per_block

    def extension(self, earlier: Design, joint: JointDistribution) -> Extension:
        if not isinstance(earlier, Saltelli):
            return super().extension(earlier, joint)
        now, before = ((each.base, each.replicates) for each in (self, earlier))
        blocks = nested_replicates(now, before, powers_of_two=True, setting="base")
        # Blocks for indices of pairs contain those without, and likewise with A run twice.
        layouts = [each._layout(joint) for each in (self, earlier)]
        both = (all(each.second_order for each in layouts), all(each.noise for each in layouts))
        rows = BlockLayout(layouts[0].inputs, *both).rows_per_block
        lacking = {
            name: True
            for name in ("second_order", "noise")
            if getattr(earlier, name) and not getattr(self, name)
        }
        kept = (blocks.kept or 0) * rows
        return replace(blocks, kept=kept, nearest={**blocks.nearest, **lacking})

    def scaled(self, joint: JointDistribution, runs: int, *, replicated: bool) -> Saltelli | None:
        # It has two sets at least, and both halves of each must be balanced.
        replicates = self.replicates if replicated else 2
        each = runs // self._layout(joint).rows_per_block // replicates
        if each < 2:
            return None
        return replace(self, base=replicates << (each.bit_length() - 1), replicates=replicates)

    def _layout(self, joint: JointDistribution) -> BlockLayout:
        names = tuple(entry.variable.name for entry in joint.random)
        return BlockLayout(names, self.second_order, self.noise)

    def _base_matrices(
        self, joint: JointDistribution, stream: Stream
    ) -> tuple[FloatArray, FloatArray]:
        """Draw the matrices A and B: the two halves of points of twice the dimension."""
        each, dimension = self.base // self.replicates, len(joint.random)
        unit = np.concatenate(
            [
                sobol_points(stream.generator("points", replicate), each, 2 * dimension)
                for replicate in range(self.replicates)
            ]
        )
        return _input_points(joint, unit[:, :dimension]), _input_points(joint, unit[:, dimension:])

    def _points(
        self, joint: JointDistribution, points: FloatArray, block: IntArray, matrix: IntArray
    ) -> xr.Dataset:
        layout = self._layout(joint)
        coordinates: dict[str, Any] = {
            REPLICATE: block // (self.base // self.replicates),
            BLOCK_NUMBER: block,
            MATRIX: matrix.astype(np.int16),
        }
        values = dict(zip(layout.inputs, points.T, strict=True))
        dataset = points_dataset(joint, values, coordinates, runs=len(points))
        dataset[MATRIX].attrs = layout.flag_attributes()
        dataset[BLOCK_NUMBER].attrs = {"units": "1", "long_name": "number of the run's block"}
        return dataset


def _input_points(joint: JointDistribution, unit: FloatArray) -> FloatArray:
    """Return points of the input space, a column for each random input."""
    return np.column_stack([*joint.ppf(unit).values()])


class _Redraws:
    """Parts of blocks that are still to be drawn, given the results of the rounds before.

    Rows of a part are proposed until one is admissible. Each is an unconditional draw but for the
    inputs that it shares; so the admissible one is a draw of the conditional distribution. `A` and
    `B`, shape (block, input), and `status`, shape (block, matrix), are of the first round. There
    are `each` blocks in a replicate.
    """

    def __init__(
        self,
        layout: BlockLayout,
        A: FloatArray,
        B: FloatArray,
        status: npt.NDArray[np.int8],
        each: int,
    ) -> None:
        self._layout = layout
        self._each = each
        self._first = (A, B)
        # Points whose inputs other parts share; replaced when they are drawn again.
        self._anchors = dict(enumerate(layout.matrices(A, B).swapaxes(0, 1)))
        self._settled: dict[int, BoolArray] = {}
        self._proposed: dict[int, BoolArray] = {}
        self._dropped = np.zeros(len(A), dtype=np.bool_)
        for number, part in layout.parts.items():
            # The row of the first round is a proposal only if its anchor's row is final.
            self._proposed[number] = self._may_be_proposed(part)
            reached = status[:, part.first]
            self._settled[number] = self._proposed[number] & (reached != Status.INADMISSIBLE)
            self._dropped |= self._settled[number] & (reached != Status.OK)

    def _may_be_proposed(self, part: PickFreezePart) -> BoolArray:
        if part.anchor is None:
            return np.ones(self._dropped.shape, dtype=np.bool_)
        return self._settled[part.anchor].copy()

    def proposals(
        self, joint: JointDistribution, stream: Stream
    ) -> list[tuple[FloatArray, IntArray, IntArray]]:
        """Return the next points, with the block and matrix of each; empty if all are drawn."""
        found = []
        for number, part in self._layout.parts.items():
            is_open = self._may_be_proposed(part) & ~self._settled[number] & ~self._dropped
            blocks = np.flatnonzero(is_open)
            if blocks.size:
                unit = self._unit_points(stream.child(number), blocks)
                points = self._shared_points(part, blocks, _input_points(joint, unit))
                found.append((points, blocks, np.full(blocks.shape, number)))
        return found

    def _unit_points(self, stream: Stream, blocks: IntArray) -> FloatArray:
        """Draw a point of the unit cube for each block, by its replicate and its place in it.

        So the point depends on no other block, and a larger design draws the same.
        """
        replicates, places = np.divmod(blocks, self._each)
        unit = np.empty((blocks.size, self._layout.dimension))
        for replicate in np.unique(replicates).tolist():
            inside = replicates == replicate
            drawn = stream.generator(replicate).random((places[inside].max() + 1, unit.shape[1]))
            unit[inside] = drawn[places[inside]]
        return unit

    def _shared_points(
        self, part: PickFreezePart, blocks: IntArray, fresh: FloatArray
    ) -> FloatArray:
        """Return new points with a part's shared inputs; the first rest is from A or B."""
        if part.anchor is None:
            return fresh
        proposed = self._proposed[part.matrix]
        points = np.where(proposed[blocks, np.newaxis], fresh, self._first[part.rest][blocks])
        proposed[blocks] = True
        shared = list(part.shared)
        points[:, shared] = self._anchors[part.anchor][blocks][:, shared]
        return points

    def record(
        self, points: FloatArray, block: IntArray, matrix: IntArray, status: npt.NDArray[np.int8]
    ) -> None:
        """Record the results of the proposals."""
        for number in np.unique(matrix).tolist():
            taken = (matrix == number) & (status != Status.INADMISSIBLE)
            self._settled[number][block[taken]] = True
            if number in self._anchors:
                self._anchors[number][block[taken]] = points[taken]
        self._dropped[block[(status != Status.OK) & (status != Status.INADMISSIBLE)]] = True
