"""Sobol' indices from pick-freeze blocks: shares of the inputs in an output's variance."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import (
    CONDITIONAL,
    OF_CATEGORY,
    OF_EXCEEDANCE,
    OF_LOGARITHM,
    PAIR,
    REPLICATE,
    ROUND,
    STATUS,
)
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.designs.saltelli import MATRIX_A, MATRIX_B, BlockLayout
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.probabilities import (
    category_coordinates,
    threshold_coordinates,
)
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around
from uqpen.statistics.estimate import LEVEL, Estimate
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.intervals import group_sums, ratio_jackknife_error, student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample, SampleShape
from uqpen.statistics.sensitivity import salib_estimators
from uqpen.statistics.sensitivity.input_measures import event_array, input_array

__all__ = ["INDEX_ORDERS", "BlockVariable", "IndexTerms", "PickFreezeBlocks", "sobol_indices"]

# Complete blocks of a pick-freeze design.


@dataclass(frozen=True)
class PickFreezeBlocks:
    """Complete blocks: those whose runs all completed.

    Parameters
    ----------
    layout : BlockLayout
        The parts of a block.
    rows : dict of int to ndarray of int, shape (block,)
        The number of the run of each part, by the part's matrix.
    replicate : ndarray of int, shape (block,)
        The replicate of each block. Only replicates with a block are numbered.
    attributes : dict of str to int or str
        Attributes of indices from these blocks: numbers of used and dropped blocks, and the joint
        distribution that the indices refer to.
    """

    layout: BlockLayout
    rows: dict[int, IntArray]
    replicate: IntArray
    attributes: dict[str, int | str]

    @classmethod
    def from_runs(cls, runs: xr.Dataset) -> PickFreezeBlocks:
        """Return the complete blocks in the runs of a design."""
        layout = BlockLayout.from_runs(runs)
        rows = layout.run_numbers(runs)
        status = runs[STATUS].values
        reached = np.array(
            [np.where(part < 0, Status.INADMISSIBLE, status[part]) for part in rows.values()]
        )
        whole = np.flatnonzero((reached == Status.OK).all(axis=0))
        lost = (reached != Status.OK) & (reached != Status.INADMISSIBLE)
        dropped_blocks = int(lost.any(axis=0).sum())
        unsettled = reached.shape[1] - len(whole) - dropped_blocks
        is_conditional = ROUND in runs.coords or (status == Status.INADMISSIBLE).any()
        condition = runs.attrs.get(CONDITIONAL, texts.ADMISSIBLE_INPUTS)
        estimand = texts.ESTIMAND
        if is_conditional:
            estimand = texts.ESTIMAND_IF.format(condition=condition)
        if dropped_blocks:
            estimand += f"; {texts.FAILED_BLOCKS}"
        if unsettled:
            is_absent = CONDITIONAL in runs.attrs  # some of them, of an output that not all have
            estimand += f"; {texts.ABSENT_BLOCKS if is_absent else texts.INADMISSIBLE_BLOCKS}"
        chosen = {number: part[whole] for number, part in rows.items()}
        _, replicate = np.unique(runs[REPLICATE].values[chosen[MATRIX_A]], return_inverse=True)
        attributes: dict[str, int | str] = {
            "estimand": estimand,
            "blocks_used": len(whole),
            "blocks_dropped": reached.shape[1] - len(whole),
        }
        return cls(layout, chosen, replicate.astype(np.int64), attributes)

    def subset(self, chosen: BoolArray) -> PickFreezeBlocks:
        """Return some of the blocks, by a mask."""
        rows = {number: part[chosen] for number, part in self.rows.items()}
        _, replicate = np.unique(self.replicate[chosen], return_inverse=True)
        return replace(self, rows=rows, replicate=replicate.astype(np.int64))

    @property
    def count(self) -> int:
        """Number of complete blocks."""
        return len(self.replicate)

    @property
    def replicate_count(self) -> int:
        """Number of replicates with a complete block."""
        return int(self.replicate.max(initial=-1)) + 1


# A variable over the blocks of a pick-freeze design, and its Sobol' indices.

# The orders of indices of single inputs, with their names in titles.
INDEX_ORDERS = {"first_order": "first-order", "total_order": "total-order"}

# For an event in a seventh of the runs, the coverage of indices was 91 % with 128 blocks.
_ENOUGH_FOR_EVENTS = 500
# With fewer blocks that contribute to an index, replicates do not show its error: for a threshold
# exceeded in 0.8 % of the runs, the coverage of first-order indices was 28 % with 2 048 blocks.
_FEWEST_INFORMATIVE = 10

# A sum of as many standardized values as there ever are is exact to this.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class IndexTerms:
    """Terms of an index: the ratio of two sums over blocks.

    Parameters
    ----------
    value : ndarray, shape (...)
        The index.
    numerator : ndarray, shape (..., block)
        Of a variable with variance 1.
    informative : ndarray of bool, shape (..., block)
        The blocks that contribute.
    """

    value: FloatArray
    numerator: FloatArray
    informative: BoolArray


@dataclass(frozen=True)
class BlockVariable:
    """A variable over the runs of blocks, and its Sobol' indices.

    At places of a field it is a variable at each of them.

    Parameters
    ----------
    blocks : PickFreezeBlocks
    values : ndarray, shape (run,) or (place, run)
        The variable, in any unit. At no place it is constant.
    is_event : bool
        True if it is the indicator (0 or 1) of an event.
    level : float
        Confidence level of the intervals of its indices.
    """

    blocks: PickFreezeBlocks
    values: npt.NDArray[Any]
    is_event: bool = False
    level: float = LEVEL

    @cached_property
    def sample(self) -> Sample:
        """The points A and B of all blocks, as one sample."""
        drawn = np.concatenate([self.blocks.rows[MATRIX_A], self.blocks.rows[MATRIX_B]])
        everything = np.arange(len(drawn))
        return Sample(
            values=np.take(self.values, drawn, axis=-1).astype(np.float64),
            used=everything,
            missing=everything[:0],
            columns=InputColumns.none(len(drawn)),
            replicates=np.tile(self.blocks.replicate, 2),
            sampling=Sampling.PICK_FREEZE,
        )

    @cached_property
    def shape(self) -> SampleShape:
        """The shape of that sample."""
        return self.sample.shape

    def logarithm(self) -> BlockVariable:
        """Return the variable's logarithm; NaN for failed runs."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return replace(self, values=np.log(self.values))

    @property
    def is_positive(self) -> bool:
        """True if every value is above zero, in all parts."""
        rows = self.blocks.rows.values()
        return self.blocks.count > 0 and all((self.values[part] > 0).all() for part in rows)

    def first_order(self, i: int) -> Estimate:
        """Share of the variance that would go were input `i` known."""
        if reason := self.reason_without_indices:
            return Estimate.without_bounds(math.nan, reason)
        return self._single_estimate(self.first_order_terms(i))

    def first_order_terms(self, i: int) -> IndexTerms:
        """Return the terms of a first-order index of a variable that varies."""
        A, B = self.drawn
        AB = self._values_at(self.blocks.layout.part_sharing_one(i).matrix)
        numerator = B * (AB - A)
        telling = numerator != 0
        if self.is_event:
            # Only pairs of points that share the input and both see the rarer case inform on it.
            side = 1 if self.sample.values.mean() < 0.5 else -1
            telling = (side * B > 0) & (side * AB > 0)
        return IndexTerms(salib_estimators.first_order(A, AB, B), numerator, telling)

    def total_order(self, i: int) -> Estimate:
        """Share of the variance that would stay were all inputs but `i` known."""
        if reason := self.reason_without_indices:
            return Estimate.without_bounds(math.nan, reason)
        return self._single_estimate(self.total_order_terms(i))

    def total_order_terms(self, i: int) -> IndexTerms:
        """Return the terms of a total-order index of a variable that varies."""
        A, B = self.drawn
        AB = self._values_at(self.blocks.layout.part_sharing_others(i).matrix)
        value = salib_estimators.total_order(A, AB, B)
        return IndexTerms(value, (A - AB) ** 2 / 2, A != AB)

    def second_order(self, number: int) -> Estimate:
        """Share of the variance of a pair of inputs beyond their first-order indices."""
        if reason := self.reason_without_indices:
            return Estimate.without_bounds(math.nan, reason)
        layout = self.blocks.layout
        shared = layout.part_sharing_pair(number)
        A, B = self.drawn
        ABj, ABk = (
            self._values_at(layout.part_sharing_one(i).matrix) for i in layout.pairs[number]
        )
        assert shared.anchor is not None
        pair, BAj = self._values_at(shared.matrix), self._values_at(shared.anchor)
        numerator = BAj * pair - A * B - B * (ABj - A) - B * (ABk - A)
        value = salib_estimators.second_order(A, ABj, ABk, BAj, pair, B)
        return self._single_estimate(IndexTerms(value, numerator, numerator != 0))

    def _single_estimate(self, terms: IndexTerms) -> Estimate:
        (found,) = self.estimates(terms).each()
        return found

    @cached_property
    def drawn(self) -> tuple[FloatArray, FloatArray]:
        """Standardized values at the points A and B of each block."""
        return self._values_at(MATRIX_A), self._values_at(MATRIX_B)

    @cached_property
    def reason_without_indices(self) -> str:
        """Reason why there are no indices; empty if there are."""
        if not self.blocks.count:
            return texts.NO_BLOCK
        if self.sample.is_constant:
            return texts.CONSTANT_EVENT if self.is_event else texts.CONSTANT_OUTPUT
        return ""

    def _values_at(self, matrix: int) -> FloatArray:
        """Standardized values at a part of each block."""
        values = np.take(self.values, self.blocks.rows[matrix], axis=-1)
        mean, scale = (each[..., np.newaxis] for each in (self.shape.mean, self.shape.scale))
        return (values - mean) / scale / self.shape.deviations.std(axis=-1, keepdims=True)

    @cached_property
    def _denominator(self) -> FloatArray:
        """Contribution of each block to the variance."""
        A, B = self.drawn
        return (A**2 + B**2) / 2

    def estimates(self, terms: IndexTerms) -> Estimate:
        """Return an index with its interval."""
        value, blocks = terms.value, self.blocks
        if blocks.replicate_count < 2:
            return Estimate.without_bounds(value, texts.BLOCKS_OF_ONE_REPLICATE)
        # Where a replicate has all of the variance there are no bounds.
        with np.errstate(divide="ignore", invalid="ignore"):
            error, freedom = ratio_jackknife_error(
                terms.numerator, self._denominator, blocks.replicate, blocks.replicate_count
            )
        half = student_quantile(freedom, self.level) * error
        influence = terms.numerator - value[..., np.newaxis] * self._denominator
        over_blocks = influence.std(axis=-1, ddof=1) / math.sqrt(blocks.count)
        wide = np.maximum(half, student_quantile(blocks.count - 1, self.level) * over_blocks)
        is_uncertain = self.shape.is_uncertain
        half = np.where(is_uncertain, wide, half)
        warning = texts.DOUBTFUL_AS.format(reason=self._warning)
        found = Estimate(
            value,
            value - half,
            value + half,
            np.where(is_uncertain, texts.WIDER_OF_TWO, texts.JACKKNIFE),
            np.where(is_uncertain, "conservative", "nominal"),
            np.where(is_uncertain, warning, self._reservation),
        )
        found = found.remove_bounds_at(error < _ROUNDING, texts.NO_SCATTER_OF_STRATA)
        return self._without_doubtful_bounds(found, terms.informative)

    @property
    def _warning(self) -> str:
        if self.shape.hidden_tail:
            return texts.ONLY_BLOCKS.format(blocks=self.blocks.count)
        return self.shape.tail_note

    @property
    def _reservation(self) -> npt.NDArray[np.str_]:
        """Warning of a similar effect that may be hidden in the runs; empty for none."""
        if self.is_event:
            # It has no tail that could be hidden.
            is_small = self.blocks.count < _ENOUGH_FOR_EVENTS
            return np.where(is_small, texts.FEW_BLOCKS.format(blocks=_ENOUGH_FOR_EVENTS), "")
        return np.where(self.shape.is_doubtful, texts.DOUBTFUL_TAIL, "")

    def _without_doubtful_bounds(self, found: Estimate, informative: BoolArray) -> Estimate:
        """Return indices without the bounds that so few blocks contribute to."""
        spread = group_sums(self._denominator, self.blocks.replicate, self.blocks.replicate_count)
        is_in_one = spread.max(axis=-1) == spread.sum(axis=-1)
        found = found.remove_bounds_at(is_in_one, texts.VARIES_IN_ONE_REPLICATE)
        are_few = np.count_nonzero(informative, axis=-1) < _FEWEST_INFORMATIVE
        found = found.remove_bounds_at(are_few, texts.FEW_INFORMATIVE_BLOCKS)
        if self.is_event and not has_enough_runs_around(self.sample, self.sample.values.sum()):
            return Estimate.without_bounds(found.value, texts.TOO_ONE_SIDED)
        return found


