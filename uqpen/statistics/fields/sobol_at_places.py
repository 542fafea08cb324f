"""Sobol' indices from pick-freeze blocks, at each place of a field and of the field as a whole."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import OF_FIELD
from uqpen.core.model import Output
from uqpen.designs.pick_freeze import MATRIX_A, MATRIX_B
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.estimate_vector import EstimateVector
from uqpen.statistics.fields.distances import DistanceShape
from uqpen.statistics.fields.field_sample import equal_columns
from uqpen.statistics.fields.place_arrays import input_place_array
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample_shape import SampleShape
from uqpen.statistics.sensitivity.block_variable import INDEX_ORDERS, BlockVariable, IndexTerms
from uqpen.statistics.sensitivity.input_measures import input_array
from uqpen.statistics.sensitivity.pick_freeze_blocks import PickFreezeBlocks

__all__ = ["sobol_indices_at_places"]

# Values that are taken together, so that memory is bounded: 2 MB.
_VALUES_TOGETHER = 2**18


def sobol_indices_at_places(
    runs: xr.Dataset, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Sobol' indices of a field: at each place, and weighted by the variance over all places.

    Where curves end, a block counts at the places that all of its curves reach. A place that fewer
    than half of the blocks reach has no indices. A field has no second-order indices, and none of
    its logarithm or of events.

    Yields
    ------
    name : str
        ``first_order``, ``total_order``, ``generalized_first_order``, ``generalized_total_order``.
    estimate : DataArray
        Along the dimensions of the field, ``input`` and ``bound``; the generalized ones along
        ``input`` and ``bound``.

    References
    ----------
    Lamboni, M., Monod, H. & Makowski, D. (2011). Reliab. Eng. Syst. Saf. 96, 450-459.
    Gamboa, F., Janon, A., Klein, T. & Lagnoux, A. (2014). Electron. J. Stat. 8, 575-603.
    """
    blocks = PickFreezeBlocks.from_runs(runs)
    values = runs[quantity.output.name].values.astype(np.float64)
    field = _Field(
        blocks, quantity.output, values.reshape(len(values), -1), quantity.confidence_level
    )
    inputs, level = blocks.layout.inputs, quantity.confidence_level
    sums = _FieldSums.of_none(blocks)
    for order, at_places in field.indices(sums).items():
        title = f"{INDEX_ORDERS[order]} Sobol' indices of {quantity.output.title}"
        array = input_place_array(at_places, quantity.output, inputs, title, level)
        yield order, array.assign_attrs(blocks.attributes)
        whole = field.whole_indices(order, sums) if sums.weight else at_places[0].each()
        generalized = input_array(whole, inputs, f"generalized {title}", level=level)
        yield f"{OF_FIELD}{order}", generalized.assign_attrs(blocks.attributes)


@dataclass(frozen=True, eq=False)
class _Places:
    """Places of a field that the same blocks reach, and where it varies.

    Parameters
    ----------
    reached : ndarray of bool, shape (block,)
        Which of all blocks reach them.
    variable : BlockVariable
        The values at each place, over these blocks.
    weights : ndarray, shape (place,)
        Variance at each place, times its part of the grid.
    """

    reached: BoolArray
    variable: BlockVariable
    weights: FloatArray

    def sum(self, terms: FloatArray) -> FloatArray:
        """Sum terms, shape (place, block), by the weights of places, as terms of all blocks."""
        found = np.zeros(len(self.reached))
        found[self.reached] = np.einsum("p,pb->b", self.weights, terms)
        return found * (len(self.reached) / terms.shape[-1])

    def indices(self, terms: IndexTerms) -> EstimateVector:
        """Return an index at each place, with a note on blocks that do not reach it."""
        note = "" if self.reached.all() else texts.ENDED_BLOCKS
        return self.variable.estimates(terms).with_further_note(note)


@dataclass(eq=False)
class _IndexSums:
    """Sums over the places of a field, each with its weight, of the terms of one index."""

    numerator: FloatArray
    informative: BoolArray
    value: float = 0.0

    def add(self, places: _Places, terms: IndexTerms) -> None:
        """Add some places."""
        self.value += float((places.weights * terms.value).sum())
        self.numerator += places.sum(terms.numerator)
        self.informative[places.reached] |= terms.informative.any(axis=0)


@dataclass(eq=False)
class _FieldSums:
    """Sums over the places of a field, each with its weight.

    Parameters
    ----------
    of_indices : dict of str to list of _IndexSums
        For each order and input.
    squares : ndarray, shape (matrix, block)
        Squared distances of the points A and B from the mean of the field.
    weight : float
        Sum of the weights.
    """

    of_indices: dict[str, list[_IndexSums]]
    squares: FloatArray
    weight: float = 0.0

    @classmethod
    def of_none(cls, blocks: PickFreezeBlocks) -> _FieldSums:
        """Return the sums over no place."""
        size, inputs = blocks.count, range(blocks.layout.dimension)
        return cls(
            {
                order: [_IndexSums(np.zeros(size), np.zeros(size, np.bool_)) for _ in inputs]
                for order in INDEX_ORDERS
            },
            np.zeros((2, size)),
        )

    def add(self, places: _Places) -> None:
        """Add the variance of some places."""
        self.weight += float(places.weights.sum())
        self.squares += [places.sum(each**2) for each in places.variable.drawn]


