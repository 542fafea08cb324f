"""Saltelli's design: blocks of points that share inputs, for Sobol' indices."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.errors import Problem
from uqpen.core.labels import BLOCK_NUMBER, MATRIX, REPLICATE
from uqpen.core.limits import MOST_REPLICATES
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count, flag
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.designs.extension import Extension
from uqpen.designs.pick_freeze import BlockLayout, PickFreezePart
from uqpen.designs.quasi_monte_carlo import sobol_points
from uqpen.designs.replicated import nested_replicates, uneven_replicates
from uqpen.distributions.joint_distribution import JointDistribution, points_dataset

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MOST_ROUNDS", "Saltelli"]


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
        # Blocks for indices of pairs contain those without.
        rows = min(each._layout(joint).rows_per_block for each in (self, earlier))
        lacks_pairs = earlier.second_order and not self.second_order
        pairs = {"second_order": True} if lacks_pairs else {}
        return replace(blocks, kept=(blocks.kept or 0) * rows, nearest={**blocks.nearest, **pairs})

    def scaled(self, joint: JointDistribution, runs: int, *, replicated: bool) -> Saltelli | None:
        # It has two sets at least, and both halves of each must be balanced.
        replicates = self.replicates if replicated else 2
        each = runs // self._layout(joint).rows_per_block // replicates
        if each < 2:
            return None
        return replace(self, base=replicates << (each.bit_length() - 1), replicates=replicates)

    def _layout(self, joint: JointDistribution) -> BlockLayout:
        names = tuple(entry.variable.name for entry in joint.random)
        return BlockLayout(names, self.second_order)

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