def sobol_indices(
    runs: xr.Dataset, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Sobol' indices of an output, of its logarithm and of its exceedance of thresholds.

    Yields
    ------
    name : str
        ``first_order``, ``total_order`` and, for a design with second order, ``second_order``;
        ``log_first_order``, ``log_total_order`` where all values are positive;
        ``exceedance_first_order``, ``exceedance_total_order`` where thresholds are requested. For a
        categorical output, ``category_first_order`` and ``category_total_order`` alone.
    estimate : DataArray
        Along ``input`` (``second_order`` along ``pair``) and ``bound``; the indices of exceedance
        first along ``threshold``, those of categories first along ``category``.
    """
    blocks = PickFreezeBlocks.from_runs(runs)
    level = quantity.confidence_level
    name, title = quantity.output.name, quantity.output.title
    values = runs[name].values
    if kinds := quantity.output.categories:
        events = (
            BlockVariable(blocks, values == kind, is_event=True, level=level)
            for kind in range(len(kinds))
        )
        coordinates = category_coordinates(quantity)
        what = f"the kind of {title}"
        yield from _event_indices(blocks, level, events, OF_CATEGORY, what, coordinates)
        return
    column = BlockVariable(blocks, values, level=level)
    yield from _variable_indices(column, "", title)
    if blocks.layout.pairs:
        yield _pair_indices(column, title)
    if column.is_positive:
        yield from _variable_indices(column.logarithm(), OF_LOGARITHM, f"the logarithm of {title}")
    if quantity.thresholds:
        events = (
            BlockVariable(blocks, values > each.value, is_event=True, level=level)
            for each in quantity.thresholds
        )
        what = f"whether {title} exceeds a value"
        coordinates = threshold_coordinates(quantity)
        yield from _event_indices(blocks, level, events, OF_EXCEEDANCE, what, coordinates)


def _variable_indices(
    column: BlockVariable, prefix: str, title: str
) -> Iterator[tuple[str, xr.DataArray]]:
    """First- and total-order indices along ``input``."""
    blocks = column.blocks
    for order, adjective in INDEX_ORDERS.items():
        long_name = f"{adjective} Sobol' indices of {title}"
        estimates, inputs = _input_estimates(column, order), blocks.layout.inputs
        array = input_array(estimates, inputs, long_name, level=column.level)
        yield f"{prefix}{order}", array.assign_attrs(blocks.attributes)


def _event_indices(
    blocks: PickFreezeBlocks,
    level: float,
    events: Iterable[BlockVariable],
    prefix: str,
    title: str,
    coordinates: Mapping[str, Any],
) -> Iterator[tuple[str, xr.DataArray]]:
    """First- and total-order indices of several events, a row for each."""
    # Of many thresholds, the runs are in memory once.
    found = [[_input_estimates(event, order) for order in INDEX_ORDERS] for event in events]
    for place, (order, adjective) in enumerate(INDEX_ORDERS.items()):
        rows = [each[place] for each in found]
        long_name = f"{adjective} Sobol' indices of {title}"
        array = event_array(rows, coordinates, blocks.layout.inputs, long_name, level)
        yield f"{prefix}{order}", array.assign_attrs(blocks.attributes)


def _pair_indices(column: BlockVariable, title: str) -> tuple[str, xr.DataArray]:
    """Second-order indices along ``pair``."""
    layout = column.blocks.layout
    names = [(layout.inputs[i], layout.inputs[j]) for i, j in layout.pairs]
    array = Estimate.stack(
        [column.second_order(number) for number in range(len(names))],
        PAIR,
        units="1",
        long_name=f"second-order Sobol' indices of {title}",
        level=column.level,
    )
    texts = {
        PAIR: ([f"{one}, {other}" for one, other in names], "pair of inputs"),
        f"{PAIR}_first": ([one for one, _ in names], "first input of the pair"),
        f"{PAIR}_second": ([other for _, other in names], "second input of the pair"),
    }
    coordinates = {
        coordinate: (PAIR, np.array(entries, dtype=object), {"long_name": long_name})
        for coordinate, (entries, long_name) in texts.items()
    }
    attributes = column.blocks.attributes
    return "second_order", array.assign_coords(coordinates).assign_attrs(attributes)


def _input_estimates(column: BlockVariable, order: str) -> list[Estimate]:
    return [getattr(column, order)(i) for i in range(column.blocks.layout.dimension)]
