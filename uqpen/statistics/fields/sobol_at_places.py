"""Sobol' indices from pick-freeze blocks, at each place of a field and of the field as a whole."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.model import Output
from uqpen.designs.pick_freeze import MATRIX_A, MATRIX_B
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.fields.distances import DistanceShape
from uqpen.statistics.fields.field_sample import equal_columns
from uqpen.statistics.fields.place_arrays import input_place_array
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample_shape import SampleShape
from uqpen.statistics.sensitivity.block_variable import INDEX_ORDERS, BlockVariable, IndexTerms
from uqpen.statistics.sensitivity.input_measures import input_array
from uqpen.statistics.sensitivity.pick_freeze_blocks import PickFreezeBlocks

__all__ = ["sobol_indices_at_places"]


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
    indices = _FieldIndices(
        blocks, quantity.output, values.reshape(len(values), -1), quantity.confidence_level
    )
    for order, adjective in INDEX_ORDERS.items():
        title = f"{adjective} Sobol' indices of {quantity.output.title}"
        rows, whole = indices.of_order(order)
        inputs, level = blocks.layout.inputs, quantity.confidence_level
        places = input_place_array(rows, quantity.output, inputs, title, level)
        yield order, places.assign_attrs(blocks.attributes)
        generalized = input_array(whole, inputs, f"generalized {title}", level=level)
        yield f"generalized_{order}", generalized.assign_attrs(blocks.attributes)


class _PlaceVariable(BlockVariable):
    """The values of a field at a place."""

    @property
    def _tail_note(self) -> str:
        # Places have a text in common.
        return texts.HEAVY_TAIL_AT_PLACES


@dataclass(frozen=True)
class _Place:
    """A place of a field over the blocks that reach it.

    Parameters
    ----------
    variable : BlockVariable
        The values at the place.
    reached : ndarray of bool, shape (block,)
        Which of all blocks reach it.
    weight : float
        Its part of the grid times its variance; 0 without indices.
    reason : str
        Reason why it has no indices; empty where it has.
    """

    variable: BlockVariable
    reached: BoolArray
    weight: float
    reason: str

    def spread(self, terms: FloatArray) -> FloatArray:
        """Return terms of the blocks that reach the place, as terms of all blocks."""
        spread = np.zeros(len(self.reached))
        spread[self.reached] = terms * (self.weight * len(self.reached) / len(terms))
        return spread

    def noted(self, estimate: Estimate) -> Estimate:
        """Return an estimate with a note on blocks that do not reach the place."""
        note = "" if self.reached.all() else texts.ENDED_BLOCKS
        return estimate.with_note(estimate.note, note)


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
class _FieldIndices:
    """Sobol' indices of a field over the runs of blocks, whose values have shape (run, place)."""

    blocks: PickFreezeBlocks
    output: Output
    values: FloatArray
    level: float

    @cached_property
    def places(self) -> Sequence[_Place]:
        """All places."""
        weights = self.output.place_weights
        exists = ~np.isnan(self.values)
        reached = np.logical_and.reduce([exists[part] for part in self.blocks.rows.values()])
        completed = self.values[np.concatenate([*self.blocks.rows.values()])]
        unit = float(np.nanmax(completed) - np.nanmin(completed)) if reached.any() else 1.0
        found: dict[int, _Place] = {}
        for group in equal_columns(reached):
            blocks = self.blocks.subset(reached[:, group[0]])
            is_few = 2 * blocks.count < self.blocks.count
            for place in group.tolist():
                variable = _PlaceVariable(blocks, self.values[:, place], level=self.level)
                reason = texts.FEW_BLOCKS_REACH if is_few else variable.reason_without_indices
                weight = 0.0 if reason else weights[place] * (variable.std / (unit or 1.0)) ** 2
                found[place] = _Place(variable, reached[:, place], weight, reason)
        return [found[place] for place in range(len(found))]

    @cached_property
    def whole(self) -> BlockVariable:
        """The field as a whole."""
        squares = np.zeros((2, self.blocks.count))
        for place in self.places:
            if place.weight:
                squares += [place.spread(each**2) for each in place.variable.drawn]
        distances = np.full(len(self.values), np.nan)
        for matrix, row in zip((MATRIX_A, MATRIX_B), squares, strict=True):
            distances[self.blocks.rows[matrix]] = np.sqrt(row)
        return _WholeField(
            self.blocks, distances, level=self.level, denominator=squares.mean(axis=0)
        )

    def of_order(self, order: str) -> tuple[list[list[Estimate]], list[Estimate]]:
        """Return the indices of all inputs at each place, and of the whole field."""
        inputs = range(self.blocks.layout.dimension)
        columns = [self._of_input(order, i) for i in inputs]
        rows = [[column[0][place] for column in columns] for place in range(len(self.places))]
        return rows, [whole for _, whole in columns]

    def _of_input(self, order: str, i: int) -> tuple[list[Estimate], Estimate]:
        found, weight = [], math.fsum(place.weight for place in self.places)
        value, numerator = 0.0, np.zeros(self.blocks.count)
        informative = np.zeros(self.blocks.count, dtype=np.bool_)
        for place in self.places:
            if place.reason:
                found.append(Estimate.without_bounds(math.nan, place.reason))
                continue
            terms: IndexTerms = getattr(place.variable, f"{order}_terms")(i)
            found.append(place.noted(place.variable.estimate(terms)))
            value += place.weight * terms.value
            numerator += place.spread(terms.numerator)
            informative[place.reached] |= terms.informative
        if not weight:
            return found, found[0]
        return found, self.whole.estimate(IndexTerms(value / weight, numerator, informative))