@dataclass(frozen=True)
class _WholeField(BlockVariable):
    """A field over blocks, whose values are the distances of the runs from its mean."""

    denominator: FloatArray = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def shape(self) -> SampleShape:
        """The shape of the distances."""
        return DistanceShape(self.sample)

    @property
    def _denominator(self) -> FloatArray:
        return self.denominator


@dataclass(frozen=True, eq=False)
class _Field:
    """A field over the runs of blocks, whose values have shape (run, place)."""

    blocks: PickFreezeBlocks
    output: Output
    values: FloatArray
    level: float

    def indices(self, sums: _FieldSums) -> dict[str, EstimateVector]:
        """Estimate the indices of each order, of shape (place, input), and add the places up."""
        found: dict[str, list[tuple[IntArray, EstimateVector]]] = {
            each: [] for each in INDEX_ORDERS
        }
        for positions, part in self._parts():
            if isinstance(part, _Places):
                sums.add(part)
            for order, vectors in found.items():
                vectors.append((positions, self._indices(order, part, len(positions), sums)))
        return {order: EstimateVector.joined(vectors) for order, vectors in found.items()}

    def _indices(
        self, order: str, part: _Places | str, places: int, sums: _FieldSums
    ) -> EstimateVector:
        """Return indices at some places; a text is the reason why these have none."""
        of_inputs = sums.of_indices[order]
        if isinstance(part, str):
            return EstimateVector.without_bounds(np.full((places, len(of_inputs)), np.nan), part)
        columns = []
        for i, sum_of_input in enumerate(of_inputs):
            terms: IndexTerms = getattr(part.variable, f"{order}_terms")(i)
            columns.append(part.indices(terms))
            sum_of_input.add(part, terms)
        return EstimateVector.stack(columns)

    def whole_indices(self, order: str, sums: _FieldSums) -> list[Estimate]:
        """Estimate the indices of the field as a whole from the sums over its places."""
        distances = np.full(len(self.values), np.nan)
        for matrix, row in zip((MATRIX_A, MATRIX_B), sums.squares, strict=True):
            distances[self.blocks.rows[matrix]] = np.sqrt(row)
        variance = sums.squares.mean(axis=0)
        whole = _WholeField(self.blocks, distances, level=self.level, denominator=variance)
        return [
            estimate
            for each in sums.of_indices[order]
            for estimate in whole.estimates(
                IndexTerms(np.asarray(each.value / sums.weight), each.numerator, each.informative)
            ).each()
        ]

    def _parts(self) -> Iterator[tuple[IntArray, _Places | str]]:
        """Yield places by their positions, or the reason why they have no indices."""
        exists = ~np.isnan(self.values)
        reached = np.logical_and.reduce([exists[part] for part in self.blocks.rows.values()])
        for group in equal_columns(reached):
            blocks = self.blocks.subset(reached[:, group[0]])
            if 2 * blocks.count < self.blocks.count:
                yield group, texts.FEW_BLOCKS_REACH
            elif not blocks.count:
                yield group, texts.NO_BLOCK
            else:
                step = max(_VALUES_TOGETHER // len(self.values), 1)
                for start in range(0, len(group), step):
                    part = group[start : start + step]
                    yield from self._varying(part, reached[:, part[0]], blocks)

    def _varying(
        self, places: IntArray, reached: BoolArray, blocks: PickFreezeBlocks
    ) -> Iterator[tuple[IntArray, _Places | str]]:
        # The values of a place next to each other, as sums are then the same as of it alone.
        values = np.ascontiguousarray(self.values[:, places].T)
        varies = ~BlockVariable(blocks, values).sample.is_constant
        if not varies.all():
            yield places[~varies], texts.CONSTANT_OUTPUT
        if varies.any():
            variable = BlockVariable(blocks, values[varies], level=self.level)
            weights = (
                self.output.place_weights[places[varies]] * (variable.shape.std / self.unit) ** 2
            )
            yield places[varies], _Places(reached, variable, weights)

    @cached_property
    def unit(self) -> float:
        """Range of the values; squares of values over it do not overflow."""
        completed = [self.values[rows] for rows in self.blocks.rows.values()]
        ends = [
            (np.fmin.reduce(each, axis=None), np.fmax.reduce(each, axis=None)) for each in completed
        ]
        lowest, highest = np.transpose(ends)
        return float(np.fmax.reduce(highest) - np.fmin.reduce(lowest)) or 1.0
